"""A record's own priors taken out of its estimate: a known likelihood comes back, and counts once however it came."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.laws import FANCHER
from bayes_tyre.inference.motion.record.likelihood import (
    WIDENED,
    RecordLikelihood,
    hierarchy_moments,
    likelihood_of,
    without_prior,
)
from bayes_tyre.inference.motion.record.model.parameters import in_units, parameter_names, prior_moments
from bayes_tyre.rig.axle import load_rig

NAMES = parameter_names(FANCHER)

RIG = load_rig("single")
#: Names that take their location from a record.
KNOWN = ("load_before_kN", "load_after_kN", "laser_at_rest_mm", "acceleration_offset_m_per_s2")


def random_precision(seed: int, scale: float) -> np.ndarray:
    root = np.random.default_rng(seed).normal(size=(5, 5))
    return scale * (root @ root.T + np.eye(5))


KNOWN_BEFORE = dict.fromkeys(KNOWN, (1.0, 1.0)) | {"ramp_start_s": (0.05, np.nan), "log_rise": (-3.0, np.nan)}
PRIOR = prior_moments(RIG, KNOWN_BEFORE)


@jax.jit
def logs(five: jax.Array) -> jax.Array:
    """Return the logarithms of k, x, beta, m and c at the first five standard parameters."""
    parameters = in_units(RIG, jnp.concatenate([five, jnp.zeros(len(NAMES) - 5)]), PRIOR)
    law = parameters.law
    return jnp.log(jnp.stack([law.k, law.x, law.beta, parameters.m_kg, parameters.c_kN_s_per_mm]))


def of_a_record(precision: np.ndarray, peak: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the moments of the logarithms that a record with this likelihood would be estimated with."""
    covariance = np.linalg.inv(precision + np.eye(5))
    mean = jnp.asarray(covariance @ precision @ peak)
    jacobian = np.asarray(jax.jacfwd(logs)(mean))
    return np.asarray(logs(mean)), jacobian @ covariance @ jacobian.T


def log_density(likelihood: RecordLikelihood, five: np.ndarray) -> float:
    """Return the likelihood's logarithm at standard parameters."""
    of_x = np.array(logs(jnp.asarray(five)))
    k, x, beta = np.exp(of_x[:3])
    of_x[1] = np.log(x - k * beta)
    return -0.5 * float(np.sum((likelihood.rows @ of_x - likelihood.target) ** 2))


@pytest.mark.parametrize("scale", [0.5, 1e4])
def test_a_known_likelihood_comes_back(scale):
    precision, peak = random_precision(1, scale), np.array([0.5, -0.3, 0.2, 1.0, -0.7])
    found = likelihood_of(RIG, *of_a_record(precision, peak), PRIOR)
    rng = np.random.default_rng(2)
    points = peak + rng.normal(size=(6, 5)) / np.sqrt(scale)
    expected = np.array([-0.5 * (point - peak) @ precision @ (point - peak) for point in points])
    density = np.array([log_density(found, point) for point in points])
    # The logarithms are linear in standard parameters: nothing but rounding is lost.
    np.testing.assert_allclose(density - density[0], expected - expected[0], rtol=1e-7, atol=1e-7)


def test_priors_count_once_and_not_once_a_record():
    # Ten records that say nothing but their prior leave the prior; ten with a weak likelihood add up their precisions.
    rows, target = without_prior(np.zeros(5), np.eye(5))
    assert not rows.any()
    assert not target.any()
    precision, peak = random_precision(3, 2.0), np.full(5, 0.4)
    covariance = np.linalg.inv(precision + np.eye(5))
    rows, target = without_prior(covariance @ precision @ peak, covariance)
    together = np.eye(5) + 10 * rows.T @ rows
    np.testing.assert_allclose(together, np.eye(5) + 10 * precision, rtol=1e-9)
    mean = np.linalg.solve(together, 10 * rows.T @ target)
    np.testing.assert_allclose(mean, np.linalg.solve(np.eye(5) + 10 * precision, 10 * precision @ peak), rtol=1e-9)


def test_a_direction_wider_than_its_prior_says_nothing():
    covariance = np.diag([1e-4, 1e-2, 0.5, 1.3, 0.95])
    rows, target = without_prior(np.full(5, 0.3), covariance)
    assert sorted(np.abs(rows).max(axis=1) > 0) == [False, False, True, True, True]
    assert np.isfinite(target).all()


def test_an_estimate_that_failed_its_check_is_widened():
    moments = of_a_record(random_precision(4, 100.0), np.zeros(5))
    one, other = likelihood_of(RIG, *moments, PRIOR), likelihood_of(RIG, *moments, PRIOR, trusted=False)
    np.testing.assert_allclose(one.rows, WIDENED * other.rows)
    np.testing.assert_allclose(one.target, WIDENED * other.target)


def test_what_is_no_estimate_is_refused():
    with pytest.raises(BadInput, match="covariance"):
        without_prior(np.zeros(5), np.diag([1.0, 1.0, -1.0, 1.0, 1.0]))
    with pytest.raises(BadInput, match="covariance"):
        without_prior(np.full(5, np.nan), np.eye(5))
    with pytest.raises(BadInput, match="make energy"):
        hierarchy_moments(np.log([2.0, 0.1, 0.1, 300.0, 0.001]), np.eye(5))
