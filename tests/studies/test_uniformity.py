"""Uniform ranks pass; shifted, narrow and wide posteriors do not; coverage is counted right."""

import numpy as np
import pytest
from arviz_stats.ecdf_utils import ecdf_pit
from scipy.stats import binom, kstest

from bayes_tyre.studies.uniformity import band, coverage, deviation_p_value, pit, ranks, uniformity_table

KEPT = 39


def ranked(sets: int, rng: np.random.Generator, shift: float = 0.0, widen: float = 1.0) -> np.ndarray:
    """Return ranks of standard normal truths among draws of a normal that may lie or spread wrongly."""
    return ranks(rng.standard_normal(sets), shift + widen * rng.standard_normal((sets, KEPT)), rng)


def test_ranks_count_the_draws_below_and_share_out_ties():
    rng = np.random.default_rng(0)
    draws = np.tile(np.arange(4.0), (1000, 1))
    np.testing.assert_array_equal(ranks(np.full(1000, 1.5), draws, rng), 2)
    np.testing.assert_array_equal(ranks(np.full(1000, 9.0), draws, rng), 4)
    assert set(ranks(np.full(1000, 1.0), draws, rng)) == {1, 2}


def test_p_values_of_right_posteriors_are_uniform():
    rng = np.random.default_rng(1)
    p_values = [deviation_p_value(pit(ranked(100, rng), KEPT, rng)) for _ in range(200)]
    # Kolmogorov-Smirnov on 200 values: false alarm 0.1 % (ties of the simulated null make it conservative).
    assert kstest(p_values, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("wrong", [{"shift": 0.5}, {"widen": 0.6}, {"widen": 1.7}], ids=["high", "narrow", "wide"])
def test_wrong_posteriors_are_found(wrong):
    rng = np.random.default_rng(2)
    table = uniformity_table({"right": ranked(200, rng), "wrong": ranked(200, rng, **wrong)}, KEPT)
    # `right` is called wrong with probability 2.5 %: not with this seed.
    assert table["calibrated"].tolist() == [True, False]


def test_coverage_is_that_of_the_interval_between_two_draws():
    every = np.arange(KEPT + 1)
    for interval in (0.5, 0.8, 0.95):
        share, lower, upper = coverage(every, KEPT, interval)
        assert share == pytest.approx(interval)
        assert lower < share < upper
    rng = np.random.default_rng(3)
    narrow = coverage(ranked(400, rng, widen=0.5), KEPT, 0.95)
    assert narrow[2] < 0.95


def test_the_band_holds_uniform_ranks_as_often_as_it_says():
    at, lower, upper = band(50, 0.9)
    rng = np.random.default_rng(4)
    values = np.sort(rng.random((1000, 50)), axis=1)
    excess = np.stack([np.searchsorted(row, at, side="right") for row in values]) / 50 - at
    inside = int(((lower <= excess) & (excess <= upper)).all(axis=1).sum())
    # 1000 sets, and the band itself from 10 000: outside 86 to 94 % with probability below 1e-4.
    assert binom.cdf(859, 1000, 0.9) + binom.sf(940, 1000, 0.9) < 1e-4
    assert 860 <= inside <= 940


def test_the_band_is_that_of_arviz():
    at, lower, upper = band(60, 0.95)
    theirs = ecdf_pit(np.linspace(0.01, 0.99, 60), 0.95, n_simulations=4000)
    np.testing.assert_allclose(theirs[0][1:-1], at)
    # Both find their level by simulation, and counts are whole: one count apart at most.
    np.testing.assert_allclose(theirs[2][1:-1] - at, lower, atol=1.01 / 60)
    np.testing.assert_allclose(theirs[3][1:-1] - at, upper, atol=1.01 / 60)
