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
    """Records' values, and what `marginal_mixture.RepeatsOfCases` takes, as it describes them."""

    records: Float[np.ndarray, "records parameters"]
    mean: Float[np.ndarray, "parameters cases"]
    scatter: Float[np.ndarray, "parameters cases"]
    remainder: Float[np.ndarray, "parameters 1"]
    weight: Float[np.ndarray, ""]


def some_numbers(factors: Factors, seed: int, ratio: float = 1.0) -> Numbers:
    """Return values of which scatter and deviations are so many times as large as others are."""
    random, cases = np.random.default_rng(seed), len(factors.cases)
    scatter = ratio * random.uniform(0.05, 0.2, (PARAMETERS, cases))
    deviation = random.normal(0.0, 0.2, (len(factors.of_record), PARAMETERS)) * ratio
    mean, level = random.normal(0.0, 0.3, (2, PARAMETERS, cases))
    remainder = random.uniform(0.0, 0.5, (PARAMETERS, 1)) * random.integers(0, 2, (PARAMETERS, 1))
    return Numbers(
        level.T[factors.of_record] + deviation, mean, scatter, remainder, np.array(random.uniform(0.01, 0.4))
    )


def by_hand(numbers: Numbers, factors: Factors, case: int) -> dict[tuple[bool, ...], float]:
    """Return the log density of a case's repeats together with each choice of discordant ones."""
    members = np.flatnonzero(factors.of_record == case)
    log_joint = {}
    for choice in product((False, True), repeat=len(members)):
        discordant = np.array(choice)
        total = np.sum(np.where(discordant, np.log(numbers.weight), np.log1p(-numbers.weight)))
        for i in range(PARAMETERS):
            own = np.diag((np.where(discordant, DISCORDANT_WIDENING, 1.0) * numbers.scatter[i, case]) ** 2)
            deviation = numbers.records[members, i] - numbers.mean[i, case]
            total += stats.multivariate_normal.logpdf(deviation, cov=own + numbers.remainder[i, 0] ** 2)
        log_joint[choice] = float(total)
    return log_joint


def case_by_hand(
    numbers: Numbers, factors: Factors, case: int, discordant: np.ndarray, parameter: int
) -> tuple[float, float]:
    """Return mean and standard deviation of a case's value given its repeats and which records are discordant."""
    members = np.flatnonzero(factors.of_record == case)
    sd = np.where(discordant[members], DISCORDANT_WIDENING, 1.0) * numbers.scatter[parameter, case]
    precision = 1.0 / numbers.remainder[parameter, 0] ** 2 + np.sum(sd**-2.0)
    total = numbers.mean[parameter, case] / numbers.remainder[parameter, 0] ** 2
    total += np.sum(numbers.records[members, parameter] / sd**2)
    return total / precision, precision**-0.5
