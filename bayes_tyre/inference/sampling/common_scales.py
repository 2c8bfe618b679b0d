"""Common, unknown factors on what was measured: a gauge that reads 5 % short, a load cell that reads 1 % too much.

True displacement is `displacement_scale` times the measured one, true force `force_scale` times; both are log-normal
about 1. Records cannot tell them from k, beta, J and the rest: Equation 2 holds for any, with each parameter times a
power of the factor. Every draw takes one of the prior. All k move together, and all beta, so that no ratio of two k or
of two beta changes. Displacement has no power in C = F_i + J - k d_i, since d_i is scaled as k is divided.

So does the equation of motion, where the factor on displacement is one on acceleration too, as that of a lever arm is.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.record import DISPLACEMENT_SCALE_SD, FORCE_SCALE_SD

#: By the name of a factor in a posterior: the power with which each parameter follows it, whatever its level.
POWERS: Mapping[str, Mapping[str, float]] = {
    "displacement_scale": {"k": -1.0, "beta": 1.0, "m": -1.0, "c": -1.0},
    "force_scale": dict.fromkeys(("k", "J", "C", "F_i", "sigma", "x", "settled", "m", "c"), 1.0),
}
#: What a parameter is called at its levels; the effects of factors are of logarithms, which a common factor leaves.
_LEVELS = ("{}", "{}_case", "{}_group", "{}_typical", "sd_{}")


def with_scales_of(table: pd.DataFrame, model: ModelSettings) -> ModelSettings:
    """Return options with how well factors are known where they do not say: by the table's columns, or else exactly.

    The factor is common to all records, so that of several rigs the least accurate one counts.

    Raises
    ------
    BadInput
        For a column that holds something else.
    """
    named = (DISPLACEMENT_SCALE_SD, FORCE_SCALE_SD)
    return replace(model, **{name: largest_sd(table, name) for name in named if getattr(model, name) is None})


def largest_sd(table: pd.DataFrame, column: str) -> float:
    """Return the largest relative standard deviation in a column; 0 without the column, or where it is empty.

    Raises
    ------
    BadInput
        As `with_scales_of` does.
    """
    if column not in table.columns:
        return 0.0
    empty = table[column].isna() | (table[column].astype(str).str.strip() == "")
    given = pd.to_numeric(table[column], errors="coerce")
    bad = ~empty & ~given.between(0.0, 1.0)
    if bad.any():
        record, cell = (str(table.loc[bad, name].iloc[0])[:40] for name in ("record", column))
        raise BadInput(
            f"record {record!r}, column {column}: {cell!r} is no relative standard deviation from 0 to 1 (0.02 for "
            "2 %); mend the cell or remove the column"
        )
    return float(given[~empty].max()) if not empty.all() else 0.0


def with_scale(tree: xr.DataTree, name: str, relative_sd: float, seed: int) -> xr.DataTree:
    """Return the posterior under an unknown factor.

    Parameters
    ----------
    tree:
        A posterior of records or motions; what is computed from parameters is added to it afterwards.
    name:
        Of the factor, in `POWERS`.
    relative_sd:
        Standard deviation of the factor's logarithm, such as 0.05.
    seed:
        Of the factors.
    """
    posterior = tree["posterior"].to_dataset()
    shape = (posterior.sizes["chain"], posterior.sizes["draw"])
    drawn = np.exp(relative_sd * np.random.default_rng(seed).standard_normal(shape))
    factor = xr.DataArray(drawn, dims=("chain", "draw"), attrs={"units": "1"})
    scaled_tree = tree.copy()
    scaled_tree["posterior"] = xr.DataTree(_scaled(posterior, name, factor).assign({name: factor}))
    return scaled_tree


def as_measured(posterior: xr.Dataset) -> xr.Dataset:
    """Return a posterior's parameters for displacement and force as they were measured, if it has factors on them."""
    for name in POWERS:
        if name in posterior:
            posterior = _scaled(posterior, name, 1.0 / posterior[name])
    return posterior


def of_factors(posterior: xr.Dataset) -> set[str]:
    """Return the parameters of a posterior that follow the factors in it."""
    names = {parameter for name in POWERS if name in posterior for parameter in POWERS[name]}
    return {level.format(parameter) for parameter in names for level in _LEVELS} & set(map(str, posterior.data_vars))


def _scaled(posterior: xr.Dataset, name: str, factor: xr.DataArray) -> xr.Dataset:
    scaled = {}
    for parameter, power in POWERS[name].items():
        for variable in (level.format(parameter) for level in _LEVELS):
            if variable in posterior:
                of_all = posterior[variable]
                scaled[variable] = (of_all * factor**power).transpose(*of_all.dims).assign_attrs(of_all.attrs)
    return posterior.assign(scaled)
