"""A rolling record: its quiet stretch's harmonics, and tyre, mass and damping from its motion over the runout."""

import numpy as np
import pytest

from bayes_tyre.inference.motion_estimate import estimate_motion
from bayes_tyre.inference.motion_quiet import quiet_motion
from bayes_tyre.inference.motion_runout import ground_names
from bayes_tyre.inference.motion_window import Recorded, window_of
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.signals.channels import find_channels
from bayes_tyre.signals.ramp import find_ramp
from bayes_tyre.signals.runout import nominal_bodies, remove_runout
from bayes_tyre.signals.steps import find_step, quiet_samples
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.simulate.simulator import simulate_record

RIG = load_rig("single")


def test_harmonics_and_turns_of_a_quiet_stretch_come_back():
    rng, time_s = np.random.default_rng(4), np.arange(-3.0, 0.0, 2e-3)
    turn, amplitude = np.array([2.06, 8.28]), np.array([0.3 - 0.1j, 0.05j, -0.06 + 0.02j])
    omega = 2 * np.pi * np.array([turn[0], 2 * turn[0], turn[1]])
    moved = np.real(amplitude[:, None] * np.exp(1j * omega[:, None] * time_s))
    laser = 650.0 + moved.sum(axis=0) + 0.005 * rng.standard_normal(len(time_s))
    acceleration = 0.2 + 1e-3 * omega**2 @ moved + 0.01 * rng.standard_normal(len(time_s))
    said = quiet_motion(time_s, acceleration, laser, [(turn[0] * 1.001, 2), (turn[1] * 0.9995, 1)])
    # 1500 values a channel: standard errors of amplitudes 0.0002 mm, of levels 0.0001 mm and 0.0003 m/s^2, of turns
    # below 1e-4; eight comparisons at 5 of them.
    np.testing.assert_allclose(said.amplitude_mm, amplitude, atol=1e-3)
    np.testing.assert_allclose(said.turn_Hz, turn, rtol=5e-4)
    assert said.laser_mm[0] == pytest.approx(650.0, abs=1e-3)
    assert said.acceleration_m_per_s2[0] == pytest.approx(0.2, abs=2e-3)


def rolling_record():
    plan = next(p for p in thesis_plan() if p.record == "S(25)30-35(3)")
    truth = draw_truth(plan._replace(duration_s=6.0), RIG, 1)
    read = find_channels(simulate_record(truth, RIG).raw, RIG)
    quiet = quiet_samples(find_ramp(read.load_kN, read.dt_s), read)
    still, runout = remove_runout(read, quiet, nominal_bodies(RIG, plan.case.speed_km_h))
    step = find_step(still)
    bodies = tuple((body.turn_Hz, body.harmonics) for body in runout.bodies)
    ramp_s = step.ramp.start_s, step.ramp.end_s
    return truth, Recorded(read.dt_s, *read[1:], quiet=step.quiet, ramp_s=ramp_s, bodies=bodies)


def test_a_rolling_window_has_an_unknown_for_every_name():
    _, record = rolling_record()
    window = window_of(RIG, record)
    assert window.prior.shape[1] == 17 + len(ground_names(record.bodies))
    assert np.isfinite(window.prior).all()


@pytest.mark.slow
def test_parameters_of_a_rolling_loading_step_come_back():
    truth, record = rolling_record()
    estimate = estimate_motion(RIG, record)
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm, truth.m_kg, truth.c_kN_s_per_mm])
    off = estimate.log_mean - logs
    assert estimate.method == "importance"
    # Five correlated normal numbers beyond 4 standard deviations: 0.03 % of seeds. The target: k within 1 %.
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(estimate.log_covariance)))
    assert abs(off[0]) < 0.01
