"""What `next.csv` and `plan.csv` say, a line each for a terminal."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from bayes_tyre.record import CASE_FACTORS, Case

#: Candidates that get a line.
MOST_CANDIDATES = 5


def candidate_lines(ranked: pd.DataFrame) -> list[str]:
    """Return the best candidates of `next.csv`: rank, tests, case, and the width of the interval before and after."""
    lines = []
    for row in ranked.head(MOST_CANDIDATES).to_dict("records"):
        factors = (None if row[factor] != row[factor] else row[factor] for factor in CASE_FACTORS)
        case, several = Case._make(factors).label, "s" * (row["tests"] > 1)
        what = f"more repeat{several} of {case}" if row["kind"] == "repeat" else f"test{several} of the new case {case}"
        lines.append(f"{row['rank']}  {row['tests']} {what}: interval {percent(row['width_now'])} to {after(row)}")
    return lines


def plan_line(plan: pd.DataFrame) -> str:
    """Return what the tests of `plan.csv` are expected to reach, all run."""
    if plan.empty:
        return "plan: no test"
    last = plan.iloc[-1]
    return f"plan: {len(plan)} tests, {percent(last['width_now'])} to {after(last)}"


def after(row: Mapping[Any, Any] | pd.Series) -> str:
    """Return the expected width of a row, and the minutes where they are known."""
    minutes = f", {row['minutes']:.0f} min" if row["minutes"] == row["minutes"] else ""
    return f"{percent(row['width_expected'])}{minutes}"


def percent(share: float) -> str:
    """Return a share as percent, three digits of it."""
    return f"{100 * share:.3g} %"
