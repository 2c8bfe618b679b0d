"""Laws weighed by many records: weights by hand, evidence that does not count, and laws that are all wrong."""

import numpy as np
import pytest
from scipy import special

from bayes_tyre.inference.motion.hierarchy.law_pooling import BOOTSTRAPS, counted, pooled_weights, weights_of_record

EVEN = np.array([0.5, 0.5])


def test_of_one_record_the_weights_are_its_own():
    prior = np.array([0.5, 0.3, 0.2])
    found = pooled_weights(np.array([[7000.0, 7001.0, 6990.0]]), prior)
    np.testing.assert_allclose(found, special.softmax(np.array([10.0, 11.0, 0.0]) + np.log(prior)), rtol=1e-12)


@pytest.mark.parametrize("prior", [EVEN, np.array([0.8, 0.2])])
def test_of_two_records_the_weights_are_an_integral_that_is_known(prior):
    """The share of the first record is uniform; a logistic function of a line has a logarithm as its integral."""
    differences = -1.0, 10.0
    found = pooled_weights(np.array([[0.0, each] for each in differences]), prior)
    start, slope = 2 * differences[0] + np.log(prior[1] / prior[0]), 2 * (differences[1] - differences[0])
    expected = (np.logaddexp(0.0, start + slope) - np.logaddexp(0.0, start)) / slope
    # A mean over bootstraps of a number between 0 and 1: 4 standard errors at most, beyond which is 1 seed in 16,000.
    assert found[1] == pytest.approx(expected, abs=4 * 0.5 / np.sqrt(BOOTSTRAPS))
    assert found.sum() == pytest.approx(1.0)


def test_what_all_laws_make_of_a_record_favours_none_and_the_order_of_records_does_not_count_for_much():
    rng = np.random.default_rng(5)
    logs = rng.normal(0.0, 1.0, (12, 3))
    prior = np.array([0.5, 0.25, 0.25])
    found = pooled_weights(logs, prior)
    np.testing.assert_allclose(pooled_weights(logs + rng.normal(8e3, 500, (12, 1)), prior), found, atol=1e-6)
    # Two independent means over bootstraps, as it were: 4 standard errors of their difference.
    np.testing.assert_allclose(pooled_weights(logs[::-1], prior), found, atol=4 * 0.5 * np.sqrt(2 / BOOTSTRAPS))


def test_a_law_that_each_record_prefers_a_little_carries_the_weight_of_all():
    # Each record by itself gives it 0.73 at even odds; by 24 the odds are e^24.
    logs = np.array([[0.0, 1.0]] * 24)
    assert pooled_weights(logs, EVEN)[1] > 1 - 1e-9
    # However unlike the records are: the least of them is multiplied in every bootstrap.
    logs[::2, 1] = 30.0
    assert pooled_weights(logs, EVEN)[1] > 1 - 1e-9


def test_one_record_does_not_outweigh_all_others_for_certain():
    logs = np.array([[2.0, 0.0]] * 23 + [[0.0, 100.0]])
    # A plain sum is 54 in favour of the second law: odds of e^54. Its record has a share of an exponential number:
    # it falls short of the other 46 with probability 1 - exp(-0.46) = 0.37, but for what the other shares vary.
    assert 0.3 < pooled_weights(logs, EVEN)[0] < 0.45


def test_laws_that_are_alike_in_the_mean_keep_their_weight_where_a_sum_would_choose_one():
    """Of two laws, both wrong, a record prefers one by chance: by 20, of either sign."""
    rng = np.random.default_rng(11)
    differences = rng.normal(0.0, 20.0, (200, 24))
    by_sum = special.expit(differences.sum(axis=1))
    pooled = np.array([pooled_weights(np.stack([np.zeros(24), each], axis=1), EVEN)[1] for each in differences])
    certain = [np.mean((weights < 0.01) | (weights > 0.99)) for weights in (by_sum, pooled)]
    # The sum's standard deviation is 98: between odds of 99 and 1 / 99 it is in 4 % of campaigns.
    assert certain[0] > 0.9
    # The bootstrap's share of either sign is about uniform: beyond 0.01 or 0.99 in 2 % of campaigns, 4 of 200 expected;
    # more than 14 in 1 seed of 10^4.
    assert certain[1] <= 14 / 200


def test_evidence_that_is_unreliable_is_left_out_while_half_of_the_records_have_better():
    logs = np.zeros((6, 2))
    reliable = np.ones((6, 2), bool)
    reliable[0, 1] = False
    logs[1, 0] = np.nan
    found = counted(logs, reliable)
    assert found.records.tolist() == [False, False, True, True, True, True]
    assert (found.laws.tolist(), found.reliable) == ([True, True], True)
    reliable[2:5, 0] = False
    found = counted(logs, reliable)
    assert found.records.tolist() == [True, False, True, True, True, True]
    assert not found.reliable


def test_a_law_that_most_records_cannot_be_fitted_with_does_not_count_and_costs_no_record():
    logs = np.zeros((5, 3))
    logs[:3, 2] = np.nan
    found = counted(logs, np.isfinite(logs))
    assert found.laws.tolist() == [True, True, False]
    assert found.records.all()
    assert not counted(np.full((2, 3), np.nan), np.zeros((2, 3), bool)).records.any()


def test_a_record_has_the_weights_of_all_among_its_own_fits():
    pooled = np.array([0.6, 0.3, 0.1])
    found = weights_of_record(pooled, np.array([False, True, True]))
    assert found is not None
    np.testing.assert_allclose(found, [0.0, 0.75, 0.25])
    assert weights_of_record(pooled, np.zeros(3, bool)) is None
    assert weights_of_record(np.full(3, np.nan), np.ones(3, bool)) is None
