"""Noise that is not independent and alike: of a moving average, autoregressive, unequal, or with an error shared."""

from abc import abstractmethod
from typing import ClassVar, override

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
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
    """The contract: a linear map of the points of a record after which the noise is independent, all of one variance.

    Attributes
    ----------
    axis:
        The axis of its fields that counts records, to `jax.vmap` over; None where one map serves all.
    """

    axis: ClassVar[int | None] = None

    @abstractmethod
    def whiten(self, values: Float[Array, " points"], present: Bool[Array, " points"]) -> Float[Array, " points"]:
        """Return the whitened values of one record, zero on padding; padding follows the points, zero in `values`."""

    @abstractmethod
    def log_volume(self, points: Array) -> Float[Array, " records"]:
        """Return the log determinant of the map for the first `points` points of each record."""


class SmoothedNoise(Whitening):
    """The inverse Cholesky factor of the correlation of noise that was smoothed.

    The factor of the first n points is its leading block, so that one factor serves records of any shorter length.

    Attributes
    ----------
    inverse:
        Shape (points, points), lower triangular.
    """

    inverse: Float[Array, "points points"]

    @override
    def whiten(self, values: Float[Array, " points"], present: Bool[Array, " points"]) -> Float[Array, " points"]:
        """Return the whitened values of one record, zero on padding."""
        return jnp.where(present, self.inverse @ values, 0.0)

    @override
    def log_volume(self, points: Array) -> Float[Array, " records"]:
        """Return the log determinant of the map for the first `points` points of each record."""
        return jnp.cumsum(jnp.log(jnp.diagonal(self.inverse)))[points - 1]


class UnequalNoise(Whitening):
    """Weights of points whose noise is independent, but not alike.

    Attributes
    ----------
    weight:
        Shape (records, points): the standard deviation that the others have, over that of each point; 1 on padding.
    """

    weight: Float[Array, "*records points"]
    axis: ClassVar[int | None] = 0

    @override
    def whiten(self, values: Float[Array, " points"], present: Bool[Array, " points"]) -> Float[Array, " points"]:
        """Return the whitened values of one record, zero on padding."""
        return jnp.where(present, self.weight * values, 0.0)

    @override
    def log_volume(self, points: Array) -> Float[Array, " records"]:
        """Return the log determinant of the map of each record."""
        return jnp.sum(jnp.log(self.weight), axis=1)


class SharedError(Whitening):
    """An error that all points of a record share, beside noise that another map makes independent.

    Attributes
    ----------
    others:
        The map for the noise without the error, a record a row.
    error:
        Shape (records, points): what one standard deviation of it does to the points, in those of the noise.
    direction:
        Shape (records, points): unit vector along which the error moves what `others` returns; 0 where there is none.
    shrink:
        Shape (records,): by what part that is shortened along it.
    """

    others: Whitening
    error: Float[Array, "*records points"]
    direction: Float[Array, "*records points"]
    shrink: Float[Array, "*records"]
    axis: ClassVar[int | None] = 0

    @override
    def whiten(self, values: Float[Array, " points"], present: Bool[Array, " points"]) -> Float[Array, " points"]:
        """Return the whitened values of one record, zero on padding."""
        values = self.others.whiten(values, present)
        return values - self.shrink * (self.direction @ values) * self.direction

    @override
    def log_volume(self, points: Array) -> Float[Array, " records"]:
        """Return the log determinant of the map of each record."""
        return self.others.log_volume(points) + jnp.log1p(-self.shrink)


@jax.jit
def shared_error(
    others: Whitening, error: Float[Array, "records points"], present: Bool[Array, "records points"]
) -> SharedError:
    """Return the whitening of noise with a further error that the points of each record share.

    Its covariance is that of the noise and ``error error^T``: the root of ``I + a a^T``, a = the whitened error, is
    the identity but along a.

    Parameters
    ----------
    others:
        Of the noise alone, a record a row.
    error:
        What one standard deviation of the error does to the points, in standard deviations of the noise.
    present:
        False on padding.
    """
    moved = whiten_records(others, error, present)
    square = jnp.sum(moved**2, axis=1)
    direction = moved / jnp.sqrt(jnp.where(square > 0, square, 1.0))[:, None]
    return SharedError(others, error, direction, 1.0 - 1.0 / jnp.sqrt(1.0 + square))


def reweighted(
    whitening: Whitening, weight: Float[Array, "records points"], present: Bool[Array, "records points"]
) -> Whitening:
    """Return the whitening of noise that is unlike from point to point by a further factor; errors shared are not.

    Parameters
    ----------
    whitening:
        `UnequalNoise`, or `SharedError` beside it.
    weight:
        Over what the noise of each point is divided by, as `UnequalNoise.weight`.
    present:
        False on padding.
    """
    if isinstance(whitening, SharedError):
        return shared_error(reweighted(whitening.others, weight, present), whitening.error, present)
    if isinstance(whitening, UnequalNoise):
        return UnequalNoise(whitening.weight * weight)
    raise TypeError(f"{type(whitening).__name__} says all of the noise")


def whitening_of(whitening: Whitening, records: Bool[np.ndarray, " records"] | Int[np.ndarray, " chosen"]) -> Whitening:
    """Return the whitening of some of the records, by a mask or by their numbers, as it is of all."""
    return whitening if whitening.axis is None else jax.tree.map(lambda field: field[records], whitening)


def smoothed_noise(points: int, window: int) -> SmoothedNoise:
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
    return SmoothedNoise(jnp.asarray(solve_triangular(factor, np.eye(points), lower=True)))


def lag_1(residual: Float[Array, " points"], present: Bool[Array, " points"]) -> Float[Array, ""]:
    """Return the lag-1 autocorrelation of a record's residuals about their mean; padding follows the points."""
    mean = jnp.sum(jnp.where(present, residual, 0.0)) / jnp.sum(present)
    centred = jnp.where(present, residual - mean, 0.0)
    return jnp.sum(centred[1:] * centred[:-1]) / jnp.sum(centred**2)


@jax.jit
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
    whitening: Whitening | None = None,
) -> Float[np.ndarray, "records points"]:
    """Return whitened residuals: independent where the noise model holds.

    Parameters
    ----------
    residual, present:
        Zero and False on padding.
    rho:
        Lag-1 autocorrelation of each record's noise; None: 0.
    whitening:
        Of all records, before rho; None: the noise needs none.
    """
    if whitening is not None:
        residual = np.asarray(whiten_records(whitening, jnp.asarray(residual), jnp.asarray(present)))
    if rho is None:
        return residual
    return np.asarray(jax.vmap(innovations)(jnp.asarray(residual), jnp.asarray(present), jnp.asarray(rho)))


@jax.jit
def whiten_records(
    whitening: Whitening, values: Float[Array, "records points"], present: Bool[Array, "records points"]
) -> Float[Array, "records points"]:
    """Return the values of all records whitened; zero and False on padding."""
    return jax.vmap(type(whitening).whiten, in_axes=(whitening.axis, 0, 0))(whitening, values, present)
