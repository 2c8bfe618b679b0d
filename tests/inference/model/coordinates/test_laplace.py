"""The Laplace approximation is the record's own likelihood near its peak."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.simulated_records import Plan, simulate
from scipy.optimize import least_squares

from bayes_tyre.batch import Batch
from bayes_tyre.inference.model.coordinates.laplace import empty_approximation, estimate_records, laplace_approximation
from bayes_tyre.inference.model.coordinates.reparameterisation import reparameterise_by_slope
from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood
from bayes_tyre.inference.model.prepared_records import prepare_records, record_batch
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.record_table import check_record_table

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


def test_the_likelihood_is_standard_normal_in_the_coordinates_of_long_records():
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), points=1000, noise_kN=0.005), seed=4)
    batch = record_batch(check_record_table(table))
    approximation, direct = estimate_records(batch), DirectLikelihood(record_data(batch))
    rng = np.random.default_rng(0)
    wide, quadratic = jnp.full_like(approximation.centre[:, 2:], 1e6), approximation.of_log_values()
    slope = quadratic.slope_at(jnp.zeros_like(wide))

    def log_density(z):
        pair = reparameterise_by_slope(z, slope, quadratic.precision, jnp.zeros_like(wide), wide).value
        return direct.of_offsets(pair, jnp.exp(approximation.log_sigma)).with_prior(wide).log_marginal

    peak = log_density(jnp.zeros_like(wide))
    for _ in range(20):
        z = jnp.asarray(rng.normal(size=wide.shape))
        expected = -0.5 * jnp.sum(z**2, axis=1)
        # Curvature of beta and the floor under the information leave some per cent.
        np.testing.assert_allclose(log_density(z) - peak, expected, rtol=0.15, atol=0.05)


@pytest.mark.parametrize(("mean_J", "sd_J"), [(0.0, 0.02), (-0.7, 0.02), (0.4, 1.0)])
def test_a_prior_of_the_offset_moves_what_a_record_says_of_k_and_beta_as_algebra_has_it(mean_J, sd_J):
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), points=40, noise_kN=0.3), seed=4)
    approximation = estimate_records(record_batch(check_record_table(table)))
    quadratic = approximation.of_log_values(jnp.full(len(approximation.centre), mean_J), jnp.asarray(sd_J))
    for record, information in enumerate(np.asarray(approximation.information)):
        with_prior = information + np.diag([0.0, sd_J**-2.0, 0.0, 0.0])
        covariance = np.linalg.inv(with_prior)[2:, 2:]
        pull = (float(approximation.centre[record, 1]) - mean_J) / sd_J**2
        moved = -np.linalg.solve(with_prior, [0.0, pull, 0.0, 0.0])[2:]
        np.testing.assert_allclose(quadratic.precision[record], np.linalg.inv(covariance), rtol=1e-6)
        np.testing.assert_allclose(
            np.linalg.solve(quadratic.precision[record], quadratic.slope[record]), moved, rtol=1e-6
        )


def test_the_estimate_of_the_limit_for_small_steps_is_its_least_squares():
    u, rng = 5.0 * np.linspace(0.0, 1.0, 60) ** 2, np.random.default_rng(7)
    force = 20.0 + 0.5 * -np.expm1(-u / 0.08) + 1.8 * u + rng.normal(0, 0.01, 60)
    batch = Batch(("x",), 10.0 + u[None], force[None], np.ones((1, 60), dtype=bool))
    found = np.asarray(estimate_records(batch, law="small_step_limit").centre[0])

    def residual(theta: np.ndarray) -> np.ndarray:
        return force - theta[0] - theta[1] * -np.expm1(-u / np.exp(theta[3])) - np.exp(theta[2]) * u

    by_scipy = least_squares(residual, [20.0, 0.5, np.log(1.8), np.log(0.08)], xtol=1e-12, ftol=1e-12).x
    np.testing.assert_allclose(found, by_scipy, rtol=0, atol=1e-5)


def test_a_record_that_leaves_beta_open_has_a_finite_approximation():
    d = np.linspace(5.0, 8.0, 40)
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=1, points=40), seed=1)
    # A straight line: no beta in it, and no offset.
    table["displacement_mm"], table["force_kN"] = d, 1.7 * d + np.random.default_rng(0).normal(0, 0.02, 40)
    approximation = estimate_records(record_batch(check_record_table(table)))
    for figures in approximation:
        assert bool(jnp.all(jnp.isfinite(figures)))
    assert float(jnp.linalg.det(approximation.of_log_values().precision[0])) > 0.0


def test_an_offset_that_pulls_against_the_line_is_in_the_approximation():
    """It may be larger than any change of force; cut to that, the sampler found it thousands of widths away."""
    u = 5.0 * np.linspace(0.0, 1.0, 40) ** 2
    force = 20.0 + (-7.0 + 1.8 * u) * -np.expm1(-u / 0.2) + np.random.default_rng(2).normal(0, 0.005, 40)
    approximation = estimate_records(Batch(("x",), 10.0 + u[None], force[None], np.ones((1, 40), dtype=bool)))
    assert np.abs(force - force[0]).max() < 6.0
    # Errors of F_i and J are some 0.003 kN: 0.02 is beyond 6 of them.
    np.testing.assert_allclose(approximation.centre[0, :2], [20.0, -7.0], rtol=0, atol=0.02)


def test_a_blank_approximation_has_the_shapes_of_one_made():
    table, _ = simulate(Plan(("x", "y"), (0.0, 15.0), (20.0,), (5.0,), repeats=2, points=40), seed=1)
    records = prepare_records(check_record_table(table), ModelSettings())
    batch, factors = records.batch, records.factors
    blank, drawn = empty_approximation(len(batch.records), factors), laplace_approximation(batch, factors)
    assert jax.tree.structure(blank) == jax.tree.structure(drawn)
    assert jax.tree.map(lambda leaf: (leaf.shape, leaf.dtype), blank) == (
        jax.tree.map(lambda leaf: (leaf.shape, leaf.dtype), drawn)
    )
    assert all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(drawn))
