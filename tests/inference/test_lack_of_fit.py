"""Lack of fit: the tangents are the derivatives, noise has its own p-values, what is not noise its own size."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import kstest

from bayes_tyre.inference.lack_of_fit import WAVE_POINTS, Misfit, curve_tangents, misfit
from bayes_tyre.inference.record_data import LAWS, force_curve

K, J, BETA = 1.6, 0.4, 0.1


def path(points: int) -> np.ndarray:
    return 3.0 * np.linspace(0.0, 1.0, points) ** 2


def judged(residual: np.ndarray, points: int) -> Misfit:
    """Return the lack of fit of residuals (kN) of records with the curve above."""
    records = len(residual)
    u = jnp.asarray(path(points))
    tangents = jnp.broadcast_to(
        curve_tangents(u, jnp.asarray(K), jnp.asarray(J), jnp.asarray(BETA)), (records, points, 4)
    )
    force = np.asarray((J + K * u) * -jnp.expm1(-u / BETA))
    return misfit(residual, tangents, np.ones((records, points), dtype=bool), np.tile(force, (records, 1)))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_tangents_are_the_derivatives_of_the_law(law, way):
    u = way * jnp.asarray(path(25))
    theta = np.array([14.0, way * J, np.log(K), np.log(BETA)])
    step = 1e-5
    for i in range(4):
        up, down = theta.copy(), theta.copy()
        up[i], down[i] = up[i] + step, down[i] - step
        slope = (force_curve(u, jnp.asarray(up), law) - force_curve(u, jnp.asarray(down), law)) / (2.0 * step)
        own = curve_tangents(u, jnp.asarray(K), jnp.asarray(way * J), jnp.asarray(BETA), law)[:, i]
        # The third is the derivative with respect to k, not to its logarithm.
        np.testing.assert_allclose(own * (K if i == 2 else 1.0), slope, atol=1e-8)


@pytest.mark.parametrize("points", [WAVE_POINTS, 40, 300])
def test_p_values_of_white_noise_are_uniform(points):
    found = judged(0.03 * np.random.default_rng(points).normal(size=(2000, points)), points)
    # The noise's variance is inflated by the autocorrelation that was seen, never deflated: p-values are a little high.
    assert kstest(found.p_value, "uniform", alternative="greater").pvalue > 1e-3
    assert found.p_value.min() < 0.02


def test_noise_that_follows_itself_is_seldom_taken_for_another_curve():
    rng, rho = np.random.default_rng(5), 0.3
    noise = rng.normal(size=(2000, 120))
    for i in range(1, 120):
        noise[:, i] = rho * noise[:, i - 1] + np.sqrt(1 - rho**2) * noise[:, i]
    found = judged(0.2 * noise, 120)
    # 2.5 % of 2000 are 50; allowed are four times that, for rho is that of what the waves leave.
    assert found.wrong_curve().sum() <= 200
    assert found.wrong_curve(1e-5).sum() <= 5


@pytest.mark.parametrize("points", [24, 120, 600])
def test_what_is_not_noise_has_its_own_size_however_densely_it_is_sampled(points):
    along = (np.arange(points) + 0.5) / points
    wrong = 0.1 * np.cos(5.0 * np.pi * along)  # a wave of which the parameters take up little
    noise = 0.02 * np.random.default_rng(6).normal(size=(100, points))
    found = judged(noise + wrong, points)
    extent = np.ptp((J + K * path(points)) * -np.expm1(-path(points) / BETA))
    # 100 means of squares: an error of the share by noise of some 0.02 / 0.07 / sqrt(24 * 100) = 0.6 %, six of them.
    assert np.mean(found.share) == pytest.approx(0.1 / np.sqrt(2.0) / extent, rel=0.04)
    assert found.wrong_curve().all()


def test_few_points_are_told_apart_from_nothing():
    few = WAVE_POINTS - 1
    large, small = judged(np.full((1, few), 1.0), few), judged(np.full((1, few), 0.001), few)
    assert np.isnan(large.p_value).all()
    assert (large.cannot_tell.tolist(), small.cannot_tell.tolist()) == ([True], [False])
    assert not large.wrong_curve().any()


def test_exact_data_are_not_blamed():
    found = judged(np.zeros((3, 60)), 60)
    assert not found.wrong_curve().any()
    np.testing.assert_array_equal(found.rms, 0.0)
