"""The kernel density of draws, with their equal-tailed interval."""

from typing import NamedTuple

import numpy as np
from arviz_stats.visualization import kde
from jaxtyping import Float

from bayes_tyre.results.equal_tailed import median_lower_upper


class Density(NamedTuple):
    """A density and an interval of draws.

    Attributes
    ----------
    at, height:
        Shape (points,): values, and the density there, per unit or per decade; both empty where all draws are equal.
    lower, median, upper:
        Ends and middle of the equal-tailed interval.
    """

    at: Float[np.ndarray, " points"]
    height: Float[np.ndarray, " points"]
    lower: float
    median: float
    upper: float


def density(values: Float[np.ndarray, " draws"], interval: float = 0.95, decades: bool = False) -> Density:
    """Return the density of draws, per decade where `decades` (all draws positive), by ArviZ's kernel estimate."""
    median, lower, upper = median_lower_upper(values, interval)
    if np.ptp(values) == 0:
        return Density(np.empty(0), np.empty(0), lower, median, upper)
    at, height, _ = kde(np.log10(values) if decades else values)
    return Density(10**at if decades else at, height, lower, median, upper)
