"""The kernel density of draws, with their equal-tailed interval."""

from typing import NamedTuple

import numpy as np
from arviz_stats.visualization import kde
from jaxtyping import Float


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
    quantiles = np.quantile(values, [(1 - interval) / 2, 0.5, (1 + interval) / 2])
    if np.ptp(values) == 0:
        return Density(np.empty(0), np.empty(0), *quantiles)
    at, height, _ = kde(np.log10(values) if decades else values)
    return Density(10**at if decades else at, height, *quantiles)
