"""What records' estimates say of their cases: odd ones are seen, and move nothing."""

import numpy as np
import pandas as pd

from bayes_tyre.inference.model.coordinates.laplace_cases import case_estimates
from bayes_tyre.inference.model.factors import Factors, find_factors

CASES, SCATTER, SD = 40, 0.05, 0.01


def levels_of(repeats: int) -> Factors:
    return find_factors(pd.DataFrame({"configuration": np.repeat([f"case {i:02}" for i in range(CASES)], repeats)}))


def usual(repeats: int) -> np.ndarray:
    """Return logarithms of two parameters of repeats that scatter as usual."""
    random = np.random.default_rng(repeats)
    return np.repeat(random.normal(size=(CASES, 2)), repeats, axis=0) + random.normal(0, SCATTER, (CASES * repeats, 2))


def test_an_odd_record_is_seen_and_moves_no_case():
    values, factors = usual(3), levels_of(3)
    values[4] += [8 * SCATTER, -12 * SCATTER]
    found = case_estimates(values, np.full(values.shape, SD**2), factors)
    assert found.discordant[4]
    np.testing.assert_allclose(found.middle[:, 1], values[[3, 5]].mean(axis=0))
    # Of usual records 0.3 % look odd (simulated, 200,000 of them): more than 5 of 119 in 2e-6 of seeds.
    assert found.discordant.sum() <= 6
    np.testing.assert_allclose(np.exp(found.log_scatter.value), SCATTER, rtol=0.4)


def test_records_that_say_little_are_not_called_odd():
    values, factors = usual(3), levels_of(3)
    values[4] += 0.5
    variances = np.full(values.shape, SD**2)
    variances[4] = 1.0
    assert not case_estimates(values, variances, factors).discordant[4]


def test_of_two_that_both_look_odd_neither_is_left_out():
    values, factors = usual(2), levels_of(2)
    values[6:8] = [[-1.0, -1.0], [1.0, 1.0]]
    found = case_estimates(values, np.full(values.shape, SD**2), factors)
    assert found.discordant[6:8].all()
    np.testing.assert_allclose(found.middle[:, 3], [0.0, 0.0], atol=1e-12)
