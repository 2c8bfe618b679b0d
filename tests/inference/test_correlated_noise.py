"""Noise that is not independent: whitened by its covariance, and told by its lag-1 autocorrelation."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.linalg import toeplitz

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import (
    INDEPENDENT_PART,
    MOST_POINTS,
    UnequalNoise,
    innovations,
    lag_1,
    reweighted,
    shared_error,
    smoothed_noise,
    whiten,
)

POINTS = 60


def normal_density(residual: np.ndarray, covariance: np.ndarray) -> float:
    """Return the log density of a normal number of mean zero."""
    _, log_determinant = np.linalg.slogdet(2.0 * np.pi * covariance)
    return -0.5 * float(residual @ np.linalg.solve(covariance, residual) + log_determinant)


def moving_average_covariance(window: int, points: int) -> np.ndarray:
    """Return the covariance of a moving average of white noise, from the average itself, scaled to variance 1."""
    average = np.array([np.convolve(row, np.ones(window), "valid") for row in np.eye(points + window - 1)]).T
    return average @ average.T / window


@pytest.mark.parametrize("window", [2, 7, 50])
@pytest.mark.parametrize("kept", [20, POINTS])
def test_smoothed_noise_has_the_density_of_its_covariance(window, kept):
    residual = np.random.default_rng(window).standard_normal(POINTS)
    present = np.arange(POINTS) < kept
    whitening = smoothed_noise(POINTS, window)
    white = np.asarray(whitening.whiten(jnp.asarray(np.where(present, residual, 0.0)), jnp.asarray(present)))
    ours = stats.norm.logpdf(white[:kept]).sum() + float(whitening.log_volume(jnp.array([kept]))[0])
    covariance = moving_average_covariance(window, kept) + INDEPENDENT_PART * np.eye(kept)
    theirs = normal_density(residual[:kept], covariance)
    # The covariance is all but singular: its smallest eigenvalues lose digits.
    assert ours == pytest.approx(theirs, rel=1e-6)
    assert not white[kept:].any()


@pytest.mark.parametrize("rho", [-0.5, 0.0, 0.9])
def test_innovations_have_the_density_of_autoregressive_noise(rho):
    residual = np.random.default_rng(1).standard_normal(POINTS)
    new = np.asarray(innovations(jnp.asarray(residual), jnp.ones(POINTS, bool), jnp.asarray(rho)))
    ours = stats.norm.logpdf(new).sum() - 0.5 * (POINTS - 1) * np.log(1.0 - rho**2)
    theirs = normal_density(residual, toeplitz(rho ** np.arange(POINTS)))
    assert ours == pytest.approx(theirs, rel=1e-10)


def test_errors_that_points_share_have_the_density_of_their_covariance():
    """Two errors one after the other, on noise of unequal size; the second record has neither, and fewer points."""
    rng = np.random.default_rng(3)
    residual, errors = rng.standard_normal((2, POINTS)), rng.standard_normal((2, 2, POINTS))
    errors[:, 1] = 0.0
    weight, present = rng.uniform(0.3, 1.0, (2, POINTS)), np.arange(POINTS) < np.array([[POINTS], [20]])
    residual, weight = np.where(present, residual, 0.0), np.where(present, weight, 1.0)
    whitening = UnequalNoise(jnp.asarray(weight))
    for error in errors:
        whitening = shared_error(whitening, jnp.asarray(error), jnp.asarray(present))
    white = whiten(residual, present, whitening=whitening)
    volumes = np.asarray(whitening.log_volume(jnp.asarray(present.sum(axis=1))))
    for i, kept in enumerate((POINTS, 20)):
        covariance = np.diag(weight[i, :kept] ** -2) + sum(np.outer(e[i, :kept], e[i, :kept]) for e in errors)
        ours = stats.norm.logpdf(white[i, :kept]).sum() + volumes[i]
        assert ours == pytest.approx(normal_density(residual[i, :kept], covariance), rel=1e-10)
        assert not white[i, kept:].any()


def test_noise_weighed_anew_leaves_the_errors_that_points_share():
    rng, present = np.random.default_rng(4), np.ones((1, POINTS), bool)
    residual, error, weight, further = (np.abs(rng.standard_normal((4, 1, POINTS))) + 0.2)[:, :, :]
    whitening = shared_error(UnequalNoise(jnp.asarray(weight)), jnp.asarray(error), jnp.asarray(present))
    anew = reweighted(whitening, jnp.asarray(further), jnp.asarray(present))
    ours = stats.norm.logpdf(whiten(residual, present, whitening=anew)).sum()
    ours += float(anew.log_volume(jnp.asarray([POINTS]))[0])
    covariance = np.diag((weight * further)[0] ** -2.0) + np.outer(error[0], error[0])
    assert ours == pytest.approx(normal_density(residual[0], covariance), rel=1e-10)
    with pytest.raises(TypeError, match="SmoothedNoise says all of the noise"):
        reweighted(smoothed_noise(POINTS, 5), jnp.asarray(further), jnp.asarray(present))


def test_lag_1_leaves_padding_out():
    residual = np.concatenate([[1.0, 2.0, 4.0, 1.0], np.full(3, 99.0)])
    centred = residual[:4] - 2.0
    found = lag_1(jnp.asarray(residual), jnp.asarray(np.arange(7) < 4))
    assert float(found) == pytest.approx(np.sum(centred[1:] * centred[:-1]) / np.sum(centred**2))


def test_whitened_residuals_are_white():
    rng = np.random.default_rng(2)
    records, points = 40, 400
    present = np.ones((records, points), bool)
    noise = np.empty((records, points))
    noise[:, 0] = rng.standard_normal(records)
    for t in range(1, points):
        noise[:, t] = 0.8 * noise[:, t - 1] + 0.6 * rng.standard_normal(records)
    smooth = np.array(
        [np.convolve(rng.standard_normal(points + 19), np.ones(20) / 20, "valid") for _ in range(records)]
    )
    autoregressive = whiten(noise, present, np.full(records, 0.8))
    averaged = whiten(smooth, present, whitening=smoothed_noise(points, 20))
    for correlated, white in ((noise, autoregressive), (smooth, averaged)):
        before, after = (
            np.mean([float(lag_1(jnp.asarray(row), jnp.ones(points, bool))) for row in each])
            for each in (correlated, white)
        )
        # The mean lag-1 autocorrelation of 40 white records of 400 points has a standard error of 0.05 / sqrt(40).
        assert before > 0.7
        assert abs(after) < 5 * 0.05 / np.sqrt(40)
    assert whiten(noise, present) is noise


def test_a_record_too_long_for_its_covariance_is_refused_with_the_remedy():
    with pytest.raises(BadInput, match="keep every n-th point"):
        smoothed_noise(MOST_POINTS + 1, 5)
