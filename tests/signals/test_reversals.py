"""Curves cut at reversals: noise makes no branch, branches give the curve back, thresholds, closed cycles, tables."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.record_table import check_record_table
from bayes_tyre.signals.reversals import closed_cycles, cut_at_reversals, cut_loops, reversal_threshold

curves = st.lists(st.integers(-40, 40), min_size=1, max_size=80).map(lambda each: np.array(each, float))
thresholds = st.integers(0, 30).map(float)


def triangle(turns: list[float], step: float) -> np.ndarray:
    """Return a path between turning points in even steps, each turning point once."""
    parts = [np.linspace(a, b, round(abs(b - a) / step) + 1)[1:] for a, b in pairwise(turns)]
    return np.concatenate([[turns[0]], *parts])


def turns_of(d: np.ndarray, branches: list[slice]) -> list[float]:
    return [*(float(d[rows][0]) for rows in branches), float(d[-1])]


@settings(max_examples=100)
@given(curves, thresholds)
def test_branches_joined_give_the_curve_back(d, threshold):
    first, *others = [d[rows] for rows in cut_at_reversals(d, threshold)]
    assert np.array_equal(np.concatenate([first, *(branch[1:] for branch in others)]), d)
    assert all(before[-1] == after[0] for before, after in pairwise([first, *others]))


@settings(max_examples=100)
@given(curves, thresholds)
def test_a_curve_of_the_other_sign_has_the_same_branches_in_the_other_direction(d, threshold):
    branches = cut_at_reversals(d, threshold)
    assert cut_at_reversals(-d, threshold) == branches
    ways = [np.sign(d[rows][-1] - d[rows][0]) for rows in branches]
    assert all(before == -after != 0 for before, after in pairwise(ways))


@settings(max_examples=100)
@given(curves, thresholds)
def test_no_branch_turns_back_by_more_than_the_threshold_and_each_moves_on_by_more(d, threshold):
    branches = [d[rows] for rows in cut_at_reversals(d, threshold)]
    for branch in branches:
        way = np.sign(branch[-1] - branch[0])
        assert (np.maximum.accumulate(way * branch) - way * branch).max() <= threshold
        assert len(branches) == 1 or np.ptp(branch) > threshold


@settings(max_examples=100)
@given(st.lists(st.floats(0.0, 3.0), min_size=2, max_size=60), st.integers(0, 2**32 - 1), st.floats(0.01, 5.0))
def test_noise_below_the_threshold_makes_no_branch(steps, seed, threshold):
    noise = 0.499 * threshold * np.random.default_rng(seed).uniform(-1.0, 1.0, len(steps))
    assert len(cut_at_reversals(np.cumsum(steps) + noise, threshold)) == 1


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("step", [0.05, 0.5, 2.5])
def test_the_threshold_tells_reversals_from_noise(noise, step):
    """Noise of up to 0.8 % of the travel; branches of 3 to 240 steps."""
    turns = [0.0, 10.0, 1.5, 8.0, -2.0, 10.0]
    d = triangle(turns, step)
    if noise:
        d = d + noise * np.random.default_rng(7).normal(size=len(d))
    found = turns_of(d, cut_at_reversals(d, reversal_threshold(d)))
    # Over the noise of the five turning points: more than 5 sds come up less than once in a million.
    assert found == pytest.approx(turns, abs=5 * noise + 1e-12)


def test_a_converter_s_steps_and_a_hold_make_no_branch():
    slow = np.concatenate([np.zeros(200), 5.0 * (1.0 - np.cos(np.linspace(0, 4 * np.pi, 2000))), np.zeros(200)])
    rounded = np.round((slow + 0.03 * np.random.default_rng(3).normal(size=len(slow))) / 0.1) * 0.1
    assert len(cut_at_reversals(rounded, reversal_threshold(rounded))) == 4
    held = np.array([1.0, 1.0, 1.0])
    assert reversal_threshold(held) == 0.0
    assert cut_at_reversals(held, 0.0) == [slice(0, 3)]


@pytest.mark.parametrize(
    ("turns", "cycles"),
    [
        ([0, 10, 0, 10, 0], [0, 2]),
        ([10, 0, 10, 0], [0]),
        ([0, 5, -5, 6, -6, 7], [1, 3]),  # from the middle: the way to the first reversal belongs to none
        ([0, 40, 30, 40, 0], [1]),  # a small cycle within a large one, whose branches it interrupts
        ([0, 10, 8, 18, 16], []),
        ([0, 10], []),
    ],
)
def test_cycles_end_near_where_they_begin(turns, cycles):
    d = triangle([float(turn) for turn in turns], 1.0)
    assert closed_cycles(d, cut_at_reversals(d, 1.5)) == cycles


def test_a_table_of_curves_becomes_one_of_branches():
    d = triangle([0.0, 5.0, -5.0, 5.0, -5.0, -1.0], 0.5)
    curve = pd.DataFrame({"record": "a", "displacement_mm": d, "force_kN": 2 * d, "cycle": 7, "speed_km_h": 15.0})
    still = pd.DataFrame({"record": "b", "displacement_mm": [1.0, 1.0], "force_kN": 3.0, "cycle": 8, "speed_km_h": 0.0})
    cut = cut_loops(check_record_table(pd.concat([curve, still])))
    first = cut.drop_duplicates("record").set_index("record")
    assert list(first.index) == ["a 1", "a 2", "a 3", "a 4", "a 5", "b 1"]
    assert list(first["direction"]) == ["loading", "unloading"] * 2 + ["loading"] * 2
    assert list(first["loop"]) == ["a"] * 5 + ["b"]
    assert list(first["branch"]) == [1, 2, 3, 4, 5, 1]
    assert list(first["cycle"]) == [0, 1, 1, 0, 0, 0]
    assert list(first["given_cycle"]) == [7.0] * 5 + [8.0]
    assert len(cut) == len(d) + 2 + 4  # each turning point twice
    check_record_table(cut)
