"""Means of three repeats, of all or without a discordant one, by two versions of the source's rule.

The source left out of a case's mean a repeat that was "significantly different from the other two", without a number.
`RULES` has two versions of it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import t


class MeanEstimates(NamedTuple):
    """An estimate of each case and its 95 % interval, shape (..., cases)."""

    value: Float[np.ndarray, "*shape"]
    lower: Float[np.ndarray, "*shape"]
    upper: Float[np.ndarray, "*shape"]


#: A repeat is left out if its distance from the mean of the other two exceeds this many times their difference ...
TIMES_THEIR_DIFFERENCE = 3.0
#: ... and this share of that mean: k (kN/mm) and beta (mm); two repeats may agree closely by chance.
LEAST_SHARE = {"k": 0.10, "beta": 0.25}
#: The other version takes no account of the difference of the other two, and has a wider margin.
PLAIN_SHARE = {"k": 0.20, "beta": 0.50}


def _differs(repeats: Float[np.ndarray, "*cases 3"], parameter: str) -> Bool[np.ndarray, "*cases 3"]:
    others = np.stack([repeats[..., [1, 2]], repeats[..., [0, 2]], repeats[..., [0, 1]]], axis=-2)
    mean = others.mean(axis=-1)
    apart = np.abs(repeats - mean)
    near_pair = apart > TIMES_THEIR_DIFFERENCE * np.abs(others[..., 0] - others[..., 1])
    return near_pair & (apart > LEAST_SHARE[parameter] * mean)


def _far_off(repeats: Float[np.ndarray, "*cases 3"], parameter: str) -> Bool[np.ndarray, "*cases 3"]:
    others = (repeats.sum(axis=-1, keepdims=True) - repeats) / 2.0
    return np.abs(repeats - others) > PLAIN_SHARE[parameter] * others


#: By name: which repeats of k or beta to leave out.
RULES: dict[str, Callable[[np.ndarray, str], np.ndarray]] = {
    "mean of three": lambda repeats, _: np.zeros(repeats.shape, dtype=bool),
    "rule: 3 x the others' difference": _differs,
    "rule: far from the others' mean": _far_off,
}


def mean_of_repeats(repeats: Float[np.ndarray, "*cases 3"], parameter: str, rule: str) -> MeanEstimates:
    """Return the mean of the repeats that a rule keeps, with Student's t interval.

    At most one repeat of a case is left out: of several that a rule would leave out, the one farthest from the median.

    Parameters
    ----------
    repeats:
        Least-squares estimates of `k` (kN/mm) or `beta` (mm), three a case.
    parameter, rule:
        The parameter, and a name in `RULES`.
    """
    centre = np.median(repeats, axis=-1, keepdims=True)
    farthest = np.argmax(np.abs(repeats - centre), axis=-1)[..., None] == np.arange(3)
    mask = ~(RULES[rule](repeats, parameter) & farthest)
    count = mask.sum(axis=-1)
    mean = np.where(mask, repeats, 0.0).sum(axis=-1) / count
    variance = np.where(mask, (repeats - mean[..., None]) ** 2, 0.0).sum(axis=-1) / (count - 1)
    half = t.ppf(0.975, count - 1) * np.sqrt(variance / count)
    return MeanEstimates(mean, mean - half, mean + half)
