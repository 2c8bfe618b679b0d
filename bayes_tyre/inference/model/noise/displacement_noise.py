"""Noise of the displacement that nobody stated, found by what it does to the forces where a record is steep.

Near its start a curve turns noise of the displacement into noise of the force, by its slope. Where the residuals
follow that slope, and better than any other noise that is larger near the start, the displacement is taken to have it.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import UnequalNoise
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.noise.displacement_errors import DisplacementErrors, displacement_errors
from bayes_tyre.inference.model.noise.uneven_noise import residuals_and_tangents, uneven_noise
from bayes_tyre.inference.noise_along_path import freedom, log_likelihood
from bayes_tyre.inference.record_data import force_curve, record_data

#: Standard deviations tried, in medians of beta.
_TRIED = np.geomspace(0.01, 3.0, 40)
#: Gain of the log likelihood over even noise below which records show nothing of the kind: 400 times as likely.
_LEAST_GAIN = 6.0
#: Residuals below this part of the change of force are rounding.
_EXACT = 1e-6
#: Estimates, each on the curves of the one before.
_ROUNDS = 3


class _Fit(NamedTuple):
    """Records fitted with some weights.

    Attributes
    ----------
    square, freedom:
        Shape (records, points): measured less curve squared, kN^2, at least what is rounding; and the degrees of
        freedom that the fit leaves of each point.
    steep:
        Shape (records, points), (kN/mm)^2: by how much the square of the curve's slope exceeds that of its line.
    beta_mm, log_likelihood:
        Median of the estimates; and that of all residuals, but for a constant.
    """

    square: Float[np.ndarray, "records points"]
    freedom: Float[np.ndarray, "records points"]
    steep: Float[np.ndarray, "records points"]
    beta_mm: float
    log_likelihood: float


def displacement_noise_mm(batch: Batch, of_record: Int[np.ndarray, " records"], law: str) -> float:
    """Return the standard deviation (mm) of the noise of the displacement that the records show; 0 where they do not.

    Parameters
    ----------
    batch:
        The records.
    of_record:
        The case of each, by number.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    """
    fit = even = _fitted(batch, UnequalNoise(jnp.ones(batch.present.shape)), law)
    sd_mm, likelihood = _most_likely(even)
    # Before curves are corrected for it: most records show nothing of the kind, and are done here.
    if likelihood < even.log_likelihood + _LEAST_GAIN:
        return 0.0
    for _ in range(_ROUNDS):
        sd_mm, _ = _most_likely(fit)
        errors = DisplacementErrors.alike(batch, np.full(len(batch.records), sd_mm))
        corrected, whitening = displacement_errors(batch, of_record, errors, law)
        assert isinstance(whitening.others, UnequalNoise)
        fit = _fitted(corrected, whitening.others, law)
    near_start, _ = uneven_noise(batch, of_record, None, law)
    assert isinstance(near_start, UnequalNoise)
    others = max(even.log_likelihood + _LEAST_GAIN, _fitted(batch, near_start, law).log_likelihood)
    return sd_mm if fit.log_likelihood > others else 0.0


def _fitted(batch: Batch, weights: UnequalNoise, law: str) -> _Fit:
    """Return records fitted with weights."""
    estimates = estimate_records(batch, whitening=weights, law=law)
    residual, tangents = residuals_and_tangents(batch, estimates, law)
    weight = np.asarray(weights.weight)
    left = freedom(weight[:, :, None] * tangents, batch.present)
    steep = np.asarray(_slopes(record_data(batch).u, estimates.centre, law)) ** 2
    steep = np.maximum(steep - np.exp(2.0 * np.asarray(estimates.log_k))[:, None], 0.0)
    steep[:, 0] = 0.0  # where a record starts by definition
    beta_mm = float(np.exp(np.median(np.asarray(estimates.log_beta))))
    square = residual**2 + (_EXACT * np.asarray(record_data(batch).span)[:, None]) ** 2
    return _Fit(square, left, steep, beta_mm, log_likelihood(square, weight**-2.0, left))


def _most_likely(fit: _Fit) -> tuple[float, float]:
    """Return the standard deviation (mm) that the residuals make most likely, and their log likelihood then."""
    # Away from the start such noise is part of sigma.
    counts = np.sum(fit.freedom, axis=1)
    whole = np.median(np.sum(np.where(fit.freedom > 0, fit.square, 0.0), axis=1) / counts)
    tried = fit.beta_mm * _TRIED
    log_likelihoods = [log_likelihood(fit.square, 1.0 + sd**2 * fit.steep / whole, fit.freedom) for sd in tried]
    best = int(np.argmax(log_likelihoods))
    # The variance was that of all points: what is left of it without that noise is its unit.
    variance = whole + tried[best] ** 2 * fit.steep
    left = np.sum(np.where(fit.freedom > 0, fit.square / variance, 0.0), axis=1) / counts
    return float(tried[best] * np.sqrt(np.median(left))), log_likelihoods[best]


@partial(jax.jit, static_argnames="law")
def _slopes(
    u: Float[jax.Array, "records points"], theta: Float[jax.Array, "records 4"], law: str
) -> Float[jax.Array, "records points"]:
    """Return the slope (kN/mm) of each record's curve at its points."""

    def slope(u: Float[jax.Array, " points"], theta: Float[jax.Array, "4"]) -> Float[jax.Array, " points"]:
        # A displacement just beyond the start: the law has no slope at it.
        beyond = jnp.where(u == 0, 1e-9 * jnp.sign(jnp.sum(u)), u)
        return jax.jvp(lambda u: force_curve(u, theta, law), (beyond,), (jnp.ones_like(u),))[1]

    return jax.vmap(slope)(u, theta)
