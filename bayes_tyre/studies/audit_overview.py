"""The audit's table in few numbers: each method's errors and coverage, and what its beta follows."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy.stats import binomtest

from bayes_tyre.studies.audit_grid import SOURCE_WINDOW, TYPICAL, WINDOW, Tyre

#: Share of intervals that should hold the truth.
CLAIMED = 0.95


def at_source_window(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of methods as they are: `thesis` with the source's window, the others, which have none."""
    return table[table[WINDOW].isna() | (table[WINDOW] == SOURCE_WINDOW).fillna(False)]


def where_others_are_typical(table: pd.DataFrame, varied: tuple[str, ...]) -> pd.DataFrame:
    """Return the rows whose truths are typical but for the varied factors."""
    kept = np.ones(len(table), dtype=bool)
    for name in Tyre._fields:
        if name not in varied:
            kept &= np.isclose(table[name].to_numpy(dtype=float), getattr(TYPICAL, name))
    return table[kept]


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row a method and parameter at the source's window.

    Columns: `points`; `bias_median`, `bias_low`, `bias_high` (%) over points; `rmse_median` (%); `coverage_95` of all
    `intervals`; `coverage` in words; `returned`, `declined`, `doubted` records.
    """
    rows = []
    for (method, parameter), of in at_source_window(table).groupby(["method", "parameter"], sort=False):
        intervals = int(of["intervals"].sum())
        inside = round(float((of["coverage_95"] * of["intervals"]).sum()))
        bias = of["bias_percent"]
        rows.append(
            {"method": method, "parameter": parameter, "unit": of["unit"].iloc[0], "points": len(of)}
            | {"bias_median": bias.median(), "bias_low": bias.min(), "bias_high": bias.max()}
            | {"rmse_median": of["rmse_percent"].median()}
            | {"coverage_95": inside / intervals if intervals else np.nan, "intervals": intervals}
            | {"coverage": in_words(inside, intervals)}
            | {name: int(of[name].sum()) for name in ("returned", "declined", "doubted")}
        )
    return pd.DataFrame(rows)


def in_words(inside: int, intervals: int) -> str:
    """Return whether a count of intervals that hold the truth agrees with what they claim (exact binomial, 95 %)."""
    if not intervals:
        return "no intervals"
    around = binomtest(inside, intervals).proportion_ci(0.95, method="exact")
    if around.high < CLAIMED:
        return "too narrow"
    return "too wide" if around.low > CLAIMED else "agrees with 95 %"


class Followed(NamedTuple):
    """How a method's beta goes with the true one, at the source's window.

    Attributes
    ----------
    returned, true:
        Least and largest of the medians returned over points, and of their truths, mm.
    rank_correlation, points:
        Of medians and truths: Goodman and Kruskal's gamma, for which points of the same truth are no pair.
    span, share:
        The largest crossed level of the true beta over the least, and the part of that change, in logarithms, that
        comes back: 1 where all of it does, 0 where beta is blind, below 0 where it goes the other way.
    off_percent:
        Median over points of the size of the bias, %.
    """

    returned: tuple[float, float]
    true: tuple[float, float]
    rank_correlation: float
    points: int
    span: float
    share: float
    off_percent: float


def follow(table: pd.DataFrame, method: str) -> Followed | None:
    """Return how the beta of a method follows the true one; None where it returned nothing."""
    rows = table[(table["method"] == method) & (table["parameter"] == "beta")]
    of = at_source_window(rows).dropna(subset=["median"])
    if len(of) < 2:
        return None
    crossed = where_others_are_typical(of, ("beta_mm", "rise_s"))
    shares = [
        np.log(line["median"].iloc[-1] / line["median"].iloc[0]) / np.log(line["truth"].max() / line["truth"].min())
        for _, line in crossed.sort_values("truth").groupby("rise_s")
        if line["truth"].nunique() > 1
    ]
    return Followed(
        (float(of["median"].min()), float(of["median"].max())),
        (float(of["truth"].min()), float(of["truth"].max())),
        _rank_correlation(of["median"].to_numpy(), of["truth"].to_numpy()),
        len(of),
        float(crossed["truth"].max() / crossed["truth"].min()),
        float(np.mean(shares)) if shares else np.nan,
        float(of["bias_percent"].abs().median()),
    )


def _rank_correlation(returned: Float[np.ndarray, " points"], true: Float[np.ndarray, " points"]) -> float:
    one, other = np.triu_indices(len(true), k=1)
    pairs = true[one] != true[other]
    agree = np.sign(returned[one] - returned[other]) * np.sign(true[one] - true[other])
    return float(agree[pairs].mean()) if pairs.any() else np.nan


class Sway(NamedTuple):
    """By how much a factor alone changes beta: levels from and to, and largest over least, mean over the others."""

    low: float
    high: float
    factor: float


def sways(table: pd.DataFrame, method: str) -> dict[str, Sway]:
    """Return what true beta, rise time and window each do to a method's beta while the other two are held.

    Over the crossed points alone; true beta and rise time at the source's window.
    """
    crossed = ("beta_mm", "rise_s", WINDOW)
    rows = table[(table["method"] == method) & (table["parameter"] == "beta")].dropna(subset=["median"])
    rows = where_others_are_typical(rows, ("beta_mm", "rise_s"))
    rows = rows[rows.groupby(["beta_mm", "rise_s"])[WINDOW].transform("nunique") > 1]
    found = {}
    for name in crossed:
        held = [other for other in crossed if other != name]
        ratios = [
            np.log(line["median"].max() / line["median"].min())
            for _, line in (rows if name == WINDOW else at_source_window(rows)).groupby(held)
            if line[name].nunique() > 1
        ]
        if ratios:
            factors = rows[name].astype(float)
            found[name] = Sway(float(factors.min()), float(factors.max()), float(np.exp(np.mean(ratios))))
    return found


def ringing(table: pd.DataFrame, method: str, parameter: str) -> dict[float, float]:
    """Return the median of a parameter by damping ratio, all else typical, at the source's window."""
    rows = at_source_window(table[(table["method"] == method) & (table["parameter"] == parameter)])
    rows = where_others_are_typical(rows, ("damping_ratio",)).dropna(subset=["median"]).sort_values("damping_ratio")
    return dict(zip(rows["damping_ratio"].tolist(), rows["median"].tolist(), strict=True))
