"""The repeats of a case by SciPy's normals of all of them together, choice by choice of those that are discordant."""

from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import stats

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors

PARAMETERS = 2


class Numbers(NamedTuple):
    """Values of what `summed_out.marginalise` takes, in its order and as it describes them."""

    deviation: Float[np.ndarray, "records parameters"]
    offset: Float[np.ndarray, "parameters cases"]
    scatter: Float[np.ndarray, "parameters cases"]
    remainder: Float[np.ndarray, "parameters 1"]
    weight: Float[np.ndarray, ""]


def some_numbers(factors: Factors, seed: int, ratio: float = 1.0) -> Numbers:
    """Return values of which scatter and deviations are so many times as large as others are."""
    random, cases = np.random.default_rng(seed), len(factors.cases)
    scatter = ratio * random.uniform(0.05, 0.2, (PARAMETERS, cases))
    deviation = random.normal(0.0, 0.2, (len(factors.of_record), PARAMETERS)) * ratio
    offset = random.normal(0.0, 0.3, (PARAMETERS, cases))
    remainder = random.uniform(0.0, 0.5, (PARAMETERS, 1)) * random.integers(0, 2, (PARAMETERS, 1))
    return Numbers(deviation, offset, scatter, remainder, np.array(random.uniform(0.01, 0.4)))


def by_hand(numbers: Numbers, factors: Factors, case: int) -> dict[tuple[bool, ...], float]:
    """Return the log density of a case's repeats together with each choice of discordant ones."""
    members = np.flatnonzero(factors.of_record == case)
    found = {}
    for choice in product((False, True), repeat=len(members)):
        odd = np.array(choice)
        total = np.sum(np.where(odd, np.log(numbers.weight), np.log1p(-numbers.weight)))
        for i in range(PARAMETERS):
            own = np.diag((np.where(odd, DISCORDANT_WIDENING, 1.0) * numbers.scatter[i, case]) ** 2)
            case_distribution = numbers.offset[i, case] + numbers.deviation[members, i]
            total += stats.multivariate_normal.logpdf(case_distribution, cov=own + numbers.remainder[i, 0] ** 2)
        found[choice] = float(total)
    return found
