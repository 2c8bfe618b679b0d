"""What drives the axle: the load's step, and the runout with the frequencies it should have."""

from dataclasses import replace

import numpy as np
import pytest

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.drive import SHAPES, WARM_UP_S, cylinder_load, runout
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.simulate.truth import Truth

RIG = load_rig("single")


def truth_at(speed_km_h: float) -> Truth:
    plan = next(record for record in thesis_plan() if record.case.speed_km_h == speed_km_h)
    return draw_truth(plan, RIG, 3)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_rises_once_from_0_to_1(shape):
    s = np.linspace(0, 1, 101)
    values = SHAPES[shape](s)
    np.testing.assert_allclose(values[[0, -1]], [0, 1], atol=1e-15)
    assert np.all(np.diff(values) > 0)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_load_steps_when_and_as_long_as_it_says(shape):
    truth = replace(truth_at(0.0), load_shape=shape)
    start, end = truth.step_start_s, truth.step_start_s + truth.rise_time_s
    times = np.array([0.0, start, start + 1e-3, end - 1e-3, end, 15.0])
    load = cylinder_load(truth, times)
    np.testing.assert_allclose(load[[0, 1]], truth.load_before_kN, rtol=1e-12)
    np.testing.assert_allclose(load[[4, 5]], truth.load_after_kN, rtol=1e-12)
    assert truth.load_before_kN < load[2] < load[3] < truth.load_after_kN


def left_over(truth: Truth, factor: float) -> float:
    """Return the standard deviation, mm, that sines at `factor` times the turning frequencies leave of the runout."""
    time_s = np.arange(15_000) / 1000
    v = truth.plan.case.speed_km_h / 3.6
    wheel, roller = v / (2 * np.pi * 0.536), v / (2 * np.pi * 0.1335)
    phases = [2 * np.pi * f * factor * time_s for f in (wheel, 2 * wheel, 3 * wheel, roller, 2 * roller)]
    design = np.column_stack([np.ones_like(time_s), *map(np.sin, phases), *map(np.cos, phases)])
    values = runout(truth, time_s)
    return float(np.std(values - design @ np.linalg.lstsq(design, values)[0]))


@pytest.mark.parametrize("speed", [15.0, 25.0, 35.0])
def test_the_runout_turns_with_wheel_and_rollers_and_the_rest_is_road(speed):
    truth = truth_at(speed)
    right = left_over(truth, 1.0)
    # The road is strongest at 1 Hz, of which 15 s hold few waves; and the sines take some of it along.
    assert right == pytest.approx(truth.runout.road_noise_mm, rel=0.3)
    assert left_over(truth, 1.005) > 3 * right


def test_the_amplitudes_are_those_of_the_truth():
    truth = truth_at(25.0)
    quiet = replace(truth, runout=truth.runout._replace(road_noise_mm=0.0))
    turns = 2 * np.pi * truth.runout.roller_turn_Hz
    (a1, p1), (a2, p2) = truth.runout.roller_harmonics
    time_s = np.linspace(0, 3, 501)
    wheel = replace(quiet, runout=quiet.runout._replace(roller_harmonics=()))
    roller = a1 * np.sin(turns * time_s + p1) + a2 * np.sin(2 * turns * time_s + p2)
    np.testing.assert_allclose(runout(quiet, time_s) - runout(wheel, time_s), roller, atol=1e-14)


def test_the_runout_is_one_function_of_time_and_begins_at_nothing():
    truth = truth_at(35.0)
    fast = np.arange(-10_000, 20_000) / 5000
    np.testing.assert_array_equal(runout(truth, fast)[::5], runout(truth, fast[::5]))
    assert runout(truth, np.array([-WARM_UP_S]))[0] == 0
    assert not np.any(runout(truth_at(0.0), fast))
