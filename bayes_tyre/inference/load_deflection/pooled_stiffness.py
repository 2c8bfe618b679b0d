"""One stiffness from slow tests and step records of the same tyre, and the difference between the two."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from jaxtyping import Float

K, K_SE = "k_kN_per_mm", "k_kN_per_mm_se"
#: The factors that identify a tyre and its state in both tables.
SHARED = ("configuration", "speed_km_h")
#: The two disagree beyond this many standard errors: 5 % of pairs do by chance.
DISAGREE = 1.959964
type _Values = Float[np.ndarray, " n"]
COLUMNS = (
    *(f"{K}_{part}{suffix}" for part in ("tests", "steps", "combined") for suffix in ("", "_se")),
    *("tests", "steps", "tension", "status"),
)


def shared_stiffness(tests: pd.DataFrame, steps: pd.DataFrame) -> pd.DataFrame:
    """Return the stiffness that slow tests and step records of the same tyre share, a row a configuration and speed.

    The mean of the two values, weighted by inverse variances. The value of each side is the weighted mean of its
    estimates; where these vary more than their standard errors allow, its error is multiplied by
    sqrt(chi^2 / (n - 1)), never below 1, so that the variation between repeats counts. `tension` is the difference,
    steps less tests, over its standard error: rate, speed of loading and processing may all cause one, and where it is
    large the combined value is valid for neither. Errors that all estimates of a side share, such as a sensor's scale,
    are not in the standard errors.

    Parameters
    ----------
    tests:
        Rows of `load_deflection.csv`: `k_kN_per_mm` with its standard error (kN/mm), the factors where known.
    steps:
        Rows of `least_squares.csv`, or any table with the same columns, as on flat ground. Its directions are pooled,
        because the law has one k.

    Returns
    -------
    pandas.DataFrame
        The factors that both tables have; `k_kN_per_mm_tests`, `k_kN_per_mm_steps`, `k_kN_per_mm_combined`, each with
        `_se` (kN/mm); `tests` and `steps`, how many estimates; `tension` (standard errors); `status`. Only where both
        sides have one; rows without a value above 0 or a standard error are left out.
    """
    factors = [name for name in SHARED if _has_values(tests, name) and _has_values(steps, name)]
    sides = {"tests": _by_factors(tests, factors), "steps": _by_factors(steps, factors)}
    rows = []
    for case in sides["tests"]:
        if case not in sides["steps"]:
            continue
        row: dict[str, object] = dict(zip(factors, case, strict=True))
        (k_tests, se_tests), (k_steps, se_steps) = (weighted_mean(*sides[side][case]) for side in sides)
        combined = _inverse_variance([k_tests, k_steps], [se_tests, se_steps])
        tension = (k_steps - k_tests) / float(np.hypot(se_tests, se_steps))
        numbers = (k_tests, se_tests, k_steps, se_steps, *combined)
        counts = (len(sides["tests"][case][0]), len(sides["steps"][case][0]))
        rows.append(row | dict(zip(COLUMNS, (*numbers, *counts, tension, _status(tension)), strict=True)))
    return pd.DataFrame(rows, columns=[*factors, *COLUMNS])


def weighted_mean(values: Sequence[float] | np.ndarray, errors: Sequence[float] | np.ndarray) -> tuple[float, float]:
    """Return the mean weighted by inverse variances and its standard error, enlarged where the values vary more.

    Source of the factor: the scale factor of the Particle Data Group (after Birge, 1932).

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
    if abs(tension) <= DISAGREE:
        return "ok"
    stiffer = "step records" if tension > 0 else "slow tests"
    return (
        f"they disagree by {abs(tension):.1f} standard errors, {stiffer} stiffer: the combined k is valid for neither"
    )


def _has_values(table: pd.DataFrame, name: str) -> bool:
    return name in table and bool((table[name].notna() & (table[name].astype(str).str.strip() != "")).any())


def _by_factors(table: pd.DataFrame, factors: list[str]) -> dict[tuple[object, ...], tuple[_Values, _Values]]:
    """Return k and its standard errors, kN/mm, by the factors' levels."""
    k, error = (pd.to_numeric(table[column], errors="coerce").to_numpy(float) for column in (K, K_SE))
    usable = np.isfinite(k) & (k > 0) & np.isfinite(error) & (error > 0)
    keys = [_comparable(table[name], name) for name in factors]
    cases: dict[tuple[object, ...], list[int]] = {}
    for i in np.flatnonzero(usable):
        cases.setdefault(tuple(key[i] for key in keys), []).append(int(i))
    return {case: (k[rows], error[rows]) for case, rows in cases.items()}


def _comparable(column: pd.Series, name: str) -> list[float] | list[str]:
    """Return values that are comparable between tables: numbers as floats, all else as text."""
    if name == "speed_km_h":
        return pd.to_numeric(column, errors="coerce").astype(float).to_list()
    return column.astype(str).str.strip().to_list()
