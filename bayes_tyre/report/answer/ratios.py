"""Ratios of a result as sentences need them: which is above which, how far, and how sure."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import pandas as pd

from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.answer.load import Reported
from bayes_tyre.results.contrasts import DIRECTIONS

SAME_CASE, SAME_SPAN, SAME_LOAD = "same case", "same span", "same initial load"
_BUT_CONFIGURATION = [factor for factor in CASE_FACTORS if factor != "configuration"]


@dataclass(frozen=True)
class Ratio:
    """A ratio of one parameter, `above` over `below`: median, equal-tailed interval, and P(ratio > 1)."""

    above: str
    below: str
    median: float
    lower: float
    upper: float
    interval: float
    p_greater_than_1: float

    @property
    def clear(self) -> bool:
        """Whether its interval leaves out 1, no difference."""
        return self.lower > 1.0 or self.upper < 1.0


def averages(result: Reported, parameter: str) -> pd.DataFrame:
    """Return the rows of `contrasts.csv` that average a parameter's ratio over all matched cases."""
    rows = result.contrasts[result.contrasts["parameter"] == parameter]
    free = (rows[list(CASE_FACTORS[:2])] == "").all(axis=1) & rows[list(CASE_FACTORS[2:])].isna().all(axis=1)
    return rows[free & rows[["median", "lower", "upper"]].gt(0.0).all(axis=1)]


def between_configurations(result: Reported, parameter: str) -> Iterator[Ratio]:
    """Yield the averaged ratio of each two configurations that have cases in common."""
    rows = averages(result, parameter)
    rows = rows[rows["matching"] == SAME_CASE].set_index("contrast")
    for pair in combinations(result.configurations, 2):
        for above, below in (pair, pair[::-1]):
            if (name := f"{above} / {below}") in rows.index:
                yield ratio_of(above, below, rows.loc[[name]].iloc[0])
                break


def between_directions(result: Reported, parameter: str) -> dict[str, Ratio]:
    """Return the averaged ratio of loading over unloading by how cases were matched."""
    rows = averages(result, parameter)
    rows = rows[(rows["contrast"] == DIRECTIONS) & rows["matching"].isin([SAME_SPAN, SAME_LOAD])]
    above, below = DIRECTIONS.split(" / ")
    return {str(row["matching"]): ratio_of(above, below, row) for _, row in rows.iterrows()}


def ratio_of(above: str, below: str, row: pd.Series) -> Ratio:
    """Return a row of `contrasts.csv` as a ratio."""
    return Ratio(
        above, below, *(float(row[name]) for name in ("median", "lower", "upper", "interval", "p_greater_than_1"))
    )


#: What a reader should know of means over cases that differ.
UNLIKE_CASES = "The configurations were not tested in the same cases: compare them by their ratio, not by these means."


def unlike_cases(result: Reported) -> bool:
    """Return whether the means over cases of the configurations are over different cases."""
    tested = [
        {*cases[_BUT_CONFIGURATION].astype(str).itertuples(index=False, name=None)}
        for _, cases in result.cases.groupby("configuration")
    ]
    return any(cases != tested[0] for cases in tested)


def matched_cases(result: Reported, one: str, other: str) -> int:
    """Return how many cases two configurations have in common."""
    cases = result.cases.drop_duplicates(["configuration", *_BUT_CONFIGURATION])
    mine, theirs = (cases.loc[cases["configuration"] == name, _BUT_CONFIGURATION].astype(str) for name in (one, other))
    return len(mine.merge(theirs))
