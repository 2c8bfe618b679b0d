"""Lines, digitiser steps and lost signs, on made data with known answers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.rig.calibration import Line, fit_line, mend_signs, quantisation_step, residual_rms, with_best_signs


def test_a_line_is_returned_with_its_digits():
    rng = np.random.default_rng(0)
    volts = 3.487 + 0.004 * rng.standard_normal(500)
    line = fit_line(volts, Line(10.0421, -35.0137)(volts))
    assert line.slope == pytest.approx(10.0421, rel=1e-10)
    assert line.intercept == pytest.approx(-35.0137, rel=1e-10)
    noisy = Line(10.0, -35.0)(volts) + rng.normal(0, 0.01, 500)
    np.testing.assert_allclose(fit_line(volts, noisy), np.polyfit(volts, noisy, 1), rtol=1e-9)


def test_one_voltage_is_no_line():
    with pytest.raises(ValueError, match="two unlike"):
        fit_line(np.array([1.0, 1.0]), np.array([2.0, 3.0]))


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.floats(0.0001, 0.01))
def test_the_step_comes_back_through_rounding(seed, step):
    levels = np.random.default_rng(seed).choice(60, size=200)
    printed = np.round(0.46 + step * levels, 6)
    assert quantisation_step(printed) == pytest.approx(step, rel=2e-3)


def test_a_constant_has_no_step():
    with pytest.raises(ValueError, match="unlike"):
        quantisation_step(np.full(5, 1.0))


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.integers(0, 12))
def test_lost_signs_come_back(seed, negatives):
    rng = np.random.default_rng(seed)
    values = np.concatenate([-rng.uniform(0.01, 1.0, negatives), rng.uniform(0.01, 1.0, 20)])
    volts = (values + 35.0) / 10.0
    order = rng.permutation(len(values))
    np.testing.assert_array_equal(mend_signs(volts[order], np.abs(values[order])), values[order])


def test_signs_that_were_never_lost_stay():
    values = np.array([-2.0, -1.0, 0.5, 3.0])
    np.testing.assert_array_equal(mend_signs(values / 10, values), values)
    with pytest.raises(ValueError, match="three or more"):
        mend_signs(np.array([1.0, 2.0]), np.array([1.0, 2.0]))


def test_signs_are_mended_only_where_that_brings_the_values_to_a_line():
    volts = np.linspace(0.0, 1.0, 41)
    rising, falling = Line(5.0, -2.0)(volts), Line(-5.0, 7.0)(volts)
    np.testing.assert_array_equal(with_best_signs(volts, np.abs(rising)), rising)
    np.testing.assert_array_equal(with_best_signs(volts, falling), falling)
    assert residual_rms(Line(5.0, -2.0), volts, rising + 0.5) == pytest.approx(0.5)


def test_150_000_unlike_voltages_take_no_time():
    """A place for the sign is tried between all of them; each with a fit of its own would take minutes."""
    volts = 3.487 + 0.004 * np.random.default_rng(0).standard_normal(150_000)
    values = Line(10.0421, -35.0137)(volts)
    np.testing.assert_array_equal(mend_signs(volts, np.abs(values)), values)
