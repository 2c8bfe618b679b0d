"""The source's rule for odd repeats beside the posterior: what each makes of k of a case.

The rule leaves a repeat out of its case's mean, and gives no number for when
(`bayes_tyre.published.campaign.left_out`).
"""

from collections.abc import Hashable, Sequence

import numpy as np
import pandas as pd
from scipy.stats import t

from bayes_tyre.published.campaign import left_out, repeat_sd
from bayes_tyre.record import CASE_FACTORS

PLAIN, RULE, POSTERIOR = "mean of all", "mean by the rule", "posterior"


def by_multiple(fits: pd.DataFrame, discordant: pd.Series, multiples: Sequence[float | int]) -> pd.DataFrame:
    """Return how many repeats the rule leaves out, by the multiple of the usual scatter that it is given.

    Parameters
    ----------
    fits:
        As `least_squares.csv`: the words and `k_kN_per_mm`, a row a record.
    discordant:
        Whether each record was made discordant, indexed by `record`.
    multiples:
        The rule leaves a repeat out beyond so many times the usual scatter.

    Returns
    -------
    pandas.DataFrame
        `multiple`, `left_out`, `discordant` (of those left out), `good` (of those left out), `kept_discordant`.
    """
    rows = []
    for multiple in multiples:
        out = pd.concat([_out(case, multiple) for _, case in fits.groupby(list(CASE_FACTORS), sort=False)])
        odd = discordant.reindex(out.index).to_numpy(dtype=bool)
        caught = int((out & odd).sum())
        good, missed = int(out.sum()) - caught, int(odd.sum()) - caught
        rows.append({"multiple": multiple, "left_out": int(out.sum()), "discordant": caught, "good": good})
        rows[-1]["kept_discordant"] = missed
    return pd.DataFrame(rows)


def _out(case: pd.DataFrame, multiple: float | int) -> pd.Series:
    scatter = repeat_sd(float(case["speed_km_h"].iloc[0]))
    return pd.Series(left_out(case["k_kN_per_mm"].to_numpy(), scatter, float(multiple)), index=case["record"])


def k_by_method(fits: pd.DataFrame, cases: pd.DataFrame, multiple: float | int) -> pd.DataFrame:
    """Return k (kN/mm) of each case by three methods, with 95 % intervals.

    Parameters
    ----------
    fits:
        As `least_squares.csv`, a row a record.
    cases:
        As `cases.csv` of a posterior of the same records, or of some of them, with intervals of 0.95.
    multiple:
        Of the usual scatter, beyond which the rule leaves a repeat out.

    Returns
    -------
    pandas.DataFrame
        The case words, `method`, `k_kN_per_mm`, `lower`, `upper`, `left_out` (the record the rule leaves out, or "").
        The means have Student's interval from the repeats they keep.
    """
    of_k = cases[cases["parameter"] == "k"].to_dict("records")
    posterior = {tuple(row[word] for word in CASE_FACTORS): row for row in of_k}
    rows: list[dict[Hashable, object]] = []
    for factor_table, case in fits.groupby(list(CASE_FACTORS), sort=False):
        out = _out(case, multiple)
        k, odd = case["k_kN_per_mm"].to_numpy(), ", ".join(out.index[out])
        estimates = {PLAIN: student(k), RULE: student(k[~out.to_numpy()]), POSTERIOR: posterior[tuple(factor_table)]}
        for method, found in estimates.items():
            row: dict[Hashable, object] = dict(zip(CASE_FACTORS, factor_table, strict=True))
            row |= {"method": method, "k_kN_per_mm": found["median"], "lower": found["lower"]}
            rows.append(row | {"upper": found["upper"], "left_out": odd})
    return pd.DataFrame(rows)


def student(values: np.ndarray) -> pd.Series:
    """Return the mean of values as `median`, with Student's 95 % interval from their own scatter: `lower`, `upper`."""
    mean, count = float(values.mean()), len(values)
    half = float(t.ppf(0.975, count - 1) * values.std(ddof=1) / np.sqrt(count))
    return pd.Series({"median": mean, "lower": mean - half, "upper": mean + half})
