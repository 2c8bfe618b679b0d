"""Ranks stay in their band where chains agree, at the rate it says, and leave it where one does not."""

import numpy as np
import pytest
from scipy.stats import binom

from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter
from bayes_tyre.results.figure_data.ranks import BAND, LEAST, Ranks, in_words, ranks

#: Probability that a correct band fails a test of its rate.
FALSE_ALARM = 1e-4


def ranked(draws: np.ndarray) -> Ranks:
    return ranks(Hyperparameter("k", "kN/mm", None, draws))


def outside(one: Ranks) -> np.ndarray:
    """Return which chains leave the band."""
    return np.any(np.abs(one.excess) > one.band + 1e-12, axis=1)


def ar1(rng: np.random.Generator, rho: float, chains: int, draws: int) -> np.ndarray:
    noise = rng.normal(size=(chains, draws))
    for i in range(1, draws):
        noise[:, i] = rho * noise[:, i - 1] + np.sqrt(1 - rho**2) * noise[:, i]
    return noise


def test_the_excess_is_the_share_of_a_chain_up_to_a_rank_less_that_of_all():
    draws = np.stack([np.arange(100.0), np.arange(100.0) + 0.5])  # the chains take turns
    one = ranked(draws)
    assert one.name == "k"
    np.testing.assert_allclose(one.excess, 0, atol=0.0051)
    apart = ranked(np.random.default_rng(1).normal(size=(2, 400)) + np.array([[0.0], [100.0]]))
    middle = np.searchsorted(apart.at, 0.5)
    np.testing.assert_allclose(apart.excess[:, middle], [0.5, -0.5])
    np.testing.assert_allclose(apart.excess[:, [0, -1]], 0)


@pytest.mark.parametrize(("chains", "draws"), [(4, 200), (2, 1000), (8, 60)])
def test_chains_that_agree_stay_inside_together_at_the_stated_rate(chains, draws):
    rng = np.random.default_rng(2)
    sets = 300
    inside = sum(not outside(ranked(rng.normal(size=(chains, draws)))).any() for _ in range(sets))
    # The band is found from 1000 sets: its own rate has a standard error of 0.007.
    low, high = binom.ppf([FALSE_ALARM / 2, 1 - FALSE_ALARM / 2], sets, [BAND - 4 * 0.007, BAND + 4 * 0.007])
    assert low <= inside <= high


def test_draws_that_follow_each_other_are_thinned_until_the_band_is_theirs():
    rng = np.random.default_rng(3)
    inside = sum(not outside(ranked(ar1(rng, 0.8, 4, 1500))).any() for _ in range(100))
    # Thinned to the effective size neighbours still correlate a little: at least 80 of 100, where unthinned
    # chains, nine times less effective than they are many, stay inside hardly ever.
    assert inside >= 80


@pytest.mark.parametrize("shift", [0.5, -0.5])
def test_a_chain_apart_leaves_the_band_on_its_side(shift):
    draws = np.random.default_rng(4).normal(size=(4, 500))
    draws[2] += shift
    one = ranked(draws)
    assert outside(one)[2]
    assert np.sign(one.excess[2].sum()) == -np.sign(shift)


def test_a_chain_that_is_too_narrow_leaves_the_band():
    draws = np.random.default_rng(5).normal(size=(4, 800))
    draws[1] *= 0.5
    assert outside(ranked(draws))[1]


@pytest.mark.parametrize(("drift", "leaves"), [(0.0, False), (2.0, True)])
def test_one_chain_is_held_against_itself(drift, leaves):
    draws = np.random.default_rng(6).normal(size=(1, 800)) + drift * np.linspace(0, 1, 800)
    one = ranked(draws)
    assert one.excess.shape[0] == 2
    assert outside(one).any() == leaves


def test_a_stuck_chain_and_very_few_draws_still_have_ranks():
    stuck = np.random.default_rng(7).normal(size=(4, 300))
    stuck[3] = 50.0
    one = ranked(stuck)
    assert outside(one)[3]
    few = ranked(np.random.default_rng(8).normal(size=(2, 5)))
    assert np.isfinite(few.excess).all()
    assert np.isfinite(few.band).all()
    assert LEAST > 5


def test_as_many_as_chance_lets_leave_their_band_are_no_warning_and_more_are():
    rng = np.random.default_rng(6)
    agree = [ranked(rng.normal(size=(4, 200))) for _ in range(20)]
    leave = sum(bool(outside(one).any()) for one in agree)
    assert leave <= 4  # with probability 0.997 for a rate of 0.05
    assert in_words(agree) == f"{leave} of 20 parameters leave{'s' * (leave == 1)} the band; up to 4 may by chance."
    apart = [ranked(rng.normal(size=(4, 200)) + np.array([[2.0], [0.0], [0.0], [0.0]])) for _ in range(5)]
    said = in_words([*agree[:15], *apart])
    assert said.startswith("Warning: ")
    assert said.endswith("leave the band, more than the 4 that may by chance: the chains do not agree.")
    assert in_words([]) == ""
