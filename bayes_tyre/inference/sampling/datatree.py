"""What a posterior holds: the name, the dimension and the unit of every quantity kept of the models' sites."""

import json
from collections.abc import Mapping, Sequence
from itertools import compress
from typing import Any

import arviz_base
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import INTERACTIONS, Factors
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.record_levels import COVARIATE, LEVELS
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import EQUATION_2
from bayes_tyre.record import AXLE_PARAMETERS, CASE_FACTORS, ENERGY, FACTORS, LAW_PARAMETERS, RECORD_UNITS, Case

#: Parameters that every case has.
CASE_PARAMETERS = ("k", "beta")
#: Options of a model that decide its posterior, beside its priors and the sampler; and those whose values are text.
OPTIONS = (
    *("region", "initial_load", "repeats", "noise", "noise_window", "displacement_sd", "law"),
    *(*LEVELS, "covariates"),
)
_TEXT_OPTIONS = ("region", "initial_load", "repeats", "noise", "law")
#: Attribute of a posterior's root: which records it was fitted to (`Batch.digest` of the points that it used).
RECORDS_DIGEST = "records_sha256"


def _quantities() -> dict[str, tuple[str | None, str]]:
    """Return dimension (None: a scalar) and unit (empty: a pure number) by name."""
    quantities: dict[str, tuple[str | None, str]] = {name: ("record", unit) for name, unit in RECORD_UNITS.items()}
    quantities |= {"outlier_probability": ("record", ""), "rho": ("record", "")}
    quantities["x_case"] = ("case", "kN")
    for name in dict.fromkeys((*CASE_PARAMETERS, *LAW_PARAMETERS, *AXLE_PARAMETERS)):
        if name == "x":  # follows from `settled`, k and beta
            continue
        quantities[f"{name}_case"] = ("case", RECORD_UNITS[name])
        quantities[f"{name}_apart_probability"] = ("case", "")
        quantities[f"{name}_group"] = ("group", RECORD_UNITS[name])
        for factor in ("speed", "load", "step", *INTERACTIONS):
            quantities[f"log_{name}_{factor}"] = (factor, "")
            quantities[f"sd_log_{name}_{factor}"] = (None, "")
        quantities[f"sd_log_{name}_case"] = (None, "")
        for level in LEVELS:
            quantities[f"log_{name}_{level}"] = (level, "")
            quantities[f"sd_log_{name}_{level}"] = (None, "")
        quantities[f"log_{name}_{COVARIATE}"] = (COVARIATE, "")
        for of in ("repeat", "published"):
            quantities[f"sd_log_{name}_{of}"] = (None, "")
            quantities[f"sd_log_{name}_{of}_over_speeds"] = (None, "")
            quantities[f"sd_log_{name}_{of}_by_speed"] = ("speed", "")
    pure = ("discordant_weight", "student_nu", "sd_log_sigma", "noise_nu", "atanh_rho_typical", "sd_atanh_rho")
    quantities |= dict.fromkeys(pure, (None, ""))
    quantities |= {"J_group": ("group", "kN"), "sd_J": (None, "kN"), "sigma_typical": (None, "kN")}
    return quantities


QUANTITIES = _quantities()
#: Those that are a probability in every draw, near 0 or 1 in most of them: their mean is what is reported.
PROBABILITIES = tuple(name for name in QUANTITIES if name.endswith("_probability"))


def case_parameters(posterior: xr.Dataset) -> tuple[str, ...]:
    """Return the parameters that the cases of a posterior have: what its model is follows from what it holds."""
    return shown_parameters(posterior, (*LAW_PARAMETERS, *AXLE_PARAMETERS, ENERGY), "_case")


def shown_parameters(posterior: xr.Dataset, among: Sequence[str], ending: str = "") -> tuple[str, ...]:
    """Return those parameters that a posterior has; where it has x, `settled` is only what x was sampled by."""
    has = [name for name in among if f"{name}{ending}" in posterior]
    return tuple(name for name in has if name != "settled" or "x" not in has)


def is_of_motions(posterior: xr.Dataset) -> bool:
    """Return whether a posterior is of motions."""
    return "m_case" in posterior


def to_datatree(
    draws: Mapping[str, np.ndarray],
    statistics: Mapping[str, np.ndarray],
    factors: Factors,
    factor_table: pd.DataFrame,
    attributes: Mapping[str, str],
) -> xr.DataTree:
    """Return draws as an ArviZ DataTree with named dimensions, labels, factors and units.

    Along an interaction of `INTERACTIONS` it has the levels with an effect to be known. That of the others
    (`bayes_tyre.inference.model.factors.Factor.free`) is zero by construction: no unknown, and with no place in tables,
    figures and diagnostics. What is sampled stays, even if it happens to be constant.

    Parameters
    ----------
    draws:
        By site, shape (chains, draws, ...); sites that `QUANTITIES` does not name are left out.
    statistics:
        By name as ArviZ has them (`diverging`, `energy`, ...), shape (chains, draws).
    factors, factor_table:
        What the cases, records and groupings are called; `factor_table` has a row a record, or none. A column
        `travel_mm` in it, how far a record goes from its start, is kept beside the factors.
    attributes:
        Put on the root: origin of the data, the model.
    """
    free = {name: getattr(factors, name).free for name in INTERACTIONS}
    arrays = {name: np.asarray(draws[name]) for name in QUANTITIES if name in draws}
    arrays |= {name: arrays[name][..., free[dim]] for name in arrays if (dim := QUANTITIES[name][0]) in free}
    groupings = {name: getattr(factors, name).labels for name in ("group", "speed", "load", "step")}
    groupings |= factors.levels.labels
    groupings |= {name: tuple(compress(getattr(factors, name).labels, free[name])) for name in INTERACTIONS}
    coordinates = {"case": [case.label for case in factors.cases], "record": list(factor_table["record"]), **groupings}
    tree = arviz_base.from_dict(
        {"posterior": arrays, "sample_stats": dict(statistics)},
        coords={name: np.asarray(labels) for name, labels in coordinates.items() if len(labels)},
        dims={name: [dim] for name in arrays if (dim := QUANTITIES[name][0])},
    )
    posterior = _with_factors(tree["posterior"].to_dataset(), factors, factor_table)
    for name in arrays:
        posterior[name].attrs["units"] = QUANTITIES[name][1] or "1"
    tree["posterior"] = xr.DataTree(posterior)
    tree.attrs.update(attributes)
    return tree


def draws_in_a_row(draws: xr.DataArray) -> np.ndarray:
    """Return draws of all chains in a row, shape (draws, ...)."""
    by_chain = draws.transpose("chain", "draw", ...).to_numpy()
    return by_chain.reshape(-1, *by_chain.shape[2:])


def sd_repeat_of_cases(posterior: xr.Dataset, parameter: str, factors: Factors) -> Float[np.ndarray, "draws cases"]:
    """Return draws of the standard deviation of repeats of a parameter's logarithm, of each case."""
    by_speed = f"sd_log_{parameter}_repeat_by_speed"
    if by_speed in posterior:
        return draws_in_a_row(posterior[by_speed])[:, factors.speed.of_case]
    return np.repeat(draws_in_a_row(posterior[f"sd_log_{parameter}_repeat"])[:, None], len(factors.cases), axis=1)


def _with_factors(posterior: xr.Dataset, factors: Factors, factor_table: pd.DataFrame) -> xr.Dataset:
    """Return the posterior with the factors as labels along its cases and records."""
    cases = pd.DataFrame(factors.cases)
    for dim, table in (("case", cases), ("record", factor_table)):
        if dim in posterior.dims:
            columns = [word for word in (*FACTORS, "travel_mm") if word in table]
            posterior = posterior.assign_coords(
                {f"{dim}_{word}": (dim, np.asarray(table[word].tolist())) for word in columns}
            )
    if "record" not in posterior.dims:
        return posterior
    for name, level in factors.levels.groupings.items():
        posterior = posterior.assign_coords({f"record_{name}": ("record", np.asarray(level.labels)[level.of_record])})
    if (covariates := factors.levels.covariates) is not None:
        of_records = {f"record_{COVARIATE}": (("record", COVARIATE), covariates.values)}
        posterior = posterior.assign_coords({**of_records, f"{COVARIATE}_sd": (COVARIATE, covariates.sd)})
    return posterior


def record_offset(posterior: xr.Dataset, parameter: str) -> xr.DataArray | float:
    """Return what specimen, day and covariates add to the logarithm of each record's k or beta; 0 without any."""
    parts: list[xr.DataArray | float] = [
        posterior[f"log_{parameter}_{level}"].sel({level: posterior[f"record_{level}"]})
        for level in LEVELS
        if f"record_{level}" in posterior.coords
    ]
    if f"record_{COVARIATE}" in posterior.coords:
        parts.append((posterior[f"log_{parameter}_{COVARIATE}"] * posterior[f"record_{COVARIATE}"]).sum(COVARIATE))
    return sum(parts, 0.0)


def tree_cases(posterior: xr.Dataset) -> list[Case]:
    """Return the cases of a posterior in its order; None where the data did not have the word."""
    columns = [posterior[f"case_{word}"].to_numpy().tolist() for word in CASE_FACTORS]
    return [Case._make(None if value != value else value for value in row) for row in zip(*columns, strict=True)]


def law_of(tree: xr.DataTree) -> str:
    """Return the law that a posterior of records was fitted with; Equation 2 where it does not say."""
    return str(tree.attrs.get("law", EQUATION_2))


def attributes_of(model: ModelSettings) -> dict[str, str]:
    """Return what a posterior says of the model that it was fitted with, as attributes of its root."""
    options = {name: json.dumps(getattr(model, name)) for name in OPTIONS if name not in _TEXT_OPTIONS}
    text_options = {name: getattr(model, name) for name in _TEXT_OPTIONS}
    return text_options | options | {"priors": model.priors.to_json()}


def model_of(tree: xr.DataTree) -> ModelSettings:
    """Return the model of a posterior of records, as far as it says; noise that it does not speak of is independent."""
    stored = {name: str(tree.attrs[name]) for name in OPTIONS if name in tree.attrs}
    # An earlier version wrote Python's None.
    texts = {name: "null" if text == "None" else text for name, text in stored.items() if name not in _TEXT_OPTIONS}
    options: dict[str, Any] = {name: json.loads(text) for name, text in texts.items()}
    text_options = {name: text for name, text in stored.items() if name in _TEXT_OPTIONS}
    return ModelSettings(**{"noise": "iid", **text_options, **options}, priors=priors_of(tree))


def priors_of(tree: xr.DataTree) -> Priors:
    """Return the priors that a posterior was fitted with; the defaults where it does not say."""
    return PRIORS.changed(json.loads(tree.attrs["priors"])) if "priors" in tree.attrs else PRIORS
