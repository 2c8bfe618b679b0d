"""Which tests to run, and in which order: a greedy choice, and an exchange of each test for a better one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from bayes_tyre.record import CASE_FACTORS, Case
from bayes_tyre.results.forecast import Forecast


@dataclass(frozen=True)
class Costs:
    """What tests cost; by default, each is one of an unknown number of minutes.

    Attributes
    ----------
    minutes_per_test:
        Of the test itself; NaN: not known.
    setup_minutes:
        Of a change of a factor from the test before, by factor; the first test changes all.
    budget_minutes:
        Of all tests.
    """

    minutes_per_test: float = np.nan
    setup_minutes: Mapping[str, float] = field(default_factory=dict)
    budget_minutes: float = np.inf

    def minutes(self, cases: Sequence[Case]) -> list[float]:
        """Return the minutes of each test, in the order in which they are run."""
        minutes, before = [], (None,) * len(CASE_FACTORS)
        for case in cases:
            changed = [name for name, old, new in zip(CASE_FACTORS, before, case, strict=True) if old != new]
            minutes.append(self.minutes_per_test + sum(self.setup_minutes.get(name, 0.0) for name in changed))
            before = case
        return minutes

    def ordered(self, forecast: Forecast, tests: Sequence[int]) -> list[int]:
        """Return tests in an order with few changes of the factors that take long to change."""
        factors = sorted(self.setup_minutes, key=lambda name: -self.setup_minutes[name])
        return sorted(tests, key=lambda test: [str(getattr(forecast.cases[test], name)) for name in factors])

    def after_each(self, forecast: Forecast, tests: Sequence[int]) -> Float[np.ndarray, " cases"]:
        """Return the minutes of tests and one more, for each case; the number of tests where minutes are not known."""
        if np.isnan(self.minutes_per_test):
            return np.full(len(forecast.cases), len(tests) + 1.0)
        sets = (self.ordered(forecast, [*tests, case]) for case in range(len(forecast.cases)))
        return np.array([sum(self.minutes([forecast.cases[test] for test in chosen])) for chosen in sets])


def choose_tests(forecast: Forecast, precision: float, most: int, costs: Costs) -> list[int]:
    """Return the tests to run, in order, as indices of cases: until the goal is precise enough, or no more may be.

    Each test in turn is the one that lowers the goal's variance most a minute. Then each is exchanged for the one that
    lowers it most beside the others in no more time.

    Parameters
    ----------
    forecast, costs:
        Of what is to be known, and of tests.
    precision:
        Width of the goal's interval over its median that is enough.
    most:
        Tests at most.
    """
    tests: list[int] = []
    minutes, variance = 0.0, forecast.variance_after(())
    while len(tests) < most and forecast.width(variance) > precision:
        total, after = costs.after_each(forecast, tests), forecast.variance_after_each(tests)
        rate = np.where(total <= costs.budget_minutes, (variance - after) / (total - minutes), 0.0)
        best = int(np.argmax(rate))
        if rate[best] <= 0:
            break
        tests, minutes, variance = [*tests, best], float(total[best]), float(after[best])
    for i, test in enumerate(tests):
        others = [*tests[:i], *tests[i + 1 :]]
        total, after = costs.after_each(forecast, others), forecast.variance_after_each(others)
        tests[i] = int(np.argmin(np.where(total <= total[test], after, np.inf)))
    return costs.ordered(forecast, tests)


def ranking(forecast: Forecast, repeats: int, costs: Costs) -> pd.DataFrame:
    """Return `next.csv`: every case that can be tested, and the goal's width after so many tests of it, best first."""
    after, now = forecast.variance_after_each(repeats=repeats), forecast.width()
    rows = [
        {**_row(forecast, i), "tests": repeats, "minutes": sum(costs.minutes([case] * repeats)), "width_now": now}
        | {"width_expected": forecast.width(after[i])}
        for i, case in enumerate(forecast.cases)
    ]
    table = pd.DataFrame(rows).sort_values(["width_expected", "minutes"], ignore_index=True)
    table.insert(0, "rank", np.arange(1, len(table) + 1))
    return table


def planned(forecast: Forecast, tests: Sequence[int], costs: Costs) -> pd.DataFrame:
    """Return `plan.csv`: tests in order, the minutes of all so far, and the goal's width after them."""
    minutes = np.cumsum(costs.minutes([forecast.cases[test] for test in tests]))
    widths = [forecast.width(forecast.variance_after(tests[: n + 1])) for n in range(len(tests))]
    rows = [{"test": n + 1, **_row(forecast, test)} for n, test in enumerate(tests)]
    columns = ["test", "kind", *CASE_FACTORS]
    return pd.DataFrame(rows, columns=columns).assign(minutes=minutes, width_expected=widths)


def _row(forecast: Forecast, case: int) -> dict[str, Any]:
    return {"kind": "repeat" if case < forecast.with_records else "case", **forecast.cases[case]._asdict()}
