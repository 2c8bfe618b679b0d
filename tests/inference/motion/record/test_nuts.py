"""NUTS on one record's motion: its gradient, its draws beside weighted ones, and when an estimate rests on it."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.recorded_motions import RIG, recorded

from bayes_tyre.inference.motion.record import estimate as motion_estimate
from bayes_tyre.inference.motion.record import importance_sampling
from bayes_tyre.inference.motion.record import nuts as motion_nuts
from bayes_tyre.inference.motion.record.estimate import MotionEstimate, estimate_motion
from bayes_tyre.inference.motion.record.importance_sampling import proposal_map
from bayes_tyre.inference.motion.record.model.window import Recorded
from bayes_tyre.inference.motion.record.nuts import NutsDraws, effective_draws, sample_motion
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.simulate.plan import quick_plan

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("fully_compiled")]

#: A short run, and what is asked of it in place of 100 effective draws a chain and an R-hat of 1.01.
SHORT, EFFECTIVE_LEAST_PER_CHAIN, R_HAT_MOST = SamplerSettings(chains=2, warmup=80, draws=100), 20, 1.1


@pytest.fixture(scope="module")
def record() -> Recorded:
    """A standing record of the single tyre."""
    return recorded(quick_plan()[0], seed=7)[1]


@pytest.fixture(scope="module")
def estimate(record) -> MotionEstimate:
    """Its estimate from weighted draws."""
    return estimate_motion(RIG, record)


@pytest.fixture(scope="module")
def run_once() -> Callable[..., NutsDraws]:
    """NUTS on a record, run the first time that it is asked for."""
    runs: list[NutsDraws] = []

    def sampled_once(*of: Any) -> NutsDraws:
        return runs[0] if runs else (runs.append(sample_motion(*of)) or runs[0])

    return sampled_once


@pytest.fixture
def no_weights_trusted(monkeypatch, run_once) -> None:
    """Ask of weighted draws what none can give: this record's are good, and records whose are of no use are rare."""
    monkeypatch.setattr(importance_sampling, "EFFECTIVE_LEAST", np.inf)
    monkeypatch.setattr(motion_estimate, "sample_motion", run_once)


@pytest.fixture
def by_nuts(record, no_weights_trusted, monkeypatch) -> MotionEstimate:
    """The same record's estimate, by a short run of NUTS that is taken for long enough."""
    monkeypatch.setattr(motion_nuts, "ESS_LEAST_PER_CHAIN", EFFECTIVE_LEAST_PER_CHAIN)
    monkeypatch.setattr(motion_nuts, "R_HAT_MOST", R_HAT_MOST)
    return estimate_motion(RIG, record, sampler=SHORT)


def test_the_gradient_is_that_of_the_height(estimate):
    window = jax.tree.map(jnp.asarray, estimate.window)
    peak = estimate.map_estimate
    standard, covariance = jnp.asarray(peak.standard), jnp.asarray(peak.covariance)
    proposal = jax.jit(proposal_map, static_argnums=0)(RIG, window, standard, covariance)
    height = jax.jit(lambda unit: motion_nuts._negative_log_density(RIG, window, proposal, unit))
    unit = np.random.default_rng(0).normal(size=len(standard))
    small = 1e-4 * np.eye(len(unit))
    differences = [(height(unit + step) - height(unit - step)) / 2e-4 for step in small]
    np.testing.assert_allclose(jax.jit(jax.grad(height))(unit), differences, rtol=1e-3, atol=1e-3)


def test_an_estimate_rests_on_nuts_where_weights_are_of_no_use(estimate, by_nuts):
    assert (estimate.method, by_nuts.method) == ("importance", "nuts")
    assert by_nuts.status == ""
    # Draws of equal weight: the estimate is their mean and covariance.
    draws = SHORT.chains * SHORT.draws
    assert by_nuts.log_draws.shape == (draws, len(estimate.log_mean))
    np.testing.assert_allclose(by_nuts.weights, 1 / draws)
    np.testing.assert_allclose(by_nuts.log_mean, by_nuts.log_draws.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(by_nuts.log_covariance, np.cov(by_nuts.log_draws.T), rtol=1e-9)
    # And its draws are those that weights make. Of a mean the standard error is sd / sqrt(effective draws), of the
    # logarithm of a standard deviation the root of a half of 1 / effective draws. One of ten numbers beyond 4.5
    # standard errors: 7 seeds in 100,000.
    sd = np.sqrt(np.diag(estimate.log_covariance))
    variance = 1 / estimate.effective_draws + 1 / by_nuts.effective_draws
    assert np.all(np.abs(by_nuts.log_mean - estimate.log_mean) / sd < 4.5 * np.sqrt(variance))
    ratio = np.sqrt(np.diag(by_nuts.log_covariance)) / sd
    assert np.all(np.abs(np.log(ratio)) < 4.5 * np.sqrt(variance / 2))


def test_chains_that_are_too_short_leave_the_peak_and_a_status_that_says_so(record, no_weights_trusted):
    by_peak = estimate_motion(RIG, record, sampler=SHORT)
    assert by_peak.method == "laplace"
    assert "the posterior is not what was drawn from about its peak" in by_peak.status


def test_a_motion_that_does_not_fit_its_record_is_not_sampled(record, no_weights_trusted, monkeypatch):
    monkeypatch.setattr(motion_estimate, "sample_motion", lambda *_: pytest.fail("sampled all the same"))
    # A shake of 20 Hz over all of it, which neither the load nor any law explains.
    time_s = record.dt_s * np.arange(len(record.acceleration_m_per_s2))
    shaken = record.acceleration_m_per_s2 + 0.5 * np.sin(2 * np.pi * 20.0 * time_s)
    estimate = estimate_motion(RIG, record._replace(acceleration_m_per_s2=shaken))
    assert estimate.method == "laplace"
    assert "acceleration is off by" in estimate.status


def test_chains_that_differ_are_worth_nothing():
    draws = np.random.default_rng(1).normal(size=(4, 500, 2))
    assert effective_draws(draws, 0) > 1000
    assert effective_draws(draws, 1) == 0
    assert effective_draws(draws + np.arange(4)[:, None, None], 0) == 0
    assert effective_draws(draws[:, :50], 0) == 0
