"""The posterior of a goal after tests that have not been run: by the update of a normal one, or by reweighted draws."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Case
from bayes_tyre.results.next_tests.candidates import Candidates
from bayes_tyre.results.next_tests.goals import Goal
from bayes_tyre.results.next_tests.reweighting import EFFECTIVE_LEAST, reweighted_width

_TAILS = (0.025, 0.975)
#: Largest skewness and excess kurtosis of a goal's draws that are taken for nearly normal.
_SKEWNESS, _EXCESS = 0.5, 1.0
#: How an expectation was found.
NORMAL, REWEIGHTED = "normal", "reweighted"


class Expected(NamedTuple):
    """What is expected of a goal after tests, and by which method: `NORMAL` or `REWEIGHTED`."""

    value: float
    method: str


@dataclass(frozen=True)
class Forecast:
    """What a posterior says of a goal, and of the tests that could be run.

    Attributes
    ----------
    cases, with_records:
        Those that can be tested; the first so many have records.
    covariance, weights:
        Of the logarithms of all values, a case's together, and what the goal's logarithm weighs each with.
    noise:
        Covariance of the error of one test of each case, which measures the first values of the case.
    log_goal:
        Draws of the logarithm of the goal.
    log_values:
        Draws of the logarithms of what a test of each case measures; None: they cannot be weighted.
    """

    cases: tuple[Case, ...]
    with_records: int
    covariance: Float[np.ndarray, "values values"]
    weights: Float[np.ndarray, " values"]
    noise: Float[np.ndarray, "cases measured measured"]
    log_goal: Float[np.ndarray, " draws"]
    log_values: Float[np.ndarray, "draws cases measured"] | None = None
    #: What is expected, in names of columns; what a plan lowers is the variance.
    measure: ClassVar[str] = "width"

    def covariance_after(self, tests: Sequence[int]) -> Float[np.ndarray, "values values"]:
        """Return the covariance of all values after tests, given as indices of cases."""

        def with_test(covariance: np.ndarray, case: int) -> np.ndarray:
            first, noise = case * (len(covariance) // len(self.noise)), self.noise[case]
            rows = covariance[first : first + len(noise)]
            return covariance - rows.T @ np.linalg.solve(rows[:, first : first + len(noise)] + noise, rows)

        return reduce(with_test, tests, self.covariance)

    def variance_after(self, tests: Sequence[int]) -> float:
        """Return the variance of the goal's logarithm after tests."""
        return float(self.weights @ self.covariance_after(tests) @ self.weights)

    def variance_after_each(self, tests: Sequence[int] = (), repeats: int = 1) -> Float[np.ndarray, " cases"]:
        """Return the variance of the goal's logarithm after tests and `repeats` further ones of each case in turn."""
        covariance, (cases, measured, _) = self.covariance_after(tests), self.noise.shape
        each = np.arange(cases)
        blocks = covariance.reshape(cases, -1, cases, len(covariance) // cases)[each, :measured, each, :measured]
        with_goal = (covariance @ self.weights).reshape(cases, -1)[:, :measured]
        gain = np.linalg.solve(blocks + self.noise / repeats, with_goal[..., None])[..., 0]
        return self.weights @ covariance @ self.weights - np.sum(with_goal * gain, axis=1)

    def width(self, variance: float | None = None) -> float:
        """Return the width of the goal's 95 % interval over its median: now, or with another variance of its logarithm.

        The interval of the draws is shrunk, so that it keeps their skewness.
        """
        shrink = 1.0 if variance is None else np.sqrt(variance / self.variance_after(()))
        return float(np.ptp(np.exp(shrink * (np.quantile(self.log_goal, _TAILS) - np.median(self.log_goal)))))

    @property
    def median(self) -> float:
        """Median of the goal, in its own unit."""
        return float(np.exp(np.median(self.log_goal)))

    loss_after, loss_after_each = variance_after, variance_after_each

    def expected(self, tests: Sequence[int]) -> Expected:
        """Return the width after tests, given as indices of cases; where the goal is not near normal by reweighting.

        Where tests tell so much that few draws keep weight, the normal update stands in for it.
        """
        return self._expected(tests, self.variance_after(tests))

    def expected_after_each(self, repeats: int) -> list[Expected]:
        """Return the width after `repeats` tests of each case in turn."""
        variances = self.variance_after_each(repeats=repeats)
        return [self._expected([case] * repeats, variance) for case, variance in enumerate(variances)]

    def _expected(self, tests: Sequence[int], variance: float) -> Expected:
        if tests and self.doubtful and self.log_values is not None:
            reweighted = reweighted_width(self.log_values, self.noise, self.log_goal, tests)
            if reweighted.effective >= EFFECTIVE_LEAST:
                return Expected(reweighted.width, REWEIGHTED)
        return Expected(self.width(variance), NORMAL)

    @cached_property
    def doubtful(self) -> bool:
        """Whether the draws of the goal are so far from normal that a forecast from their covariance is doubtful."""
        z = (self.log_goal - np.mean(self.log_goal)) / np.std(self.log_goal)
        return bool(abs(np.mean(z**3)) > _SKEWNESS or abs(np.mean(z**4) - 3.0) > _EXCESS)


def forecast(candidates: Candidates, goal: Goal) -> Forecast:
    """Return the forecast of a goal over these candidates.

    Raises
    ------
    BadInput
        If the goal is what follows from measured parameters, such as energy, in a case without records.
    """
    values, p = (
        candidates.log_values.reshape(len(candidates.log_values), -1),
        candidates.parameters.index(goal.parameter),
    )
    if p >= candidates.noise.shape[1] and goal.weights[candidates.with_records :].any():
        raise BadInput(f"--goal {goal.text}: {goal.parameter} of a new case is not known; name a case with records")
    weights = np.zeros(candidates.log_values.shape[1:])
    weights[:, p] = goal.weights
    covariance = np.atleast_2d(np.cov(values, rowvar=False))
    log_goal, cases = values @ weights.ravel(), candidates.cases
    measured = candidates.log_values[:, :, : candidates.noise.shape[1]]
    return Forecast(cases, candidates.with_records, covariance, weights.ravel(), candidates.noise, log_goal, measured)
