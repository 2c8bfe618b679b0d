"""One stiffness from slow tests and step records of the same tyre, and how far apart the two are."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from jaxtyping import Float

K, K_SE = "k_kN_per_mm", "k_kN_per_mm_se"
#: What both tables tell a tyre and its state by.
SHARED = ("configuration", "speed_km_h")
#: From so many standard errors on the two are said to disagree: one pair of twenty does by chance.
APART = 1.959964
type _Values = Float[np.ndarray, " n"]
COLUMNS = (
    *(f"{K}_{part}{suffix}" for part in ("tests", "steps", "combined") for suffix in ("", "_se")),
    *("tests", "steps", "tension", "status"),
)


def shared_stiffness(tests: pd.DataFrame, steps: pd.DataFrame) -> pd.DataFrame:
    """Return the stiffness that slow tests and step records of the same tyre share, a row a configuration and speed.

    Least squares with one k for both: as each side says of k a value with a standard error, that is their mean weighted
    by the inverse variances. Each side's own is the weighted mean of its estimates; where these scatter more than their
    standard errors allow, its error grows by sqrt(chi^2 / (n - 1)), never below 1, so that a spread between repeats
    counts. `tension` is their difference, steps less tests, over its standard error: rate, speed of loading and the
    way a record was processed may all part them, and where it is large the combined value stands for neither.
    What all estimates of a side share, such as a sensor's scale, is in none of the errors.

    Parameters
    ----------
    tests:
        Rows of `load_deflection.csv`: `k_kN_per_mm` with its standard error (kN/mm), the words where known.
    steps:
        Rows of `least_squares.csv`, or any table with the same columns, as on flat ground. Its directions go together,
        for the law has one k.

    Returns
    -------
    pandas.DataFrame
        The words that both tables have; `k_kN_per_mm_tests`, `k_kN_per_mm_steps`, `k_kN_per_mm_combined`, each with
        `_se` (kN/mm); `tests` and `steps`, how many estimates; `tension` (standard errors); `status`. Only where both
        sides have one; rows without a value or a standard error are left out.
    """
    factor_table = [word for word in SHARED if _told(tests, word) and _told(steps, word)]
    sides = {"tests": _by_words(tests, factor_table), "steps": _by_words(steps, factor_table)}
    rows = []
    for case in sides["tests"]:
        if case not in sides["steps"]:
            continue
        row: dict[str, object] = dict(zip(factor_table, case, strict=True))
        (k_tests, se_tests), (k_steps, se_steps) = (weighted_mean(*sides[side][case]) for side in sides)
        combined = _inverse_variance([k_tests, k_steps], [se_tests, se_steps])
        tension = (k_steps - k_tests) / float(np.hypot(se_tests, se_steps))
        numbers = (k_tests, se_tests, k_steps, se_steps, *combined)
        counts = (len(sides["tests"][case][0]), len(sides["steps"][case][0]))
        rows.append(row | dict(zip(COLUMNS, (*numbers, *counts, tension, _status(tension)), strict=True)))
    return pd.DataFrame(rows, columns=[*factor_table, *COLUMNS])


def weighted_mean(values: Sequence[float] | np.ndarray, errors: Sequence[float] | np.ndarray) -> tuple[float, float]:
    """Return the mean weighted by inverse variances and its standard error, grown where the values scatter more.

    Source of the growth: the scale factor of the Particle Data Group (after Birge, 1932).

    Examples
    --------
    >>> weighted_mean([1.0, 1.0], [0.1, 0.1])
    (1.0, 0.0707...)
    """
    mean, error = _inverse_variance(values, errors)
    if len(values) < 2:
        return mean, error
    chi2 = float((((np.asarray(values) - mean) / np.asarray(errors)) ** 2).sum())
    return mean, error * max(1.0, float(np.sqrt(chi2 / (len(values) - 1))))


def _inverse_variance(
    values: Sequence[float] | np.ndarray, errors: Sequence[float] | np.ndarray
) -> tuple[float, float]:
    weights = 1.0 / np.square(np.asarray(errors, float))
    return float(weights @ np.asarray(values, float) / weights.sum()), float(1.0 / np.sqrt(weights.sum()))


def _status(tension: float) -> str:
    if abs(tension) <= APART:
        return "ok"
    stiffer = "step records" if tension > 0 else "slow tests"
    return f"they disagree by {abs(tension):.1f} standard errors, {stiffer} stiffer: the combined k stands for neither"


def _told(table: pd.DataFrame, word: str) -> bool:
    return word in table and bool((table[word].notna() & (table[word].astype(str).str.strip() != "")).any())


def _by_words(table: pd.DataFrame, factor_table: list[str]) -> dict[tuple[object, ...], tuple[_Values, _Values]]:
    """Return k and its standard errors, kN/mm, by the words' values."""
    k, error = (pd.to_numeric(table[column], errors="coerce").to_numpy(float) for column in (K, K_SE))
    usable = np.isfinite(k) & np.isfinite(error) & (error > 0)
    keys = [_comparable(table[word], word) for word in factor_table]
    cases: dict[tuple[object, ...], list[int]] = {}
    for i in np.flatnonzero(usable):
        cases.setdefault(tuple(key[i] for key in keys), []).append(int(i))
    return {case: (k[rows], error[rows]) for case, rows in cases.items()}


def _comparable(column: pd.Series, word: str) -> list[float] | list[str]:
    """Return the cells as they compare between tables: numbers as floats, all else as text."""
    if word == "speed_km_h":
        return pd.to_numeric(column, errors="coerce").astype(float).to_list()
    return column.astype(str).str.strip().to_list()
