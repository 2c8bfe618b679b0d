"""A rolling record: its quiet stretch's harmonics, and tyre, mass and damping from its motion over the runout."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.mismatched_motions import simulated

from bayes_tyre.inference.motion.laws import FANCHER
from bayes_tyre.inference.motion.record.checks import DISCREPANCY_MOST
from bayes_tyre.inference.motion.record.disturbance.road_noise import road_noise_spectrum
from bayes_tyre.inference.motion.record.estimate import estimate_motion
from bayes_tyre.inference.motion.record.model.parameters import parameter_names
from bayes_tyre.inference.motion.record.model.pre_step_harmonics import fit_harmonics
from bayes_tyre.inference.motion.record.model.window import Recorded, make_window
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.signals.channels import find_channels
from bayes_tyre.signals.ramp import find_ramp
from bayes_tyre.signals.runout import nominal_bodies, remove_runout
from bayes_tyre.signals.steps import find_step, pre_step_samples
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.simulate.simulator import simulate_record
from bayes_tyre.studies.motion_study import ROLLING

pytestmark = pytest.mark.usefixtures("fully_compiled")

RIG = load_rig("single")


def test_harmonics_and_turns_of_a_quiet_stretch_come_back():
    rng, time_s = np.random.default_rng(4), np.arange(-3.0, 0.0, 2e-3)
    turn, amplitude = np.array([2.06, 8.28]), np.array([0.3 - 0.1j, 0.05j, -0.06 + 0.02j])
    omega = 2 * np.pi * np.array([turn[0], 2 * turn[0], turn[1]])
    moved = np.real(amplitude[:, None] * np.exp(1j * omega[:, None] * time_s))
    laser = 650.0 + moved.sum(axis=0) + 0.005 * rng.standard_normal(len(time_s))
    acceleration = 0.2 + 1e-3 * omega**2 @ moved + 0.01 * rng.standard_normal(len(time_s))
    fit = fit_harmonics(time_s, acceleration, laser, [(turn[0] * 1.001, 2), (turn[1] * 0.9995, 1)])
    # 1500 values a channel: standard errors of amplitudes 0.0002 mm, of levels 0.00013 mm and 0.00026 m/s^2, of turns
    # below 1e-4; eight comparisons at 5 of them: 5e-6 of seeds.
    np.testing.assert_allclose(fit.amplitude_mm, amplitude, atol=1e-3)
    np.testing.assert_allclose(fit.turn_Hz, turn, rtol=5e-4)
    assert fit.laser_mm[0] == pytest.approx(650.0, abs=6.5e-4)
    assert fit.acceleration_m_per_s2[0] == pytest.approx(0.2, abs=1.3e-3)


BLOCK_S, BLOCKS, PERIOD_S = 1e-3, 1500, 2.25
FREQUENCY = np.arange(91, 563) / PERIOD_S
#: Of the road's displacement, mm^2 Hz, and variance of the white noise, in the accelerometer's noise.
DENSITY, WHITE = 30.0, 0.7


def answers_of(stiffness: np.ndarray) -> np.ndarray:
    """Return the accelerometer's responses to cosines and sines of the road, times a stiffness in each block."""
    angle = 2 * np.pi * FREQUENCY * BLOCK_S * np.arange(BLOCKS)[:, None]
    waves = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    return stiffness[:, None] * waves / np.tile(FREQUENCY * np.sqrt(PERIOD_S), 2)


def road_and_noise(answers: np.ndarray, end_Hz: float, seed: int) -> np.ndarray:
    """Return what a fit leaves of the accelerometer: a road whose spectrum ends, and white noise."""
    rng = np.random.default_rng(seed)
    weights = np.sqrt(DENSITY) * rng.standard_normal(2 * len(FREQUENCY)) * np.tile(end_Hz >= FREQUENCY, 2)
    return np.sqrt(WHITE) * rng.standard_normal(BLOCKS) + answers @ weights


@pytest.mark.parametrize("end_Hz", [80.0, 150.0])
def test_white_noise_and_road_of_a_steady_tyre_come_back(end_Hz):
    answers, seeds = answers_of(np.ones(BLOCKS)), 20
    left = jnp.stack([road_and_noise(answers, end_Hz, seed) for seed in range(seeds)])
    estimate = jax.jit(jax.vmap(road_noise_spectrum, in_axes=(None, 0, None, None, None)))
    white, shares = map(np.asarray, estimate(BLOCK_S, left, answers, FREQUENCY, DENSITY))
    power = shares.sum(axis=1) / np.sum(end_Hz >= FREQUENCY)
    # The standard error of a mean over 20 seeds, from the seeds: Student's t with 19 degrees of freedom is beyond 4.2
    # in 5e-4 of cases. Ends are tried 4.7 % apart, which leaves up to half of that in either number.
    for mean, values in ((WHITE, white), (1.0, power)):
        error = values.std(ddof=1) / np.sqrt(seeds)
        assert values.mean() == pytest.approx(mean, abs=4.2 * error + 0.0235 * mean)
        assert error < 0.1 * mean
    # What is there and what is not lie on either side of a half.
    present, absent = end_Hz / 1.3 > FREQUENCY, 1.3 * end_Hz < FREQUENCY
    assert shares[:, absent].mean() < 0.5 < shares[:, present].mean()


@pytest.mark.parametrize("end_Hz", [80.0, 200.0])
def test_quick_road_that_is_larger_at_times_is_made_white(end_Hz):
    # As a tyre is that turns now and then: for a tenth of the time it answers with four times the force.
    answers = answers_of(np.where(np.arange(BLOCKS) % 100 < 10, 4.0, 1.0))
    left = road_and_noise(answers, end_Hz, 6)
    given = jnp.asarray(left), jnp.asarray(answers), jnp.asarray(FREQUENCY)
    white, shares = map(np.asarray, road_noise_spectrum(BLOCK_S, *given, DENSITY))
    covariance = white * np.eye(BLOCKS) + (answers * DENSITY * np.tile(shares, 2)) @ answers.T
    made_white = np.linalg.solve(np.linalg.cholesky(covariance), left)
    # Of 1500 white values the lag-1 autocorrelation has a standard deviation of 0.026: four of them.
    assert abs(np.corrcoef(made_white[1:], made_white[:-1])[0, 1]) < 4 / np.sqrt(BLOCKS)
    assert np.corrcoef(left[1:], left[:-1])[0, 1] > 0.3


@cache
def rolling_record():
    plan = next(p for p in thesis_plan() if p.record == "S(25)30-35(3)")
    truth = draw_truth(plan._replace(duration_s=6.0), RIG, 1)
    read = find_channels(simulate_record(truth, RIG).raw, RIG)
    pre_step = pre_step_samples(find_ramp(read.load_kN, read.dt_s), read)
    still, runout = remove_runout(read, pre_step, nominal_bodies(RIG, plan.case.speed_km_h))
    step = find_step(still)
    bodies = tuple((body.turn_Hz, body.harmonics) for body in runout.bodies)
    ramp_s = step.ramp.start_s, step.ramp.end_s
    return truth, Recorded(read.dt_s, *read[1:], pre_step=step.pre_step, ramp_s=ramp_s, bodies=bodies)


def test_a_rolling_window_has_an_unknown_for_every_name():
    _, record = rolling_record()
    window = make_window(RIG, record)
    harmonics = sum(harmonics for _, harmonics in record.bodies)
    # Displacement and velocity at the start, a turn for each body, a sine and a cosine for each harmonic.
    assert window.prior.shape[1] == len(parameter_names(FANCHER)) + 2 + len(record.bodies) + 2 * harmonics
    assert np.isfinite(window.prior).all()


@pytest.mark.slow
def test_parameters_of_a_rolling_loading_step_come_back():
    truth, record = rolling_record()
    estimate = estimate_motion(RIG, record)
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm, truth.m_kg, truth.c_kN_s_per_mm])
    off = estimate.log_mean - logs
    assert estimate.method == "importance"
    assert (estimate.discrepancy_share, estimate.load_departure_share) == (0.0, 0.0)
    # Five correlated normal numbers beyond 4 standard deviations: 0.03 % of seeds. The target: k within 1 %.
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(estimate.log_covariance)))
    assert abs(off[0]) < 0.01


@pytest.mark.slow
@pytest.mark.usefixtures("fully_compiled")
@pytest.mark.parametrize(("number", "shown_by"), [(0, "motion"), (2, "cell")])
def test_a_load_of_another_shape_is_found_beside_the_road(number, shown_by):
    """By the load cell; or where it is too coarse, as a force that the motion shows."""
    truth, rig, record = simulated("load in two stages", number, ROLLING)
    estimate = estimate_motion(rig, record, sampler=None)
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm])
    # Three correlated normal numbers beyond 3 standard deviations: at most 0.8 % of seeds, 1.6 % of the two.
    assert np.all(np.abs(estimate.log_mean[:3] - logs) < 3 * np.sqrt(np.diag(estimate.log_covariance)[:3]))
    by_cell = shown_by == "cell"
    assert (estimate.load_departure_share > 0, estimate.discrepancy_share > DISCREPANCY_MOST) == (by_cell, not by_cell)
    assert ("load and law leave out a force of" in estimate.status) == (not by_cell)
    # The force takes information, and most of that on what friction does just after the step's start.
    narrower = estimate.narrower_without_force[:3]
    assert np.all(narrower == 1.0) if by_cell else np.all((narrower > 0.0) & (narrower < 0.9))
    # The road is still there.
    assert estimate.window.disturbance is not None
    assert float(np.std(estimate.window.disturbance.mean.road_mm)) > 1e-4
