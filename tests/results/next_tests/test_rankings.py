"""Rankings of configurations as goals: the order, the ratio in doubt, and how probably the order is wrong."""

import numpy as np
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Case
from bayes_tyre.results.next_tests.candidates import Candidates
from bayes_tyre.results.next_tests.forecast import Forecast
from bayes_tyre.results.next_tests.plan import Costs, choose_tests, planned
from bayes_tyre.results.next_tests.plan import ranking as ranked
from bayes_tyre.results.next_tests.rankings import AskedRanking, WrongRanking, parse_ranking, ranking

MEANS = {"single": 0.5, "dual": 0.8, "wide": 0.54}
#: Standard deviations of a case's logarithm and of a test's error.
KNOWN, ERROR = 0.06, 0.05


def made(configurations: tuple[str, ...] = tuple(MEANS), draws: int = 4000) -> Candidates:
    """Return two cases of each configuration, known alike, and draws of the logarithm of k."""
    cases = tuple(Case(name, "loading", speed, 20.0, 10.0) for name in configurations for speed in (0.0, 25.0))
    means = np.array([MEANS[case.configuration or ""] for case in cases])
    values = means + KNOWN * np.random.default_rng(3).standard_normal((draws, len(cases)))
    noise = np.broadcast_to(ERROR**2 * np.eye(1), (len(cases), 1, 1))
    return Candidates(cases, len(cases), ("k",), values[..., None], noise)


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("ranking k", AskedRanking("k", wrong=False)),
        (" wrong  ranking beta ", AskedRanking("beta", wrong=True)),
        ("k ranking / single", None),
        ("ranking", None),
    ],
)
def test_a_ranking_is_asked_for_by_name(text, asked):
    assert parse_ranking(text) == asked


def test_the_goal_of_a_ranking_is_the_ratio_whose_side_of_1_is_least_certain():
    goal, known = ranking(made(), AskedRanking("k", wrong=False))
    assert goal.text == "k wide / single"
    assert goal.of == "2 pairs of cases; dual above wide above single"
    assert isinstance(known, Forecast)
    assert known.median == pytest.approx(np.exp(0.04), rel=0.01)


def test_a_wrong_ranking_is_as_probable_as_simulated_tests_have_it():
    _, known = ranking(made(), AskedRanking("k", wrong=True))
    assert isinstance(known, WrongRanking)
    assert known.order == ("dual", "wide", "single")
    means = np.array([pair.log_goal.mean() for pair in known.pairs])
    rng, sets = np.random.default_rng(4), 400_000
    for tests in ([], [4], [0, 1, 4, 5]):
        variances = np.array([(pair.variance_after(()), pair.variance_after(tests)) for pair in known.pairs])
        wrong = 0.0
        for mean, (now, after) in zip(means, variances, strict=True):
            estimate = mean + np.sqrt(max(now - after, 0.0)) * rng.standard_normal(sets)
            truth = estimate + np.sqrt(after) * rng.standard_normal(sets)
            wrong += np.mean(np.sign(estimate) != np.sign(truth))
        # The share of 400,000 is known to 0.0008 at most; of three pairs to 0.0013: four times that.
        assert known.loss_after(tests) == pytest.approx(wrong, abs=0.005)
    each = known.loss_after_each([4], repeats=2)
    np.testing.assert_allclose(each, [known.loss_after([4, case, case]) for case in range(6)], rtol=1e-9)


def test_a_plan_lowers_the_probability_until_it_is_small_enough():
    _, known = ranking(made(), AskedRanking("k", wrong=True))
    costs, now = Costs(minutes_per_test=1.0), known.loss_after(())
    enough = 0.7 * now
    tests = choose_tests(known, enough, 20, costs)
    plan, table = planned(known, tests, costs), ranked(known, 1, costs)
    assert plan["p_wrong_expected"].iloc[-1] <= enough < plan["p_wrong_expected"].iloc[-2]
    assert {known.cases[test].configuration for test in tests} == {"single", "wide"}  # dual is beyond doubt
    assert table["p_wrong_now"].unique().tolist() == [now]
    assert table["p_wrong_expected"].is_monotonic_increasing
    assert set(table["configuration"].tail(2)) == {"dual"}
    assert set(table["method"]) == {"normal"}


def test_what_cannot_be_ranked_is_refused():
    with pytest.raises(BadInput, match="no two configurations with cases that match"):
        ranking(made(("single",)), AskedRanking("k", wrong=False))
    with pytest.raises(BadInput, match="no case has 'x' here; the posterior has k"):
        ranking(made(), AskedRanking("x", wrong=True))
