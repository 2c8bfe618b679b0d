"""NUTS on one record's motion: its gradient, its draws beside weighted ones, and when an estimate rests on it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.recorded_motions import RIG, recorded

from bayes_tyre.inference.motion.record import estimate as motion_estimate
from bayes_tyre.inference.motion.record import nuts as motion_nuts
from bayes_tyre.inference.motion.record.estimate import MotionEstimate, estimate_motion, log_parameters
from bayes_tyre.inference.motion.record.importance_sampling import proposal_map
from bayes_tyre.inference.motion.record.nuts import NutsDraws, effective_draws, sample_motion
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.simulate.plan import quick_plan

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("fully_compiled")]


@pytest.fixture(scope="module")
def estimate() -> MotionEstimate:
    """A standing record of the single tyre, from weighted draws."""
    _, record = recorded(quick_plan()[0], seed=7)
    return estimate_motion(RIG, record)


@pytest.fixture(scope="module")
def drawn(estimate) -> NutsDraws:
    return sample_motion(RIG, estimate.window, estimate.map_estimate, SamplerSettings(chains=2, warmup=80, draws=80))


def logarithms(standard: np.ndarray, estimate: MotionEstimate) -> np.ndarray:
    return np.asarray(log_parameters(RIG, jnp.asarray(standard), jnp.asarray(estimate.window.prior)))


def test_the_gradient_is_that_of_the_negative_log_density(estimate):
    window = jax.tree.map(jnp.asarray, estimate.window)
    standard, covariance = (
        jnp.asarray(each) for each in (estimate.map_estimate.standard, estimate.map_estimate.covariance)
    )
    proposal = jax.jit(proposal_map, static_argnums=0)(RIG, window, standard, covariance)
    density = jax.jit(lambda unit: motion_nuts._negative_log_density(RIG, window, proposal, unit))
    unit = np.random.default_rng(0).normal(size=len(standard))
    small = 1e-4 * np.eye(len(unit))
    differences = [(density(unit + step) - density(unit - step)) / 2e-4 for step in small]
    np.testing.assert_allclose(jax.jit(jax.grad(density))(unit), differences, rtol=1e-3, atol=1e-3)


def test_its_draws_are_those_that_weights_make(estimate, drawn):
    assert estimate.method == "importance"
    assert drawn.divergent == 0
    logs = logarithms(drawn.standard, estimate).reshape(-1, len(estimate.log_mean))
    difference = (logs.mean(axis=0) - estimate.log_mean) / np.sqrt(np.diag(estimate.log_covariance))
    # Some 200 effective weighted draws and 100 of NUTS at the least: 0.12 of a standard deviation between the means.
    # 4.5 times that, in one of five numbers: 3 seeds in 100,000.
    assert np.all(np.abs(difference) < 0.55)
    ratio = logs.std(axis=0) / np.sqrt(np.diag(estimate.log_covariance))
    # A standard deviation of 100 draws is difference by 7 %, of 200 by 5 %: 4.5 times 0.09.
    assert np.all(np.abs(np.log(ratio)) < 0.4)


def test_an_estimate_rests_on_it_where_weights_are_of_no_use(estimate, drawn, monkeypatch):
    monkeypatch.setattr(motion_estimate, "weights_trusted", lambda _: False)
    monkeypatch.setattr(motion_estimate, "fit_window", lambda *_: (estimate.window, estimate.map_estimate))
    monkeypatch.setattr(motion_estimate, "make_window", lambda *_, **__: None)
    monkeypatch.setattr(motion_estimate, "sample_motion", lambda *_: drawn)
    record = recorded(quick_plan()[0], seed=7)[1]
    monkeypatch.setattr(motion_estimate, "effective_draws", lambda *_: 160.0)
    by_nuts = estimate_motion(RIG, record)
    assert (by_nuts.method, by_nuts.status, by_nuts.effective_draws) == ("nuts", "", 160.0)
    logs = logarithms(drawn.standard, estimate).reshape(-1, len(estimate.log_mean))
    np.testing.assert_allclose(by_nuts.log_mean, logs.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(by_nuts.log_covariance, np.cov(logs.T), rtol=1e-9)
    # Chains that differ leave the peak, and a status that says so.
    monkeypatch.setattr(motion_estimate, "effective_draws", lambda *_: 0.0)
    by_peak = estimate_motion(RIG, record)
    assert by_peak.method == "laplace"
    assert "the posterior is not what was drawn from about its peak" in by_peak.status
    # A motion that does not fit its record is not sample_motion.
    difference = estimate.map_estimate._replace(chi_squared=np.array([3.0, 1.0, 1.0]))
    monkeypatch.setattr(motion_estimate, "fit_window", lambda *_: (estimate.window, difference))
    monkeypatch.setattr(motion_estimate, "sample_motion", lambda *_: pytest.fail("sample_motion all the same"))
    assert estimate_motion(RIG, record).method == "laplace"


def test_chains_that_differ_are_worth_nothing():
    draws = np.random.default_rng(1).normal(size=(4, 500, 2))
    assert effective_draws(draws, 0) > 1000
    assert effective_draws(draws, 1) == 0
    assert effective_draws(draws + np.arange(4)[:, None, None], 0) == 0
    assert effective_draws(draws[:, :50], 0) == 0
