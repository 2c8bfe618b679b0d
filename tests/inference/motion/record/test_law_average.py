"""The average over force laws: moments by hand, fits that do not count, and the laws of records that are known."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.map_estimates import map_estimate
from helpers.mismatched_motions import simulated

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.laws import FANCHER, MOTION_LAWS, MotionLaw
from bayes_tyre.inference.motion.record import law_average
from bayes_tyre.inference.motion.record.estimate import MotionEstimate, estimate_motion
from bayes_tyre.inference.motion.record.law_average import average, converged_estimate, estimate_by
from bayes_tyre.inference.motion.record.model.window import Window

AUTO = MOTION_LAWS["auto"]
NAMES = AUTO.averaged


def estimate(
    log_evidence: float, at: float, sd: float = 0.1, *, converged: bool = True, status: str = ""
) -> MotionEstimate:
    """Return an estimate of two logarithms, equal and independent; without trusted draws if it has not converged."""
    return MotionEstimate(
        log_mean=np.full(2, at),
        log_covariance=sd**2 * np.eye(2),
        method="importance" if converged else "laplace",
        log_draws=np.array([[at - sd, at], [at + sd, at]]),
        weights=np.array([0.25, 0.75]),
        map_estimate=map_estimate(np.zeros(1), np.eye(1), converged=converged),
        window=Window(jnp.array(1e-3), jnp.zeros((3, 4)), jnp.zeros((3, 4)), jnp.ones(3) / 3, jnp.zeros((2, 1))),
        pareto_k=0.1,
        effective_draws=2.0,
        log_evidence=log_evidence,
        discrepancy_share=0.0,
        load_departure_share=0.0,
        narrower_without_force=np.ones(2),
        status=status,
    )


def test_moments_are_those_of_the_mixture():
    """Fancher's law is as probable beforehand as both others together."""
    found = average(
        [estimate(10.0, 0.0), estimate(10.0 + np.log(4.0), 1.0, 0.2), estimate(-np.inf, 5.0)], ("fancher", "a", "b")
    )
    # One without evidence counts for nothing; of the others Fancher's prior is 2 / 3.
    assert found.law_weights == pytest.approx({"fancher": 1 / 3, "a": 2 / 3, "b": 0.0})
    mean = 2 / 3
    np.testing.assert_allclose(found.log_mean, mean)
    variance = 0.1**2 / 3 + 0.2**2 * 2 / 3
    between = mean**2 / 3 + (1 - mean) ** 2 * 2 / 3
    np.testing.assert_allclose(found.log_covariance, variance * np.eye(2) + between)
    assert found.log_evidence == pytest.approx(10.0 + np.log(2 / 3 + 4 / 3))
    np.testing.assert_allclose(found.weights, [1 / 12, 1 / 4, 1 / 6, 1 / 2])
    assert found.weights @ found.log_draws[:, 1] == pytest.approx(mean)


def test_status_is_that_of_the_probable_laws():
    assert average([estimate(0.0, 0.0, status="off"), estimate(9.0, 0.0)], ("fancher", "a")).status == ""
    assert average([estimate(9.0, 0.0, status="off"), estimate(0.0, 0.0)], ("fancher", "a")).status == "off"
    both = average([estimate(0.0, 0.0, status="off"), estimate(0.0, 0.0, status="wide")], ("fancher", "a"))
    assert both.status == "off; wide"


def test_a_fit_that_did_not_converge_counts_only_where_none_has():
    lost, kept = estimate(50.0, 3.0, converged=False), estimate(0.0, 0.0)
    assert average([lost, kept], ("fancher", "a")).law_weights == {"fancher": 0.0, "a": 1.0}
    assert average([lost, lost], ("fancher", "a")).law_weights == pytest.approx({"fancher": 0.5, "a": 0.5})


def test_a_fit_without_evidence_does_not_stand_in_the_way_of_one_that_has_it():
    lost, usable = estimate(float("nan"), 3.0), estimate(0.0, 0.0, converged=False)
    assert average([lost, usable], ("fancher", "a")).law_weights == {"fancher": 0.0, "a": 1.0}


def test_without_any_evidence_the_first_is_left_as_it_is_and_no_law_has_a_weight():
    found = average([estimate(float("nan"), 1.0), estimate(float("nan"), 2.0)], ("fancher", "a"))
    assert found.log_mean.tolist() == [1.0, 1.0]
    assert np.isnan(list(found.law_weights.values())).all()


def test_one_law_is_fitted_once_and_the_average_once_by_each_without_nuts():
    asked = []

    def fitted(_rig: Any, _record: Any, law: MotionLaw, sampler: Any) -> MotionEstimate:
        asked.append((law.name, sampler))
        return estimate(0.0, 0.0)

    _, rig, record = simulated("none", 0)
    assert estimate_by(rig, record, FANCHER, None, fitted).law_weights == {}
    assert [name for name, _ in asked] == ["fancher"]
    asked.clear()
    found = estimate_by(rig, record, AUTO, estimate=fitted)
    assert asked == [(name, None) for name in NAMES]
    assert found.law_weights["fancher"] == pytest.approx(0.5)


def test_a_fit_that_did_not_converge_is_no_estimate_unless_laws_are_compared(monkeypatch):
    _, rig, record = simulated("none", 0)
    monkeypatch.setattr(law_average, "estimate_by", lambda *_: estimate(0.0, 1.0, converged=False))
    for law in (FANCHER, AUTO):
        with pytest.raises(BadInput, match="the fit of its motion did not converge; look at its channels"):
            converged_estimate(rig, record, law)
    rival = next(law for law in MOTION_LAWS.values() if law.reported != FANCHER.reported)
    assert converged_estimate(rig, record, rival).log_mean.tolist() == [1.0, 1.0]
    monkeypatch.setattr(law_average, "estimate_by", lambda *_: estimate(0.0, 1.0))
    assert converged_estimate(rig, record).log_mean.tolist() == [1.0, 1.0]


def test_trusted_draws_are_an_estimate_wherever_the_solver_stopped(monkeypatch):
    _, rig, record = simulated("none", 0)
    drawn = replace(estimate(50.0, 3.0, converged=False), method="importance")
    monkeypatch.setattr(law_average, "estimate_by", lambda *_: drawn)
    assert converged_estimate(rig, record) is drawn
    weights = average([drawn, estimate(0.0, 0.0)], ("fancher", "a")).law_weights
    assert weights["fancher"] == pytest.approx(1.0)


# Two laws, each compiled: over 10 s; all five would take minutes.
@pytest.mark.slow
@pytest.mark.usefixtures("fully_compiled")
def test_a_record_of_a_tyre_that_relaxes_is_fitted_as_one():
    truth, rig, record = simulated("relaxing branch", 0)
    names = "fancher", "relaxing"
    found = average([estimate_motion(rig, record, MOTION_LAWS[name], sampler=None) for name in names], names)
    assert found.status == ""
    # By Fancher's law alone a force is left out, and the evidence is some 14 behind.
    assert found.law_weights["relaxing"] > 0.99
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm])
    off = (found.log_mean[:3] - logs) / np.sqrt(np.diag(found.log_covariance)[:3])
    # Three normal numbers: one beyond 4 standard deviations in 0.02 % of seeds.
    assert np.abs(off).max() < 4
    parameters = found.window.in_units(rig, jnp.asarray(found.map_estimate.standard))
    assert parameters.law.relaxing_share == pytest.approx(0.08, abs=0.04)
