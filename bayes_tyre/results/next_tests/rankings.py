"""The ranking of configurations as a goal: which is stiffer, and how probably the order is wrong."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import special

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import quoted
from bayes_tyre.record import Case
from bayes_tyre.results.contrasts import configuration_pairs
from bayes_tyre.results.next_tests.candidates import Candidates
from bayes_tyre.results.next_tests.forecast import NORMAL, Expected, Forecast, forecast
from bayes_tyre.results.next_tests.goals import Goal, check_parameter, ratio_goal

RANKING, WRONG_RANKING = "ranking", "wrong ranking"


class AskedRanking(NamedTuple):
    """A ranking by a parameter; `wrong`: the goal is the probability that it is wrong, not its least certain ratio."""

    parameter: str
    wrong: bool


def parse_ranking(text: str) -> AskedRanking | None:
    """Return the ranking that a goal such as ``ranking k`` or ``wrong ranking k`` asks for; None for other goals."""
    *words, parameter = " ".join(text.split()).split(" ")
    asked = " ".join(words)
    return AskedRanking(parameter, asked == WRONG_RANKING) if asked in (RANKING, WRONG_RANKING) else None


@dataclass(frozen=True)
class WrongRanking:
    """How probably the order of configurations is wrong, now and after tests.

    The order is that of the posterior means, after the tests that of the means then. Of a pair it is wrong where the
    true ratio lies on the other side of 1. Of more than two configurations the probabilities of all pairs are added: a
    bound that is close where one pair is in doubt.

    Attributes
    ----------
    pairs:
        The logarithm of the ratio of each pair that matches, the larger above.
    order:
        The configurations, the largest first.
    """

    pairs: tuple[Forecast, ...]
    order: tuple[str, ...]
    measure: ClassVar[str] = "p_wrong"

    @property
    def cases(self) -> tuple[Case, ...]:
        """Those that can be tested."""
        return self.pairs[0].cases

    @property
    def with_records(self) -> int:
        """How many of them have records: the first."""
        return self.pairs[0].with_records

    @property
    def doubtful(self) -> bool:
        """Whether the draws of a ratio are far from normal."""
        return any(pair.doubtful for pair in self.pairs)

    @property
    def least_certain(self) -> Forecast:
        """The ratio whose side of 1 is least certain."""
        return max(self.pairs, key=lambda pair: float(_wrong(pair, pair.variance_after(()))))

    def loss_after(self, tests: Sequence[int]) -> float:
        """Return the probability that the order is wrong after tests, given as indices of cases."""
        return float(min(1.0, sum(_wrong(pair, pair.variance_after(tests)) for pair in self.pairs)))

    def loss_after_each(self, tests: Sequence[int] = (), repeats: int = 1) -> Float[np.ndarray, " cases"]:
        """Return it after tests and `repeats` further ones of each case in turn."""
        each = [_wrong(pair, pair.variance_after_each(tests, repeats)) for pair in self.pairs]
        return np.minimum(1.0, np.sum(each, axis=0))

    def expected(self, tests: Sequence[int]) -> Expected:
        """Return what `loss_after` gives: the ratios are taken as normal."""
        return Expected(self.loss_after(tests), NORMAL)

    def expected_after_each(self, repeats: int) -> list[Expected]:
        """Return what `loss_after_each` gives without other tests."""
        return [Expected(float(loss), NORMAL) for loss in self.loss_after_each(repeats=repeats)]


def _wrong(pair: Forecast, after: Float[np.ndarray, "..."] | float) -> Float[np.ndarray, "..."]:
    """Return how probably the sign of a normal number is taken for the other, from its variance after tests.

    Its mean after the tests and the number itself are jointly normal about one mean, and the probability that their
    signs differ is twice Owen's T (Owen 1956).
    """
    now = pair.variance_after(())
    mean = float(np.mean(pair.log_goal)) / np.sqrt(now)
    with np.errstate(divide="ignore"):  # tests that tell nothing: the ratio is infinite, and T a normal tail
        return np.asarray(2.0 * special.owens_t(abs(mean), np.sqrt(after / np.maximum(now - after, 0.0))))


def ranking(candidates: Candidates, asked: AskedRanking) -> tuple[Goal, Forecast | WrongRanking]:
    """Return the ranking of the configurations by a parameter as a goal, and its forecast.

    That of `ranking` is of the ratio whose side of 1 is least certain; that of `wrong ranking` the probability that the
    order is wrong.

    Raises
    ------
    BadInput
        If the posterior has no such parameter, or no two configurations whose cases match.
    """
    parameter, wrong = asked
    text = f"{WRONG_RANKING if wrong else RANKING} {parameter}"
    check_parameter(text, parameter, candidates.parameters)
    cases = candidates.cases[: candidates.with_records]
    configurations = sorted({str(case.configuration) for case in cases if case.configuration is not None})
    forecasts = {}
    for pair in combinations(configurations, 2):
        if matches := configuration_pairs(cases, *pair):
            of = f"{len(matches)} pairs of cases"
            goal = ratio_goal(f"{parameter} {pair[0]} / {pair[1]}", parameter, matches, len(candidates.cases), of)
            of_pair = forecast(candidates, goal)
            if np.mean(of_pair.log_goal) < 0.0:
                pair = pair[::-1]
                goal = goal._replace(text=f"{parameter} {pair[0]} / {pair[1]}", weights=-goal.weights)
                of_pair = forecast(candidates, goal)
            forecasts[pair] = goal, of_pair
    if not forecasts:
        raise BadInput(f"--goal {quoted(text)}: there are no two configurations with cases that match to be ranked")
    larger = {name: sum(above == name for above, _ in forecasts) for name in configurations}
    order = tuple(sorted(configurations, key=lambda name: -larger[name]))
    of_all = WrongRanking(tuple(of_pair for _, of_pair in forecasts.values()), order)
    if wrong:
        return Goal(text, parameter, np.zeros(len(candidates.cases)), " above ".join(order)), of_all
    goal, of_pair = next(each for each in forecasts.values() if each[1] is of_all.least_certain)
    return goal._replace(of=f"{goal.of}; {' above '.join(order)}"), of_pair
