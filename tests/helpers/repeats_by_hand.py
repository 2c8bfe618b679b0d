"""The repeats of a case by SciPy's normals of all of them together, choice by choice of what is unlike the rest."""

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import stats

from bayes_tyre.inference.model.default_priors import APART_WEIGHT, APART_WIDENING, DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors

PARAMETERS = 2


class Numbers(NamedTuple):
    """Records' values, and what `marginal_mixture.RepeatsOfCases` takes, as it describes them; a weight of 0: none."""

    records: Float[np.ndarray, "records parameters"]
    mean: Float[np.ndarray, "parameters cases"]
    scatter: Float[np.ndarray, "parameters cases"]
    remainder: Float[np.ndarray, "parameters 1"]
    weight: Float[np.ndarray, ""]
    apart_weight: float = APART_WEIGHT


#: In which parameters a case stands apart, and which of its repeats are discordant.
Choice = tuple[tuple[bool, ...], tuple[bool, ...]]


def some_numbers(factors: Factors, seed: int, ratio: float = 1.0) -> Numbers:
    """Return values of which scatter and deviations are so many times as large as others are."""
    random, cases = np.random.default_rng(seed), len(factors.cases)
    scatter = ratio * random.uniform(0.05, 0.2, (PARAMETERS, cases))
    deviation = random.normal(0.0, 0.2, (len(factors.of_record), PARAMETERS)) * ratio
    mean, level = random.normal(0.0, 0.3, (2, PARAMETERS, cases))
    remainder = random.uniform(0.0, 0.5, (PARAMETERS, 1)) * random.integers(0, 2, (PARAMETERS, 1))
    weight = np.array(random.uniform(0.01, 0.4))
    return Numbers(level.T[factors.of_record] + deviation, mean, scatter, remainder, weight)


def by_hand(numbers: Numbers, factors: Factors, case: int) -> dict[Choice, float]:
    """Return the log density of a case's repeats together with each choice."""
    members = np.flatnonzero(factors.of_record == case)
    of_case = product(_possible(numbers.apart_weight), repeat=PARAMETERS)
    of_repeats = product(_possible(numbers.weight), repeat=len(members))
    log_joint = {}
    for apart, choice in product(of_case, of_repeats):
        discordant = np.array(choice, dtype=bool)
        total = np.log(np.where(discordant, numbers.weight, 1.0 - numbers.weight)).sum()
        total += np.log(np.where(apart, numbers.apart_weight, 1.0 - numbers.apart_weight)).sum()
        for i in range(PARAMETERS):
            own = np.diag((np.where(discordant, DISCORDANT_WIDENING, 1.0) * numbers.scatter[i, case]) ** 2)
            deviation = numbers.records[members, i] - numbers.mean[i, case]
            covariance: Any = own + remainder_by_hand(numbers, i, apart[i]) ** 2  # SciPy's stubs say int
            total += stats.multivariate_normal.logpdf(deviation, cov=covariance)
        log_joint[apart, choice] = float(total)
    return log_joint


def _possible(weight: float | np.ndarray) -> tuple[bool, ...]:
    return (False, True) if weight > 0 else (False,)


def remainder_by_hand(numbers: Numbers, parameter: int, apart: bool) -> float:
    """Return the standard deviation of a case about its linear predictor."""
    return (APART_WIDENING if apart else 1.0) * float(numbers.remainder[parameter, 0])


def case_by_hand(
    numbers: Numbers, factors: Factors, case: int, discordant: np.ndarray, parameter: int, apart: bool
) -> tuple[float, float]:
    """Return mean and standard deviation of a case's value given its repeats and a choice.

    `discordant` is of all records, `apart` of the case and parameter.
    """
    members = np.flatnonzero(factors.of_record == case)
    sd = np.where(discordant[members], DISCORDANT_WIDENING, 1.0) * numbers.scatter[parameter, case]
    remainder = remainder_by_hand(numbers, parameter, apart)
    precision = remainder**-2.0 + np.sum(sd**-2.0)
    total = numbers.mean[parameter, case] / remainder**2
    total += np.sum(numbers.records[members, parameter] / sd**2)
    return total / precision, precision**-0.5
