"""Means of k and beta by speed, load or step, over the same cases at each level, so that nothing else changes along."""

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.formats.constant_data import put_together
from bayes_tyre.inference.sampling.datatree import CASE_PARAMETERS, tree_cases
from bayes_tyre.record import CASE_FACTORS, RECORD_UNITS, parameter_column

#: What a mean may be taken by, with the unit: the size of a step, without its sign.
BY = {"speed_km_h": "km/h", "initial_load_kN": "kN", "step_size_kN": "kN"}

COLUMNS = (
    *("by", "level", "configuration", "cases", "parameter", "unit"),
    *("median", "lower", "upper", "interval", "printed"),
)


class Matched(NamedTuple):
    """Cases that are there at every one of some levels of a word.

    Attributes
    ----------
    levels:
        Of the word, ascending.
    cases:
        Indices of cases, shape (groups, levels): a row of cases differ in the word alone.
    """

    levels: tuple[float, ...]
    cases: np.ndarray


def matched(factor_table: pd.DataFrame, by: str) -> Matched:
    """Return the cases of one configuration that can be set against each other by a word.

    Cases that differ in nothing else make a group. The levels are those that most groups share, a group with more
    levels before one with fewer: of three loads measured at standstill and two of them while rolling, the three.

    Parameters
    ----------
    words:
        `direction`, `speed_km_h` (km/h), `initial_load_kN`, `step_kN` (signed), `step_size_kN` (kN), a row a case.
    by:
        A name in `BY`.
    """
    others = ["direction", *(word for word in BY if word != by)]
    groups = [dict(zip(of[by], of.index, strict=True)) for _, of in factor_table.groupby(others, sort=True)]
    sets = pd.Series([tuple(sorted(group)) for group in groups], dtype=object)
    if sets.empty:
        return Matched((), np.empty((0, 0), dtype=int))
    common = max(sets, key=lambda levels: (len(levels), int((sets == levels).sum()), levels))
    rows = [[group[level] for level in common] for group in groups if set(common) <= group.keys()]
    return Matched(common, np.array(rows))


def level_means(tree: xr.DataTree, printed: pd.DataFrame | None = None, interval: float = 0.95) -> pd.DataFrame:
    """Return the mean of k (kN/mm) and beta (mm) over matched cases at each level of speed, load and step size.

    Parameters
    ----------
    tree:
        A posterior with `k_case` and `beta_case`.
    printed:
        Printed `k_kN_per_mm` and `beta_mm` by case, averaged over the same cases where given.
    interval:
        Probability inside `lower` and `upper`, equal-tailed.

    Returns
    -------
    pandas.DataFrame
        `by`, `level`, `configuration`, `cases` (how many are averaged), `parameter`, `unit`, `median`, `lower`,
        `upper`, `interval`, `printed` (NaN where not given). A word with one level has no rows.
    """
    posterior = put_together(tree)["posterior"].to_dataset()
    factor_table = pd.DataFrame(tree_cases(posterior), columns=list(CASE_FACTORS))
    numbers = list(CASE_FACTORS[2:])
    factor_table[numbers] = factor_table[numbers].astype(float)  # NaN where the data did not have the word
    factor_table["step_size_kN"] = factor_table["step_kN"].abs()
    if printed is not None:
        factor_table = factor_table.merge(printed, on=list(CASE_FACTORS), how="left", validate="one_to_one")
    rows = []
    for configuration, mine in factor_table.groupby("configuration", sort=True):
        for by in BY:
            found = matched(mine, by)
            for level, cases in zip(found.levels, found.cases.T, strict=True):
                name = {"by": by, "level": level, "configuration": configuration, "cases": len(cases)}
                rows += [name | of for of in _means(posterior, factor_table, cases, interval)]
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    return table[table.groupby("by")["level"].transform("nunique") > 1].reset_index(drop=True)


def _means(
    posterior: xr.Dataset, factor_table: pd.DataFrame, cases: np.ndarray, interval: float
) -> list[dict[Hashable, object]]:
    tails = [(1.0 - interval) / 2.0, 0.5, (1.0 + interval) / 2.0]
    rows: list[dict[Hashable, object]] = []
    for parameter in CASE_PARAMETERS:
        draws = posterior[f"{parameter}_case"].to_numpy()[..., cases].mean(axis=-1)
        lower, median, upper = np.quantile(draws, tails)
        column = parameter_column(parameter)
        mean = factor_table.loc[cases, column].mean() if column in factor_table else np.nan
        numbers = {"median": median, "lower": lower, "upper": upper, "interval": interval, "printed": mean}
        rows.append({"parameter": parameter, "unit": RECORD_UNITS[parameter], **numbers})
    return rows
