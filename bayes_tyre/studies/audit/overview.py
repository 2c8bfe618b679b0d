"""Summary statistics of the audit's table: errors and coverage by method, and how its beta responds to each factor."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float

from bayes_tyre.studies.audit.grid import FACTORS, SOURCE_WINDOW, TYPICAL, WINDOW, Tyre
from bayes_tyre.studies.uniformity import share_interval

#: Nominal coverage of the intervals.
NOMINAL = 0.95


def at_source_window(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of `thesis` with the source's window, and of the other methods, which have no window."""
    return table[table[WINDOW].isna() | (table[WINDOW] == SOURCE_WINDOW).fillna(False)]


def where_others_are_typical(table: pd.DataFrame, varied: tuple[str, ...]) -> pd.DataFrame:
    """Return the rows whose truths are typical but for the varied factors."""
    mask = np.ones(len(table), dtype=bool)
    for name in Tyre._fields:
        if name not in varied:
            mask &= np.isclose(table[name].to_numpy(dtype=float), getattr(TYPICAL, name))
    return table[mask]


def bias_by_factor(table: pd.DataFrame, parameter: str) -> pd.DataFrame:
    """Return the rows of a parameter in which one factor varies and the others are typical, with `factor` and `level`.

    A method without a window has one row of factor `WINDOW`, its `level` NaN.
    """
    rows = table[table["parameter"] == parameter].dropna(subset=["bias_percent"])
    by_factor = []
    for factor in FACTORS:
        varied = where_others_are_typical(rows if factor == WINDOW else at_source_window(rows), (factor,))
        by_factor.append(varied.assign(factor=factor, level=varied[factor].astype(float)).sort_values("level"))
    return pd.concat(by_factor, ignore_index=True)


def beta_by_window(table: pd.DataFrame, method: str) -> pd.DataFrame:
    """Return the rows of a method's beta at the crossed points, each true beta and rise time with several windows."""
    rows = table[(table["method"] == method) & (table["parameter"] == "beta")].dropna(subset=["median"])
    rows = where_others_are_typical(rows, ("beta_mm", "rise_s"))
    return rows[rows.groupby(["beta_mm", "rise_s"])[WINDOW].transform("nunique") > 1]


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row a method and parameter at the source's window.

    Columns: `points`; `bias_median`, `bias_low`, `bias_high` (%) over points; `rmse_median` (%); `coverage_95` of all
    `intervals`, and `coverage_low`, `coverage_high`, its own 95 % interval; `coverage` as a verdict; `returned`,
    `declined`, `doubted` records.
    """
    rows = []
    for (method, parameter), points in at_source_window(table).groupby(["method", "parameter"], sort=False):
        intervals = int(points["intervals"].sum())
        inside = round(float((points["coverage_95"] * points["intervals"]).sum()))
        bias = points["bias_percent"]
        rows.append(
            {"method": method, "parameter": parameter, "unit": points["unit"].iloc[0], "points": len(points)}
            | {"bias_median": bias.median(), "bias_low": bias.min(), "bias_high": bias.max()}
            | {"rmse_median": points["rmse_percent"].median()}
            | {"coverage_95": inside / intervals if intervals else np.nan, "intervals": intervals}
            | dict(zip(("coverage_low", "coverage_high"), share_interval(inside, intervals), strict=True))
            | {"coverage": coverage_verdict(inside, intervals)}
            | {name: int(points[name].sum()) for name in ("returned", "declined", "doubted")}
        )
    return pd.DataFrame(rows)


def coverage_verdict(inside: int, intervals: int) -> str:
    """Return whether the count of intervals with the truth agrees with nominal coverage (exact binomial, 95 %)."""
    if not intervals:
        return "no intervals"
    low, high = share_interval(inside, intervals)
    if high < NOMINAL:
        return "too narrow"
    return "too wide" if low > NOMINAL else "agrees with 95 %"


class BetaResponse(NamedTuple):
    """How a method's beta responds to the true beta, at the source's window.

    Attributes
    ----------
    returned, true:
        Least and largest of the medians returned over points, and of their truths, mm.
    rank_correlation, points:
        Of medians and truths: Goodman and Kruskal's gamma, for which points of the same truth are no pair.
    span, share:
        The largest crossed level of the true beta over the least, and the part of that change of log beta that is
        returned: 1 for all of it, 0 for none, below 0 where the change is opposite.
    bias_percent:
        Median over points of the size of the bias, %.
    """

    returned: tuple[float, float]
    true: tuple[float, float]
    rank_correlation: float
    points: int
    span: float
    share: float
    bias_percent: float


def beta_response(table: pd.DataFrame, method: str) -> BetaResponse | None:
    """Return how the beta of a method responds to the true one; None where it returned fewer than two."""
    rows = table[(table["method"] == method) & (table["parameter"] == "beta")]
    points = at_source_window(rows).dropna(subset=["median"])
    if len(points) < 2:
        return None
    crossed = where_others_are_typical(points, ("beta_mm", "rise_s"))
    shares = [
        np.log(line["median"].iloc[-1] / line["median"].iloc[0]) / np.log(line["truth"].max() / line["truth"].min())
        for _, line in crossed.sort_values("truth").groupby("rise_s")
        if line["truth"].nunique() > 1
    ]
    return BetaResponse(
        (float(points["median"].min()), float(points["median"].max())),
        (float(points["truth"].min()), float(points["truth"].max())),
        _rank_correlation(points["median"].to_numpy(), points["truth"].to_numpy()),
        len(points),
        float(crossed["truth"].max() / crossed["truth"].min()),
        float(np.mean(shares)) if shares else np.nan,
        float(points["bias_percent"].abs().median()),
    )


def _rank_correlation(returned: Float[np.ndarray, " points"], true: Float[np.ndarray, " points"]) -> float:
    one, other = np.triu_indices(len(true), k=1)
    pairs = true[one] != true[other]
    agree = np.sign(returned[one] - returned[other]) * np.sign(true[one] - true[other])
    return float(agree[pairs].mean()) if pairs.any() else np.nan


class FactorEffect(NamedTuple):
    """The effect of one factor on beta: its range; the largest beta over the least, geometric mean over the others."""

    low: float
    high: float
    ratio: float


def factor_effects(table: pd.DataFrame, method: str) -> dict[str, FactorEffect]:
    """Return the effects of true beta, rise time and window on a method's beta, the other two held.

    Over the crossed points alone; true beta and rise time at the source's window.
    """
    crossed = ("beta_mm", "rise_s", WINDOW)
    rows = beta_by_window(table, method)
    effects = {}
    for name in crossed:
        held = [other for other in crossed if other != name]
        ratios = [
            np.log(line["median"].max() / line["median"].min())
            for _, line in (rows if name == WINDOW else at_source_window(rows)).groupby(held)
            if line[name].nunique() > 1
        ]
        if ratios:
            levels = rows[name].astype(float)
            effects[name] = FactorEffect(float(levels.min()), float(levels.max()), float(np.exp(np.mean(ratios))))
    return effects


def ringing(table: pd.DataFrame, method: str, parameter: str) -> dict[float, float]:
    """Return the median of a parameter by damping ratio, all else typical, at the source's window."""
    rows = at_source_window(table[(table["method"] == method) & (table["parameter"] == parameter)])
    rows = where_others_are_typical(rows, ("damping_ratio",)).dropna(subset=["median"]).sort_values("damping_ratio")
    return dict(zip(rows["damping_ratio"].tolist(), rows["median"].tolist(), strict=True))
