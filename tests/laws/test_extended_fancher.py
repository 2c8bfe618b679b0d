"""What each extension of Fancher's law is known to be, and all of them at once against the differential equations."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.law_in_time import force_in_time
from scipy.integrate import solve_ivp

from bayes_tyre.laws.extended_fancher import ExtendedFancher
from bayes_tyre.laws.fancher import Fancher

K, C, X, BETA = 1.8, 10.0, 0.3, 0.05
FANCHER, NONE = Fancher(k=K, C=C, x=X, beta=BETA), ExtendedFancher(k=K, C=C, x=X, beta=BETA)
SETTLED = X - K * BETA
PATH = np.cumsum(np.random.default_rng(0).normal(0.0, 0.1, 400))
DT_S = 1e-4


@pytest.mark.parametrize("start", [-0.35, 0.0, 0.3])
def test_without_extensions_it_is_fanchers_law_at_any_pace(start):
    F_start = K * PATH[0] + C + start
    expected = FANCHER.force(PATH, F_start)
    np.testing.assert_allclose(NONE.force(PATH, F_start), expected, rtol=0, atol=1e-11)
    np.testing.assert_allclose(force_in_time(NONE, PATH, F_start, DT_S), expected, rtol=0, atol=1e-11)


def test_a_branch_takes_up_a_steady_rate_and_then_relaxes():
    share, tau, speed = 0.08, 0.008, 20.0
    up = speed * DT_S * np.arange(401)
    still = np.full(200, up[-1])
    law = replace(NONE, relaxing_share=share, relaxation_s=tau)
    path = np.concatenate([up, still])
    beyond = force_in_time(law, path, C, DT_S) - force_in_time(NONE, path, C, DT_S)
    rising = share * K * speed * tau * -np.expm1(-DT_S * np.arange(401) / tau)
    falling = rising[-1] * np.exp(-DT_S * np.arange(1, 201) / tau)
    np.testing.assert_allclose(beyond, np.concatenate([rising, falling]), rtol=0, atol=1e-11)


@pytest.mark.parametrize("change", [-0.15, 0.2])
def test_friction_of_a_quick_move_settles_where_its_speed_says(change):
    speed = 50.0
    law = replace(NONE, friction_change=change, friction_speed_mm_per_s=30.0)
    path = speed * DT_S * np.arange(2001)
    friction = force_in_time(law, path, C, DT_S) - K * path - C
    expected = SETTLED * (1 + change * (1 - np.exp(-speed / 30.0)))
    assert friction[-1] == pytest.approx(expected, rel=1e-9)
    assert law.force(path, C)[-1] - K * path[-1] - C == pytest.approx(SETTLED, rel=1e-9)


def test_a_middle_line_that_bends_has_its_chord_at_the_ends_and_its_slope_half_way():
    law, d = replace(NONE, growth_per_mm=0.03, ends_mm=(4.0, 10.0)), np.array([4.0, 10.0, 7.0])
    line = np.array([law.middle_line(each) for each in d])
    np.testing.assert_allclose(line[:2], K * d[:2] + C, rtol=1e-14)
    slopes = [(law.middle_line(at + 1e-4) - law.middle_line(at - 1e-4)) / 2e-4 for at in (7.0, 8.0)]
    assert slopes == pytest.approx([K, 1.03 * K], rel=1e-9)


def test_two_yield_displacements_are_two_elements_side_by_side():
    law = replace(NONE, yield_spread=0.6)
    one, other = (Fancher(k=0.0, C=0.0, x=SETTLED / 2, beta=share * BETA).force(PATH, 0.05) for share in (0.4, 1.6))
    force = law.force(PATH, K * PATH[0] + C + 0.1)
    np.testing.assert_allclose(force, K * PATH + C + one + other, rtol=0, atol=1e-11)


def test_all_at_once_follow_the_differential_equations():
    """Displacement is given over time; forces by SciPy, with none of the law's closed forms."""
    share, tau, change, limit_speed, growth, spread, ends = 0.08, 0.008, -0.15, 30.0, 0.03, 0.6, (0.0, 3.0)
    law = replace(
        NONE,
        **{"relaxing_share": share, "relaxation_s": tau, "friction_change": change, "yield_spread": spread},
        **{"friction_speed_mm_per_s": limit_speed, "growth_per_mm": growth, "ends_mm": ends},
    )
    time_s = np.arange(0.0, 0.3, DT_S)

    def path(t):
        return 1.5 * (1 - np.cos(2 * np.pi * 8 * t)) * np.exp(-t / 0.2)

    def rate(t):
        return (path(t + 1e-6) - path(t - 1e-6)) / 2e-6

    def equations(t, state):
        branch, *elements = state
        v = rate(t)
        settled = SETTLED / 2 * (1 + change * (1 - np.exp(-abs(v) / limit_speed)))
        betas = BETA * (1 - spread), BETA * (1 + spread)
        moves = [(settled * v - abs(v) * h) / beta for h, beta in zip(elements, betas, strict=True)]
        return [share * K * v - branch / tau, *moves]

    solved = solve_ivp(equations, (0, time_s[-1]), [0.0, 0.0, 0.0], t_eval=time_s, rtol=1e-9, atol=1e-11, max_step=DT_S)
    d = path(time_s)
    line = K * d + C + 0.5 * K * growth * (d - ends[0]) * (d - ends[1])
    # A move's rate is its mean, so that between samples friction is off by what its speed changes: some 1e-4 of it.
    np.testing.assert_allclose(force_in_time(law, d, C, DT_S), line + solved.y.sum(axis=0), rtol=0, atol=2e-4)
