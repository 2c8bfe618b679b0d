"""Correlated noise: a moving average of known window, or autoregressive; whitening of residuals for both."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.linalg import solve_triangular

from bayes_tyre.errors import BadInput

#: Part of the variance that is independent, such as a converter's noise after the smoothing. It also keeps the
#: covariance of a long window, whose spectrum has zeros, from being singular.
INDEPENDENT_PART = 1e-6
#: Most points of a covariance: more would take gigabytes.
MOST_POINTS = 5000
#: Lag-1 autocorrelation of residuals above which signals look smoothed: a window of dozens of samples leaves 0.99, the
#: source's 801 samples 0.998.
SMOOTHED = 0.95


class Whitening(eqx.Module):
    """The inverse Cholesky factor of a noise's correlation: it maps the noise to independent values of variance 1.

    The factor of the first n points is its leading block, so that one factor serves records of any shorter length.

    Attributes
    ----------
    inverse:
        Shape (points, points), lower triangular.
    """

    inverse: Float[Array, "points points"]

    def whiten(self, values: Float[Array, " points"], present: Bool[Array, " points"]) -> Float[Array, " points"]:
        """Return the whitened values, zero on padding; padding follows the points, and is zero in `values`."""
        return jnp.where(present, self.inverse @ values, 0.0)

    def log_volume(self, points: Array) -> Float[Array, " records"]:
        """Return the log determinant of the map for the first `points` points of each record."""
        return jnp.cumsum(jnp.log(jnp.diagonal(self.inverse)))[points - 1]


def smoothed_noise(points: int, window: int) -> Whitening:
    """Return the whitening of a moving average of `window` samples of independent noise.

    The correlation of two points falls linearly with their distance, to zero at a window.

    Parameters
    ----------
    points:
        Number of points of the longest record, equally spaced in time.
    window:
        Samples averaged, at the rate of the points.

    Raises
    ------
    BadInput
        For more than `MOST_POINTS` points.
    """
    if points > MOST_POINTS:
        raise BadInput(
            f"noise smoothed over {window} samples: a record has {points} points, its covariance can be held for "
            f"{MOST_POINTS}; keep every n-th point of each record, and give the window in those"
        )
    lag = np.abs(np.subtract.outer(np.arange(points), np.arange(points)))
    correlation = np.maximum(0.0, 1.0 - lag / window)
    correlation[np.diag_indices(points)] += INDEPENDENT_PART
    factor = np.linalg.cholesky(correlation)
    return Whitening(jnp.asarray(solve_triangular(factor, np.eye(points), lower=True)))


def lag_1(residual: Float[Array, " points"], present: Bool[Array, " points"]) -> Float[Array, ""]:
    """Return the lag-1 autocorrelation of a record's residuals about their mean; padding follows the points."""
    mean = jnp.sum(jnp.where(present, residual, 0.0)) / jnp.sum(present)
    centred = jnp.where(present, residual - mean, 0.0)
    return jnp.sum(centred[1:] * centred[:-1]) / jnp.sum(centred**2)


def innovations(
    values: Float[Array, " points"], present: Bool[Array, " points"], rho: Float[Array, ""]
) -> Float[Array, " points"]:
    """Return the innovations of AR(1) noise with lag-1 autocorrelation rho, scaled to the variance of the noise."""
    innovation = (values[1:] - rho * values[:-1]) / jnp.sqrt(1.0 - rho**2)
    return jnp.where(present, jnp.concatenate([values[:1], innovation]), 0.0)


def whiten(
    residual: Float[np.ndarray, "records points"],
    present: Bool[np.ndarray, "records points"],
    rho: Float[np.ndarray, " records"] | None = None,
    window: int = 1,
) -> Float[np.ndarray, "records points"]:
    """Return whitened residuals: independent where the noise model holds.

    Parameters
    ----------
    residual, present:
        Zero and False on padding.
    rho:
        Lag-1 autocorrelation of each record's noise; None: 0.
    window:
        Window of the moving average of the noise, samples; 1: none.
    """
    if window > 1:
        factor = smoothed_noise(residual.shape[1], window)
        return np.asarray(jax.vmap(factor.whiten)(jnp.asarray(residual), jnp.asarray(present)))
    if rho is None:
        return residual
    return np.asarray(jax.vmap(innovations)(jnp.asarray(residual), jnp.asarray(present), jnp.asarray(rho)))
