"""The width of a goal's interval after tests, by importance reweighting of the posterior's draws: for any shape of it.

Outcomes of the tests are simulated from draws of the posterior. Each outcome weights all draws by its likelihood, and
the weighted draws are the posterior after it; the expected width is the mean over the outcomes. Tests that tell much
leave few draws with weight, and then the widths are not to be relied on: `effective` says so.
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import linalg

#: Draws that are weighted, and outcomes that are averaged over.
_DRAWS, _OUTCOMES = 4000, 100
#: Fewest effective draws, averaged over the outcomes, that carry a 95 % interval.
EFFECTIVE_LEAST = 200.0
_QUANTILES = (0.025, 0.5, 0.975)


class Reweighted(NamedTuple):
    """The expected width of a goal's 95 % interval over its median, and the mean number of effective draws."""

    width: float
    effective: float


def reweighted_width(
    log_values: Float[np.ndarray, "draws cases measured"],
    noise: Float[np.ndarray, "cases measured measured"],
    log_goal: Float[np.ndarray, " draws"],
    tests: Sequence[int],
) -> Reweighted:
    """Return the width after tests, given as indices of cases; every set of tests is given like outcomes.

    Parameters
    ----------
    log_values, log_goal:
        Draws of what a test of each case measures, and of the goal, as logarithms.
    noise:
        Covariance of the error of one test of each case.
    """
    rng = np.random.default_rng(0)
    sorted_draws = np.linspace(0, len(log_goal) - 1, min(_DRAWS, len(log_goal))).astype(int)
    sorted_draws = sorted_draws[np.argsort(log_goal[sorted_draws], kind="stable")]
    true = rng.integers(len(sorted_draws), size=_OUTCOMES)
    log_weights = np.zeros((_OUTCOMES, len(sorted_draws)))
    for case, repeats in sorted(Counter(tests).items()):
        # In units of the error of the mean of the repeats, an outcome's error is standard normal.
        root = np.linalg.cholesky(noise[case] / repeats)
        scaled = np.asarray(linalg.solve_triangular(root, log_values[sorted_draws, case].T, lower=True))
        outcomes = scaled[:, true] + rng.standard_normal((len(scaled), _OUTCOMES))
        log_weights -= 0.5 * np.sum((outcomes[:, :, None] - scaled[:, None, :]) ** 2, axis=0)
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    shares = np.cumsum(weights, axis=1)
    shares = (shares - 0.5 * weights) / shares[:, -1:]
    lower, middle, upper = np.exp([np.interp(_QUANTILES, share, log_goal[sorted_draws]) for share in shares]).T
    effective = weights.sum(axis=1) ** 2 / (weights**2).sum(axis=1)
    return Reweighted(float(np.mean((upper - lower) / middle)), float(effective.mean()))
