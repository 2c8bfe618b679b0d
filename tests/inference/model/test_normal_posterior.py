"""Normal unknowns under a quadratic log likelihood, against dense matrices in numpy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.inference.model.normal_posterior import NormalPosterior, QuadraticApproximation

UNITS = 3


def made(count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return slope, precision and scale of a few units; units last."""
    random = np.random.default_rng(seed)
    rows = random.standard_normal((UNITS, count, count))
    precision = np.moveaxis(rows @ np.moveaxis(rows, 1, 2), 0, -1)
    return random.standard_normal((count, UNITS)), precision, random.uniform(0.1, 2.0, (count, UNITS))


@settings(max_examples=20)
@given(count=st.integers(1, 4), seed=st.integers(0, 1000))
def test_mean_covariance_and_marginal_are_those_of_dense_matrices(count, seed):
    slope, precision, scale = made(count, seed)
    posterior = NormalPosterior(*map(jnp.asarray, (slope, precision, scale)))
    mean, root = np.asarray(posterior.draw(jnp.zeros((count, UNITS)))), np.asarray(posterior.root())
    for i in range(UNITS):
        total = precision[..., i] + np.diag(scale[:, i] ** -2)
        covariance = np.linalg.inv(total)
        np.testing.assert_allclose(mean[:, i], covariance @ slope[:, i], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(root[..., i] @ root[..., i].T, covariance, rtol=1e-9, atol=1e-12)
        gained = np.linalg.slogdet(precision[..., i] @ np.diag(scale[:, i] ** 2) + np.eye(count))[1]
        by_hand = 0.5 * slope[:, i] @ covariance @ slope[:, i] - 0.5 * gained
        assert float(posterior.log_marginal[i]) == pytest.approx(by_hand, rel=1e-9, abs=1e-10)
        volume = 0.5 * np.linalg.slogdet(covariance)[1]
        assert float(posterior.log_volume[i]) == pytest.approx(volume, rel=1e-9, abs=1e-10)


@settings(max_examples=10)
@given(count=st.integers(1, 4), seed=st.integers(0, 1000))
def test_the_gradient_of_the_marginal_is_that_of_finite_differences(count, seed):
    """In slope, scale and the entries of the precision, of whose lower triangle alone it is a function."""
    given_values, step = [jnp.asarray(value) for value in made(count, seed)], 1e-6

    def marginal(slope: jax.Array, precision: jax.Array, scale: jax.Array) -> jax.Array:
        return NormalPosterior(slope, precision, scale).log_marginal.sum()

    gradients = jax.grad(marginal, argnums=(0, 1, 2))(*given_values)
    for which, value in enumerate(given_values):
        for place in np.ndindex(*value.shape):
            by = [value.at[place].add(sign * step) for sign in (1, -1)]
            moved = [marginal(*(one if i == which else v for i, v in enumerate(given_values))) for one in by]
            # Third derivatives are at most some 1e2 here: 1e-10; rounding of values near 1e1 gives 1e-15 / 1e-6 more.
            expected = float(moved[0] - moved[1]) / (2 * step)
            assert float(gradients[which][place]) == pytest.approx(expected, rel=1e-6, abs=1e-6), (which, place)


def test_what_is_left_for_the_level_above_is_the_marginal_s_slope_and_curvature():
    slope, precision, scale = map(jnp.asarray, made(3, 1))

    def marginal(above: jax.Array) -> jax.Array:
        """Return the marginal of the first unit, less a constant, as a function of its level above."""
        at = slope[:, 0] @ above - 0.5 * above @ precision[..., 0] @ above
        moved = slope[:, 0] - precision[..., 0] @ above
        return at + NormalPosterior(moved, precision[..., 0], scale[:, 0]).log_marginal

    left, curvature = NormalPosterior(slope, precision, scale).for_above()
    np.testing.assert_allclose(left[:, 0], jax.grad(marginal)(jnp.zeros(3)), rtol=1e-10)
    np.testing.assert_allclose(curvature[..., 0], -jax.hessian(marginal)(jnp.zeros(3)), rtol=1e-9, atol=1e-12)


def test_a_scale_of_zero_leaves_the_unknown_at_the_level_above():
    slope, precision, _ = map(jnp.asarray, made(2, 2))
    scale = jnp.asarray([[0.0] * UNITS, [1.0] * UNITS])
    posterior = NormalPosterior(slope, precision, scale)
    assert not np.asarray(posterior.draw(jnp.ones((2, UNITS))))[0].any()
    alone = NormalPosterior(slope[1:], precision[1:, 1:], scale[1:])
    np.testing.assert_allclose(posterior.log_marginal, alone.log_marginal, rtol=1e-12)
    gradient = jax.grad(lambda scale: NormalPosterior(slope, precision, scale).log_marginal.sum())(scale)
    assert np.isfinite(gradient).all()


def test_a_quadratic_is_a_normal_s_log_density():
    random = np.random.default_rng(0)
    rows = random.standard_normal((2, 2))
    precision, mean, at = rows @ rows.T, random.standard_normal(2), random.standard_normal((5, 2))
    centre = random.standard_normal(2)
    quadratic = QuadraticApproximation(
        jnp.asarray(centre), jnp.asarray(precision @ (mean - centre)), jnp.asarray(precision)
    )
    by_hand = np.array([-0.5 * (one - mean) @ precision @ (one - mean) for one in (*at, centre)])
    by_hand = by_hand[:-1] - by_hand[-1]
    np.testing.assert_allclose([float(quadratic.at(jnp.asarray(one))) for one in at], by_hand, rtol=1e-10)
    np.testing.assert_allclose(quadratic.slope_at(jnp.asarray(at[0])), precision @ (mean - at[0]), rtol=1e-10)
