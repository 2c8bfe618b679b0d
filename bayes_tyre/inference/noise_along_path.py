"""Whether the noise of records is as large near their start, where beta shows, as on the rest of the way."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

#: Points within so many beta of the start are near it: the curve bends there.
NEAR_BETAS = 3.0
#: Fewest degrees of freedom that a variance is estimated from.
_LEAST_FREEDOM = 8.0


class LogRatio(NamedTuple):
    """Logarithm of the variance near the start over that elsewhere.

    Attributes
    ----------
    value, error:
        The logarithm, and its standard error for independent noise; 0 and infinity where a part has too few points or
        no noise.
    gain:
        By how much the log likelihood of two variances is above that of one.
    """

    value: float
    error: float
    gain: float


def near_start(
    u: Float[np.ndarray, "records points"],
    reach_mm: Float[np.ndarray, " records"],
    present: Bool[np.ndarray, "records points"],
) -> Bool[np.ndarray, "records points"]:
    """Return which points lie within `reach_mm` of the start of their record; u in mm."""
    return present & (np.abs(u) < reach_mm[:, None])


def variance_ratio(
    square: Float[np.ndarray, "records points"],
    freedom: Float[np.ndarray, "records points"],
    near: Bool[np.ndarray, "records points"],
) -> LogRatio:
    """Return how much larger the variance of residuals is near the start than elsewhere, over all records.

    Parameters
    ----------
    square:
        Squares of the residuals over the variance of their record.
    freedom:
        Degrees of freedom that are left of each point, as the function `freedom` gives them.
    near:
        Which points lie near the start.
    """
    parts = near, ~near
    counts = np.array([freedom[part].sum() for part in parts])
    if counts.min() < _LEAST_FREEDOM:
        return LogRatio(0.0, np.inf, 0.0)
    sums = np.array([square[part].sum() for part in parts])
    if not sums.all():
        return LogRatio(0.0, np.inf, 0.0)
    log_variances, log_variance = np.log(sums / counts), np.log(sums.sum() / counts.sum())
    gain = 0.5 * float(counts @ (log_variance - log_variances))
    return LogRatio(float(log_variances[0] - log_variances[1]), float(np.sqrt(np.sum(2.0 / counts))), gain)


def freedom(
    tangents: Float[np.ndarray, "records points parameters"], present: Bool[np.ndarray, "records points"]
) -> Float[np.ndarray, "records points"]:
    """Return the degrees of freedom that a fit leaves of each point: what its parameters take up of noise is none.

    Parameters
    ----------
    tangents:
        Derivatives of each curve with respect to its parameters, weighted as the fit weighs the points.
    present:
        Which points are no padding, of which nothing is left.
    """
    return np.where(present, 1.0 - np.sum(directions(tangents) ** 2, axis=2), 0.0)


def log_likelihood(
    square: Float[np.ndarray, "records points"],
    variance: Float[np.ndarray, "records points"],
    freedom: Float[np.ndarray, "records points"],
) -> float:
    """Return the log likelihood of squared residuals of these variances but for a factor of each record, the likeliest.

    But for a constant; a point counts by the degrees of freedom that are left of it (restricted maximum likelihood).
    """
    count = freedom.sum(axis=1)
    squares = np.sum(np.where(freedom > 0, square / variance, 0.0), axis=1)
    return float(-0.5 * np.sum(count * np.log(squares / count) + np.sum(freedom * np.log(variance), axis=1)))


def directions(columns: Float[np.ndarray, "records points columns"]) -> Float[np.ndarray, "records points columns"]:
    """Return an orthonormal column for each column of each record, in order; each points the way its own one does."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    factor, upper = np.linalg.qr(columns / np.where(size > 0, size, 1.0))
    return factor * np.where(np.diagonal(upper, axis1=1, axis2=2) < 0, -1.0, 1.0)[:, None, :]
