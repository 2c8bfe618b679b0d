"""A curve driven back and forth, cut at its reversals into branches and closed cycles."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
from jaxtyping import Float

from bayes_tyre.record import DIRECTIONS

Values = Float[np.ndarray, " points"]

#: A reversal counts once the displacement has come back by this many standard deviations of its noise, or this many of
#: its smallest steps (the quantum of a converter), whichever is more; as a part of the travel, within these limits.
NOISE_SDS, QUANTA = 6.0, 3.0
LEAST_SHARE, LARGEST_SHARE = 0.05, 0.1
#: Two branches are a closed cycle where its end lies within this part of its travel from its start.
CLOSED = 0.4
#: Standard deviation of third differences over that of white noise; and over the median magnitude of a normal variable.
_THIRD_DIFFERENCE, _MEDIAN_TO_SD = np.sqrt(20.0), 1.4826


def reversal_threshold(displacement: Values) -> float:
    """Return by how much a displacement must come back for a reversal, in its unit.

    The noise is estimated from third differences, which a smooth path hardly has; their median leaves out reversals.
    """
    steps = np.abs(np.diff(displacement))
    third = np.abs(np.diff(displacement, n=3))
    noise = _MEDIAN_TO_SD * float(np.median(third)) / _THIRD_DIFFERENCE if len(third) else 0.0
    quantum = float(steps[steps > 0].min(initial=np.inf))
    threshold = max(NOISE_SDS * noise, QUANTA * quantum if np.isfinite(quantum) else 0.0)
    travel = float(np.ptp(displacement))
    return float(np.clip(threshold, LEAST_SHARE * travel, LARGEST_SHARE * travel))


def cut_at_reversals(displacement: Values, threshold: float) -> list[slice]:
    """Return the branches of a curve, in order; neighbours share the turning point.

    Parameters
    ----------
    displacement:
        In measured order, of any unit; shape (points,), at least one.
    threshold:
        A reversal counts once the displacement has come back by more than this, in the same unit (>= 0). The turning
        point is the farthest before that, the last where several are equally far.
    """
    ends = [0, *_turning_points(displacement.tolist(), threshold), len(displacement) - 1]
    return [slice(first, last + 1) for first, last in pairwise(ends)]


def _turning_points(d: list[float], threshold: float) -> list[int]:
    turns: list[int] = []
    low = high = 0  # farthest to either side, since the start or the last turning point
    way = 0
    for i, here in enumerate(d):
        low, high = (i if here <= d[low] else low), (i if here >= d[high] else high)
        if way <= 0 and here - d[low] > threshold:
            turns += [low] if way else []
            way, high = 1, i
        elif way >= 0 and d[high] - here > threshold:
            turns += [high] if way else []
            way, low = -1, i
    return turns


def closed_cycles(displacement: Values, branches: Sequence[slice]) -> list[int]:
    """Return the places of the first branches of closed cycles: that branch and the next.

    From the first branch on, two that end near where they began (`CLOSED`) are a cycle, and the search goes on behind
    them. So the way from the middle to the first reversal belongs to none, nor does a branch left at the end.
    """
    places, i = [], 0
    while i + 1 < len(branches):
        if is_closed(displacement[branches[i].start : branches[i + 1].stop]):
            places.append(i)
        i += 2 if places[-1:] == [i] else 1
    return places


def is_closed(path: Values) -> bool:
    """Return whether a path ends near where it begins, so that it counts as a closed cycle (`CLOSED`)."""
    return bool(abs(path[-1] - path[0]) <= CLOSED * np.ptp(path))


def direction_of(path: Values) -> str:
    """Return ``loading`` for a branch whose displacement grows or stays, ``unloading`` for one where it falls."""
    return DIRECTIONS[int(path[-1] < path[0])]


def cut_loops(table: pd.DataFrame) -> pd.DataFrame:
    """Return a checked record table of driven curves with each branch as a record.

    Returns
    -------
    The table with `record` (the given one and the number of the branch), `direction` by the sign of travel, and the
    columns `loop` (the given record), `branch` and `cycle` (numbers from 1; cycle 0: of no closed cycle). A turning
    point is the last point of one branch and the first of the next.
    """
    taken = {name: f"given_{name}" for name in ("loop", "branch", "cycle") if name in table}
    curves = table.rename(columns=taken).groupby("record", sort=False)
    return pd.concat([_branches_of(curve) for _, curve in curves], ignore_index=True)


def _branches_of(curve: pd.DataFrame) -> pd.DataFrame:
    d = curve["displacement_mm"].to_numpy(float)
    branches = cut_at_reversals(d, reversal_threshold(d))
    cycle = np.zeros(len(branches), int)
    for number, first in enumerate(closed_cycles(d, branches), start=1):
        cycle[first : first + 2] = number
    loop = str(curve["record"].iloc[0])
    return pd.concat(
        curve.iloc[rows].assign(
            record=f"{loop} {i + 1}", direction=direction_of(d[rows]), loop=loop, branch=i + 1, cycle=cycle[i]
        )
        for i, rows in enumerate(branches)
    )
