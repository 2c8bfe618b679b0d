"""What `next.csv` and `plan.csv` say, a line each for a terminal."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from bayes_tyre.record import CASE_FACTORS, Case

#: Candidates that get a line.
MOST_CANDIDATES = 5
#: What is expected of a goal, by the name of its columns: a width, or how probably a ranking is wrong.
MEASURES = {"width": "interval", "p_wrong": "wrong ranking"}
#: Probabilities below this rest on the far tail of a normal distribution, which some thousand draws do not show.
_LEAST = 1e-4


def candidate_lines(ranked: pd.DataFrame) -> list[str]:
    """Return the best candidates of `next.csv`: rank, tests, case, and the width of the interval before and after."""
    lines, measure = [], measure_of(ranked)
    for row in ranked.head(MOST_CANDIDATES).to_dict("records"):
        factors = (None if row[factor] != row[factor] else row[factor] for factor in CASE_FACTORS)
        case, several = Case._make(factors).label, "s" * (row["tests"] > 1)
        what = f"more repeat{several} of {case}" if row["kind"] == "repeat" else f"test{several} of the new case {case}"
        expected = f"{MEASURES[measure]} {shown(row[f'{measure}_now'], measure)} to {after(row, measure)}"
        lines.append(f"{row['rank']}  {row['tests']} {what}: {expected}")
    return lines


def plan_line(plan: pd.DataFrame, now: float) -> str:
    """Return what the tests of `plan.csv` are expected to reach, all run, from what is `now`."""
    if plan.empty:
        return "plan: no test"
    measure = measure_of(plan)
    return f"plan: {len(plan)} tests, {shown(now, measure)} to {after(plan.iloc[-1], measure)}"


def measure_of(table: pd.DataFrame) -> str:
    """Return what `next.csv` or `plan.csv` expects, as its columns are called: one of `MEASURES`."""
    return next(measure for measure in MEASURES if f"{measure}_expected" in table)


def after(row: Mapping[Any, Any] | pd.Series, measure: str) -> str:
    """Return what a row expects, and the minutes where they are known."""
    minutes = f", {row['minutes']:.0f} min" if row["minutes"] == row["minutes"] else ""
    return f"{shown(row[f'{measure}_expected'], measure)}{minutes}"


def shown(value: float, measure: str) -> str:
    """Return what is expected as percent; a probability that draws cannot tell from 0 as a bound."""
    return f"below {percent(_LEAST)}" if measure == "p_wrong" and value < _LEAST else percent(value)


def percent(share: float) -> str:
    """Return a share as percent, three digits of it."""
    return f"{100 * share:.3g} %"
