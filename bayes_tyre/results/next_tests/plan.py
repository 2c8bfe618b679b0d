"""Which tests to run, and in which order: a greedy choice, and an exchange of each test for a better one."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float
from pydantic import FiniteFloat

from bayes_tyre.record import CASE_FACTORS, Case
from bayes_tyre.results.next_tests.forecast import Expected, Forecast
from bayes_tyre.results.next_tests.rankings import WrongRanking
from bayes_tyre.rig.axle import NotNegative, Positive
from bayes_tyre.rig.channels import Section

#: What tests are chosen for; they are given as indices of its cases.
type Objective = Forecast | WrongRanking


class SetupMinutes(Section):
    """Minutes that a change of each factor takes; the first test changes all."""

    configuration: NotNegative = 0.0
    direction: NotNegative = 0.0
    speed_km_h: NotNegative = 0.0
    initial_load_kN: NotNegative = 0.0
    step_kN: NotNegative = 0.0


class Levels(Section):
    """What a rig can be set to, km/h and kN (steps signed); None: the levels in the data."""

    speed_km_h: list[FiniteFloat] | None = None
    initial_load_kN: list[FiniteFloat] | None = None
    step_kN: list[FiniteFloat] | None = None


class Costs(Section):
    """What tests cost, as a TOML file says: minutes of one, of all at most, and of changes; and what the rig can do."""

    minutes_per_test: Positive
    budget_minutes: Positive | None = None
    setup_minutes: SetupMinutes = SetupMinutes()
    rig: Levels = Levels()

    def minutes(self, cases: Sequence[Case]) -> list[float]:
        """Return the minutes of each test, in the order in which they are run."""
        setups = [getattr(self.setup_minutes, factor) for factor in CASE_FACTORS]
        before: list[tuple[Any, ...]] = [(None,) * len(setups), *cases]
        return [
            self.minutes_per_test + sum(np.array(setups)[[a != b for a, b in zip(old, new, strict=True)]])
            for old, new in zip(before, cases, strict=False)
        ]

    def ordered(self, goal: Objective, tests: Sequence[int]) -> list[int]:
        """Return tests in an order with few changes of the factors that take long to change."""
        setups = sorted(((minutes, factor) for factor, minutes in self.setup_minutes if minutes > 0.0), reverse=True)
        return sorted(tests, key=lambda test: [str(getattr(goal.cases[test], factor)) for _, factor in setups])

    def minutes_with_each(self, goal: Objective, tests: Sequence[int]) -> Float[np.ndarray, " cases"]:
        """Return the minutes of tests and one more, for each case."""
        sets = (self.ordered(goal, [*tests, case]) for case in range(len(goal.cases)))
        return np.array([sum(self.minutes([goal.cases[test] for test in chosen])) for chosen in sets])


def choose_tests(goal: Objective, precision: float, most: int, costs: Costs) -> list[int]:
    """Return the tests to run, in order, as indices of cases, until what is expected of the goal is `precision`.

    There are `most` at most, within the budget. Each in turn is the one that lowers the goal's loss most a minute; then
    each is exchanged for the one that lowers it most beside the others in no more time.
    """
    tests: list[int] = []
    minutes, loss, budget = 0.0, goal.loss_after(()), costs.budget_minutes or np.inf
    while len(tests) < most and goal.expected(tests).value > precision:
        total, after = costs.minutes_with_each(goal, tests), goal.loss_after_each(tests)
        rate = np.where(total <= budget, (loss - after) / (total - minutes), 0.0)
        best = int(np.argmax(rate))
        if rate[best] <= 0.0:
            break
        tests, minutes, loss = [*tests, best], float(total[best]), float(after[best])
    for i, test in enumerate(tests):
        others = [*tests[:i], *tests[i + 1 :]]
        total, after = costs.minutes_with_each(goal, others), goal.loss_after_each(others)
        tests[i] = int(np.argmin(np.where(total <= total[test], after, np.inf)))
    return costs.ordered(goal, tests)


def ranking(goal: Objective, repeats: int, costs: Costs) -> pd.DataFrame:
    """Return `next.csv`: every case that can be tested, what is expected after so many tests of it, and the best first.

    Its columns are called after the goal's measure: ``width_now`` and ``width_expected``, or ``p_wrong_...``.
    """
    now, expected = f"{goal.measure}_now", f"{goal.measure}_expected"
    minutes = [sum(costs.minutes([case] * repeats)) for case in goal.cases]
    after = {now: goal.expected(()).value, **_columns(goal, goal.expected_after_each(repeats))}
    table = _rows(goal, range(len(goal.cases))).assign(tests=repeats, minutes=minutes, **after)
    table = table.sort_values([expected, "minutes"], ignore_index=True)
    table.insert(0, "rank", np.arange(1, len(table) + 1))
    return table


def planned(goal: Objective, tests: Sequence[int], costs: Costs) -> pd.DataFrame:
    """Return `plan.csv`: tests in order, the minutes of all so far, and what is expected of the goal after them."""
    expected = [goal.expected(tests[: n + 1]) for n in range(len(tests))]
    minutes = np.cumsum(costs.minutes([goal.cases[test] for test in tests]))
    table = _rows(goal, tests).assign(minutes=minutes, **_columns(goal, expected))
    table.insert(0, "test", np.arange(1, len(table) + 1))
    return table


def _columns(goal: Objective, expected: Sequence[Expected]) -> dict[str, Any]:
    return {f"{goal.measure}_expected": [each.value for each in expected], "method": [each.method for each in expected]}


def _rows(goal: Objective, tests: Sequence[int]) -> pd.DataFrame:
    table = pd.DataFrame([goal.cases[test] for test in tests], columns=list(CASE_FACTORS))
    table.insert(0, "kind", ["repeat" if test < goal.with_records else "case" for test in tests])
    return table
