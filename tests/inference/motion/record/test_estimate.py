"""Tyre, mass and damping from the motion of simulated records; whether the check of Laplace's normal sees."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.map_estimates import map_estimate
from helpers.mismatched_motions import simulated_on
from helpers.recorded_motions import RIG, recorded
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST
from bayes_tyre.inference.motion.laws import FANCHER
from bayes_tyre.inference.motion.record.estimate import estimate_motion
from bayes_tyre.inference.motion.record.importance_sampling import weighted_draws
from bayes_tyre.inference.motion.record.map_fit import CORRELATION_MOST, starting_points, value_and_jacobian
from bayes_tyre.inference.motion.record.model.forward_model import residuals
from bayes_tyre.inference.motion.record.model.load_step import SHAPE_TERMS, load_share
from bayes_tyre.inference.motion.record.model.parameters import in_units, parameter_names, prior_moments
from bayes_tyre.inference.motion.record.model.window import Recorded, block_weights, make_window
from bayes_tyre.simulate.drive import SHAPES
from bayes_tyre.simulate.plan import quick_plan
from bayes_tyre.studies.motion_machine import Machine

NAMES = parameter_names(FANCHER)

pytestmark = pytest.mark.usefixtures("fully_compiled")


@pytest.fixture(scope="module")
def fitted():
    """Four stationary records of one axle, 10 kN up and down, fitted."""
    plans = [plan for plan in quick_plan() if plan.case.configuration == "single" and plan.repeat == 1]
    pairs = [recorded(plan, seed=7) for plan in plans]
    return [(truth, estimate_motion(RIG, record)) for truth, record in pairs]


@pytest.mark.slow
def test_parameters_come_back(fitted):
    logs = [np.log([t.k_kN_per_mm, t.x_kN, t.beta_mm, t.m_kg, t.c_kN_s_per_mm]) for t, _ in fitted]
    off = np.array([estimate.log_mean for _, estimate in fitted]) - logs
    sd = np.array([np.sqrt(np.diag(estimate.log_covariance)) for _, estimate in fitted])
    assert all(estimate.map_estimate.converged for _, estimate in fitted)
    # The model is the simulator's: nothing may be said against it.
    assert [(estimate.method, estimate.status) for _, estimate in fitted] == [("importance", "")] * len(fitted)
    # 20 normal numbers, some correlated: one of them beyond 4 standard deviations in 0.13 % of seeds at most.
    assert np.all(np.abs(off) < 4 * sd)
    # The targets: k within 0.5 %, x and beta within 3 %, root mean square.
    assert np.all(np.sqrt(np.mean(off[:, :3] ** 2, axis=0)) < [0.005, 0.03, 0.03])
    # And the intervals say as much: no parameter's error is claimed larger than the target.
    assert np.all(sd[:, :3] < [0.005, 0.03, 0.03])


@pytest.mark.slow
@pytest.mark.parametrize(("channel", "delay"), [("laser_mm", "laser_delay_s"), ("load_kN", "load_delay_s")])
def test_a_sensor_that_reads_late_is_found_out(channel, delay):
    late_s = 2e-3
    plan = next(plan for plan in quick_plan() if plan.case.configuration == "single" and plan.repeat == 1)
    truth, record = recorded(plan, seed=7)
    samples = round(late_s / record.dt_s)
    before = getattr(record, channel)
    shown = np.concatenate([before[:samples], before[:-samples]])
    estimate = estimate_motion(RIG, record._replace(**{channel: shown}), sampler=None)
    window, found = estimate.window, estimate.map_estimate
    unknowns = in_units(RIG, jnp.asarray(found.standard), window.prior)
    assert estimate.status == ""
    place = NAMES.index(delay)
    sd_s = np.asarray(window.prior)[1, place] * np.sqrt(found.covariance[place, place])
    assert sd_s < 0.2 * late_s
    # A laser that is only late is off by 1 %, as it is taken to filter too.
    assert abs(getattr(unknowns, delay) - late_s) < 4 * sd_s + 0.01 * late_s
    # Six normal numbers: one beyond 4 standard deviations in 0.04 % of seeds.
    logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm, truth.m_kg, truth.c_kN_s_per_mm])
    assert np.all(np.abs(estimate.log_mean - logs) < 4 * np.sqrt(np.diag(estimate.log_covariance)))


@pytest.mark.slow
def test_95_per_cent_intervals_hold_the_truth(fitted):
    inside = []
    for truth, estimate in fitted:
        logs = np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm, truth.m_kg, truth.c_kN_s_per_mm])
        off = logs - estimate.log_mean
        inside.append(off @ np.linalg.solve(estimate.log_covariance, off) < stats.chi2.ppf(0.95, len(off)))
    # Of four records two and more outside the 95 % region of all five: 1.4 % of seeds.
    assert sum(inside) >= len(inside) - 1


@pytest.mark.slow
def test_the_check_passes_a_good_fit_and_tells_bad_ones(fitted):
    _, estimate = fitted[0]
    window, found = estimate.window, estimate.map_estimate
    sd = np.sqrt(np.diag(found.covariance))
    assert weighted_draws(RIG, found.standard, found.covariance, window).trusted
    assert not weighted_draws(RIG, found.standard, 16 * found.covariance, window).trusted
    assert not weighted_draws(RIG, found.standard + 5 * sd, found.covariance, window).trusted


@pytest.mark.slow
def test_the_check_tells_a_covariance_that_is_too_narrow(fitted):
    # Without data the posterior is the prior, normal(0, 1): what Laplace should say is known exactly.
    window = fitted[0][1].window
    blind = window._replace(weight=0 * window.weight)
    peak, unit = np.zeros(len(NAMES)), np.eye(len(NAMES))
    assert weighted_draws(RIG, peak, unit, blind).pareto_k < PARETO_K_MOST
    # A little too narrow, later rounds of draws follow the weights of the first; much too narrow, they cannot.
    assert weighted_draws(RIG, peak, 0.6 * unit, blind).trusted
    assert weighted_draws(RIG, peak, 0.1 * unit, blind).pareto_k > PARETO_K_MOST
    assert np.isnan(weighted_draws(RIG, peak, -unit, blind).pareto_k)


@pytest.mark.slow
def test_weighed_draws_are_the_posterior_where_it_is_known(fitted):
    window = fitted[0][1].window
    blind = window._replace(weight=0 * window.weight)
    weighted = weighted_draws(RIG, np.zeros(len(NAMES)), 1.2 * np.eye(len(NAMES)), blind)
    mean = weighted.weights @ weighted.standard
    variance = weighted.weights @ weighted.standard**2
    # Some 200 effective draws of 17 normal numbers: standard errors 0.07 and 0.1; 34 comparisons at 4.5 of them err
    # in 0.03 % of seeds.
    assert np.all(np.abs(mean) < 4.5 / np.sqrt(weighted.effective))
    assert np.all(np.abs(variance - 1) < 4.5 * np.sqrt(2 / weighted.effective))


@pytest.mark.slow
def test_jacobian_is_that_of_finite_differences(fitted):
    window = fitted[0][1].window
    start = starting_points(RIG, window)[0]
    rng = np.random.default_rng(3)
    direction = rng.standard_normal(len(NAMES))
    step = 1e-5
    run = jax.jit(lambda y: residuals(RIG, y, window))
    differences = (run(start + step * direction) - run(start - step * direction)) / (2 * step)
    _, jacobian = jax.jit(lambda y: value_and_jacobian(RIG, y, window))(start)
    analytic = jacobian @ direction
    # Friction bends where the motion turns: second order in the step there, and a few blocks only.
    assert np.abs(differences - analytic).max() < 1e-3 * np.abs(analytic).max()


@given(st.lists(st.floats(-6, 6), min_size=len(NAMES), max_size=len(NAMES)))
@settings(max_examples=50)
def test_friction_always_exceeds_k_beta(standard):
    known = {name: (1.0, 1.0) for name in NAMES if "load" in name or "rest_mm" in name or "offset" in name}
    prior = prior_moments(RIG, known | {"ramp_start_s": (0.05, np.nan), "log_rise": (-3.0, np.nan)})
    parameters = in_units(RIG, jnp.array(standard), prior)
    law = parameters.law
    assert jnp.asarray(law.x) > law.k * law.beta
    assert abs(float(parameters.rest_friction_kN)) <= float(jnp.asarray(law.x) - law.k * law.beta) * (1 + 1e-9)


@pytest.mark.parametrize(("name", "shape"), [("raised cosine", (0.0, 0.0)), ("minimum jerk", (0.226, 0.247))])
def test_known_shapes_of_the_load_are_in_the_family(name, shape):
    s = np.linspace(-0.5, 1.5, 401)
    start, rise = (0.0, 1.0) if name == "raised cosine" else (0.018, np.exp(-0.034))
    share = load_share(jnp.asarray(s), start, rise, jnp.append(jnp.asarray(shape), jnp.zeros(SHAPE_TERMS - 2)))
    assert np.abs(share - SHAPES[name](np.clip(s, 0, 1))).max() < 6e-4


@pytest.mark.parametrize(("length", "substeps"), [(1, 1), (1, 2), (5, 1), (4, 3)])
def test_block_weights_give_the_mean_of_samples_of_a_parabola(length, substeps):
    def parabola(t):
        return 2.0 - 3.0 * t + 5.0 * t**2

    nodes = np.linspace(0, 1, 2 * substeps + 1)
    samples = (np.arange(length) + 0.5) / length
    weights = block_weights(length, substeps)
    assert weights @ parabola(nodes) == pytest.approx(parabola(samples).mean(), rel=1e-12)


def test_a_short_recording_leaves_blocks_without_weight():
    _, record = recorded(next(p for p in quick_plan() if p.case.configuration == "single"), seed=7)
    end = round((record.ramp_s[0] + 0.3) / record.dt_s)
    cut = record._replace(**{name: getattr(record, name)[:end] for name in Recorded._fields[1:4]})
    whole, short = make_window(RIG, record), make_window(RIG, cut)
    assert short.readings.shape == whole.readings.shape
    full = np.flatnonzero(short.weight[0])
    assert 0 < len(full) < whole.readings.shape[1]
    assert np.array_equal(full, np.arange(len(full)))
    np.testing.assert_array_equal(short.readings[:, full], whole.readings[:, full])


def test_what_a_converter_rounds_alike_is_no_misfit():
    found = map_estimate(np.zeros(1), np.eye(1))._replace(
        chi_squared=jnp.array([1.0, 0.8, 1.4]), correlation=jnp.array([0.1, 0.7, 0.1])
    )
    assert found.misfits.tolist() == [False, True, True]
    assert found._replace(rounding=jnp.array([0.0, 0.97, 0.0])).misfits.tolist() == [False, False, True]


@pytest.mark.slow
def test_a_laser_whose_noise_is_below_its_converter_s_step_is_not_doubted():
    """At rest it shows one level; on the way its rounding is alike from block to block."""
    truth, rig, record = simulated_on(Machine(), 0, lambda truth, _: replace(truth, noise_displacement_mm=1e-4))
    assert len(np.unique(record.laser_mm[: record.pre_step].round(6))) == 1
    found = estimate_motion(rig, record, sampler=None)
    assert found.map_estimate.correlation[1] > CORRELATION_MOST
    assert found.status == ""
    off = found.log_mean[:3] - np.log([truth.k_kN_per_mm, truth.x_kN, truth.beta_mm])
    # Three normal numbers: one beyond 4 standard deviations in 2e-4 of seeds.
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(found.log_covariance)[:3]))
