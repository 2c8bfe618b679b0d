"""A process between its knots: the interpolation, and the covariance that its factors have."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.recorded_motions import RIG, recorded

from bayes_tyre.inference.motion.record.disturbance.matern_process import (
    LAST_S,
    TIMES_S,
    correlation_factors,
    knots_from,
    sizes_and_penalties,
)
from bayes_tyre.inference.motion.record.model.forward_model import node_times
from bayes_tyre.inference.motion.record.model.window import make_window
from bayes_tyre.simulate.plan import quick_plan

START_S = 0.0603


@pytest.fixture(scope="module")
def window():
    plan = next(plan for plan in quick_plan() if plan.case.configuration == "single" and plan.repeat == 1)
    return make_window(RIG, recorded(plan, seed=7)[1])


def test_a_load_that_rings_is_known_between_the_knots(window):
    knots, time_s = knots_from(window, START_S), np.asarray(node_times(window))
    after = (time_s > START_S) & (time_s < START_S + LAST_S)

    def ringing(time_s):
        return np.sin(2 * np.pi * 18 * (time_s - START_S))

    between = np.asarray(ringing(knots.time_s) @ knots.functions)
    at = np.asarray(knots.time_s)
    straight = np.interp(time_s, np.append(START_S, at), np.append(0.0, ringing(at)))
    off, off_straight = (np.max(np.abs(each - ringing(time_s))[after]) for each in (between, straight))
    assert off < off_straight / 2
    assert np.all(between[time_s <= START_S] == 0)
    assert between[time_s > START_S + LAST_S] == pytest.approx(ringing(knots.time_s[-1]))


def test_a_line_is_kept(window):
    knots, time_s = knots_from(window, START_S), np.asarray(node_times(window))
    line = np.asarray((knots.time_s - START_S) @ knots.functions)
    assert line == pytest.approx(np.clip(time_s - START_S, 0, LAST_S), abs=1e-12)


def test_knots_are_correlated_as_matern_s_process(window):
    knots = knots_from(window, START_S)
    apart = np.abs(np.subtract.outer(knots.time_s, knots.time_s))
    for factor, time_s in zip(correlation_factors(knots), TIMES_S, strict=True):
        scaled = np.sqrt(3) * apart / time_s
        assert np.asarray(factor @ factor.T) == pytest.approx((1 + scaled) * np.exp(-scaled), abs=2e-9)


def test_no_process_costs_nothing_and_a_larger_one_more(window):
    sizes, penalties = sizes_and_penalties()
    assert (sizes[0], penalties[0]) == (0, 0)
    assert jnp.all(jnp.diff(penalties) > 0)
