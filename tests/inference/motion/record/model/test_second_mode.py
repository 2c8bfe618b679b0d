"""A second mode of the rig: its response against SciPy's, where it is found, and the record that it would spoil."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.mismatched_motions import simulated_on
from helpers.recorded_motions import RIG, recorded
from scipy.integrate import solve_ivp

from bayes_tyre.inference.motion.laws import FANCHER, MOTION_LAWS
from bayes_tyre.inference.motion.record.estimate import estimate_motion
from bayes_tyre.inference.motion.record.model.parameters import in_units
from bayes_tyre.inference.motion.record.model.second_mode import (
    SHOWS,
    SHOWS_ON_ROAD,
    SecondMode,
    largest_line,
    largest_peak,
    shown_with,
)
from bayes_tyre.inference.motion.record.model.window import make_window
from bayes_tyre.rig.axle import SecondMode as SecondModeOfRig
from bayes_tyre.rig.motion import Motion
from bayes_tyre.simulate.plan import quick_plan
from bayes_tyre.studies.motion_machine import Machine
from bayes_tyre.studies.motion_study import ROLLING

DT_S = 2.5e-4
MODE = SecondMode(jnp.asarray(60.0), jnp.asarray(0.02), jnp.asarray(0.3))


def moving(acceleration):
    """Return a motion with this acceleration (m/s^2), whose displacement and velocity are 0."""
    still = jnp.zeros_like(acceleration)
    return Motion(still, still, acceleration, still)


def test_the_sensors_show_a_driven_oscillator():
    def accelerates(t):
        return np.exp(-8 * t) * np.sin(2 * np.pi * 12 * t)

    time_s = np.arange(0, 0.3, DT_S)
    omega = 2 * np.pi * 60.0

    def rate(t, state):
        return [state[1], -300.0 * accelerates(t) - 2 * 0.02 * omega * state[1] - omega**2 * state[0]]

    bend, speed = solve_ivp(rate, (0, 0.3), [0.0, 0.0], t_eval=time_s, rtol=1e-10, atol=1e-12).y
    shown = shown_with(MODE, moving(jnp.asarray(accelerates(time_s))), DT_S)
    # The trapezoidal rule is off by the square of 0.09 radians a node, over 12: 0.07 % of what is driven.
    for values, expected in ((shown.displacement_mm, bend), (shown.velocity_mm_per_s, speed)):
        np.testing.assert_allclose(values, expected, atol=0.01 * np.abs(expected).max())
    bending = [rate(t, state)[1] for t, state in zip(time_s, np.stack([bend, speed], axis=1), strict=True)]
    added = 1e3 * (np.asarray(shown.acceleration_m_per_s2) - accelerates(time_s))
    np.testing.assert_allclose(added, bending, atol=0.01 * np.abs(bending).max())


def test_without_a_share_the_sensors_show_the_axle():
    motion = moving(jnp.asarray(np.random.default_rng(3).standard_normal(100)))
    shown = shown_with(MODE._replace(share=jnp.zeros(())), motion, DT_S)
    for name in ("displacement_mm", "velocity_mm_per_s", "acceleration_m_per_s2"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(motion, name))


def test_a_peak_is_found_where_it_is_and_white_residuals_show_none():
    time_s = 5e-4 * np.arange(1100)
    # Seventy independent powers, each above 30 in e^-30 of seeds, in each of 20.
    white = np.random.default_rng(1).standard_normal((20, 1100))
    power = jax.vmap(lambda residual: largest_peak(residual, 5e-4)[1])(jnp.asarray(white))
    assert (np.asarray(power) < SHOWS).all()
    frequency, power = largest_peak(jnp.asarray(white[0] + np.sin(2 * np.pi * 45 * time_s)), 5e-4)
    assert float(frequency) == pytest.approx(45, abs=1)
    assert float(power) > SHOWS


@pytest.mark.slow
@pytest.mark.usefixtures("fully_compiled")
def test_a_beam_that_bends_is_found_and_k_is_right_all_the_same():
    machine = Machine(beam_Hz=45.0, beam_share=0.2)
    truth, rig, record = simulated_on(machine, 3)
    estimate = estimate_motion(rig, record, sampler=None)
    window, found = estimate.window, estimate.map_estimate
    mode = in_units(rig, jnp.asarray(found.standard), window.prior).mode
    assert mode is not None
    assert float(mode.frequency_Hz) == pytest.approx(machine.beam_Hz, rel=0.01)
    assert float(mode.share) == pytest.approx(machine.beam_share, rel=0.05)
    # Five normal numbers: one beyond 4 standard deviations in 0.03 % of seeds.
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm, truth.m_kg, truth.c_kN_s_per_mm])
    assert np.all(np.abs(estimate.log_mean - logs) < 4 * np.sqrt(np.diag(estimate.log_covariance)))


def test_a_mode_that_the_rig_file_states_is_fitted_from_the_beginning():
    _, record = recorded(quick_plan()[0], seed=7)
    stated = RIG.model_copy(update={"second_mode": SecondModeOfRig(frequency_Hz=47.0)})
    prior, without = (np.asarray(make_window(rig, record).prior) for rig in (stated, RIG))
    np.testing.assert_array_equal(prior[:, :-3], without)
    assert prior[:, -3].tolist() == [np.log(47.0), 0.1]
    assert in_units(stated, jnp.zeros(prior.shape[1]), prior).mode is not None


@pytest.mark.parametrize("law", [FANCHER, MOTION_LAWS["relaxing"]], ids=lambda law: law.name)
def test_parameters_of_a_rolling_record_are_its_laws_its_grounds_and_then_a_modes(law):
    _, rig, record = simulated_on(Machine(), 0, kind=ROLLING)
    window = make_window(rig, record, law)
    extended = window.with_mode(60.0)
    assert extended.prior.shape[1] == window.prior.shape[1] + 3
    standard = np.random.default_rng(4).standard_normal(extended.prior.shape[1])
    parameters, without = (
        each.in_units(rig, jnp.asarray(standard[: each.prior.shape[1]])) for each in (extended, window)
    )
    assert without.mode is None
    assert parameters.mode is not None
    assert float(parameters.mode.frequency_Hz) == pytest.approx(60.0 * np.exp(0.05 * standard[-3]))
    for one, other in zip(jax.tree.leaves(parameters.ground), jax.tree.leaves(without.ground), strict=True):
        np.testing.assert_array_equal(one, other)
    stated = rig.model_copy(update={"second_mode": SecondModeOfRig(frequency_Hz=47.0)})
    assert make_window(stated, record, law).prior.shape == extended.prior.shape


def test_a_line_is_found_among_waves_of_a_road_and_waves_alone_have_none():
    rng, time_s = np.random.default_rng(5), 1e-3 * np.arange(1500)
    # A spectrum that falls with the square of the frequency, as what a road leaves: sums of white noise.
    roads = np.cumsum(rng.standard_normal((40, 1500)), axis=1)
    # Some 190 exponential powers in each of 40, of which the taper leaves a third independent, above 20 times their
    # mean: 5e-6 of seeds; the mean changes by a factor of 4 among neighbours.
    assert max(largest_line(road, 1e-3)[1] for road in roads) < SHOWS_ON_ROAD
    frequency, power = largest_line(roads[0] + 3 * np.sin(2 * np.pi * 60 * time_s), 1e-3)
    assert frequency == pytest.approx(60, abs=1)
    assert power > SHOWS_ON_ROAD


@pytest.mark.slow
@pytest.mark.usefixtures("fully_compiled")
def test_a_beam_that_bends_under_a_rolling_tyre_is_found_and_k_is_right_all_the_same():
    """Without the mode the road is taken for what shakes the sensors, and k is off by tens of per cent."""
    truth, rig, record = simulated_on(Machine(beam_share=0.3), 0, kind=ROLLING)
    estimate = estimate_motion(rig, record, sampler=None)
    mode = estimate.window.in_units(rig, jnp.asarray(estimate.map_estimate.standard)).mode
    assert mode is not None
    assert float(mode.frequency_Hz) == pytest.approx(60.0, rel=0.01)
    # The noise of the road takes part of it up: the share is some quarter too small, which k, x and beta are not.
    assert 0.15 < float(mode.share) < 0.35
    # Three normal numbers: one beyond 4 standard deviations in 0.02 % of seeds.
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm])
    assert np.all(np.abs(estimate.log_mean[:3] - logs) < 4 * np.sqrt(np.diag(estimate.log_covariance)[:3]))
