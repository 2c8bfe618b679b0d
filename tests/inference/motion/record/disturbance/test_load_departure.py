"""The load's departure from its shape: found where the load has one, by the cell alone, and what it mends."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.mismatched_motions import simulated

from bayes_tyre.inference.motion.record.checks import NOT_LINEAR
from bayes_tyre.inference.motion.record.disturbance.load_departure import load_departure
from bayes_tyre.inference.motion.record.estimate import estimate_motion
from bayes_tyre.inference.motion.record.model.forward_model import cylinder_load, node_times
from bayes_tyre.inference.motion.record.model.parameters import in_units
from bayes_tyre.inference.motion.record.model.window import BEFORE_S, make_window
from bayes_tyre.studies.motion_machine import load_of
from bayes_tyre.studies.motion_mismatch import MISMATCHES


@pytest.mark.parametrize("mismatch", ["none", "laser lag 1.5 ms", "relaxing branch", "12 kg on the load cell"])
def test_a_load_of_the_family_s_shape_has_none(mismatch):
    # A size above zero by chance: 0.7 % of records by the odds that it needs, 3 % of four.
    truth, rig, recorded = simulated(mismatch, 0)
    departure = load_departure(rig, make_window(rig, recorded))
    assert departure.size == 0
    # Levels and rise are the load cell's own, a standard error of it being some hundredths of the step.
    load = in_units(rig, departure.standard, make_window(rig, recorded).prior).load_kN
    assert load == pytest.approx(np.array([truth.load_before_kN, truth.load_after_kN]), abs=0.1)


@pytest.mark.parametrize("mismatch", ["overshoot 6 % at 18 Hz", "load in two stages"])
def test_shape_and_departure_together_are_nearer_to_the_load_than_the_cell_s_readings(mismatch):
    truth, rig, recorded = simulated(mismatch, 0)
    window = make_window(rig, recorded)
    departure = load_departure(rig, window)
    assert departure.size > 0
    time_s = np.asarray(node_times(window))
    shape = cylinder_load(in_units(rig, departure.standard, window.prior), jnp.asarray(time_s))
    first_s = round((recorded.ramp_s[0] - BEFORE_S) / recorded.dt_s) * recorded.dt_s
    load = load_of(MISMATCHES[mismatch].machine, truth, first_s + time_s)
    off = [np.sqrt(np.mean((np.asarray(each) - load) ** 2)) for each in (shape, shape + departure_load(departure))]
    # A reading's noise is 2 % of the step.
    assert off[1] < 0.5 / np.max(window.weight[2])
    assert off[1] < 0.5 * off[0]


def departure_load(departure):
    return departure.weights @ departure.columns.load_kN


@pytest.mark.parametrize("number", range(4))
def test_the_cell_shows_how_a_load_rings(number):
    _, rig, recorded = simulated("overshoot 6 % at 18 Hz", number)
    window = make_window(rig, recorded)
    rings = window.with_ringing()
    departure = load_departure(rig, rings)
    ringing = rings.in_units(rig, departure.standard).ringing
    assert ringing is not None
    assert ringing.frequency_Hz == pytest.approx(18.0, rel=0.05)
    # It decays in 80 ms, 4.5 of its periods.
    assert ringing.damping_ratio == pytest.approx(1 / (2 * np.pi * 18.0 * 0.08), rel=0.3)
    assert departure.size == 0
    assert departure.log_evidence > load_departure(rig, window).log_evidence


@pytest.mark.slow
@pytest.mark.usefixtures("fully_compiled")
@pytest.mark.parametrize("mismatch", ["overshoot 6 % at 18 Hz", "load in two stages"])
def test_intervals_hold_the_truth_where_the_load_has_another_shape(mismatch):
    truth, rig, record = simulated(mismatch, 1)
    estimate = estimate_motion(rig, record, sampler=None)
    if mismatch == "load in two stages":
        assert estimate.load_departure_share > 0
        assert NOT_LINEAR in estimate.status
    else:
        assert estimate.window.ringing_at
        assert estimate.load_departure_share == 0
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm])
    # Three correlated normal numbers beyond 3 standard deviations: at most 0.8 % of seeds, 1.6 % of the two.
    assert np.all(np.abs(estimate.log_mean[:3] - logs) < 3 * np.sqrt(np.diag(estimate.log_covariance)[:3]))
    # With neither k was 2.5 % off, x and beta by up to 20.
    assert np.all(np.abs(estimate.log_mean[:3] - logs) < [0.015, 0.02, 0.02])
