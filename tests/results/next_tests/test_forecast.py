"""The forecast of a goal: a normal posterior's is exact, whether from its covariance or from its draws."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Case
from bayes_tyre.results.next_tests.candidates import Candidates
from bayes_tyre.results.next_tests.forecast import Forecast, forecast
from bayes_tyre.results.next_tests.goals import Goal


def cases_of(count: int) -> tuple[Case, ...]:
    return tuple(Case("single", "loading", 0.0, 10.0 * i, 10.0) for i in range(count))


def positive(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Return positive definite matrices."""
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(shape[-1])


def made(seed: int, cases: int = 4, values: int = 3, measured: int = 2) -> Forecast:
    """Return a forecast of random matrices: each case has so many values, of which a test measures the first."""
    rng = np.random.default_rng(seed)
    covariance, weights = positive(rng, cases * values), rng.normal(size=cases * values)
    noise = positive(rng, cases, measured)
    return Forecast(cases_of(cases), cases, covariance, weights, noise, rng.normal(size=100))


def recomputed(known: Forecast, tests: list[int]) -> np.ndarray:
    """Return the covariance of all values given one observed row a measured value and test, by precisions."""
    values, measured = len(known.covariance) // len(known.cases), known.noise.shape[1]
    precision = np.linalg.inv(known.covariance)
    for case in tests:
        rows = np.zeros((measured, len(precision)))
        rows[np.arange(measured), case * values + np.arange(measured)] = 1.0
        precision = precision + rows.T @ np.linalg.inv(known.noise[case]) @ rows
    return np.linalg.inv(precision)


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.lists(st.integers(0, 3), max_size=6), st.integers(1, 4))
def test_a_variance_is_that_of_the_posterior_with_the_tests_rows_added(seed, tests, repeats):
    known = made(seed)
    covariance = recomputed(known, tests)
    np.testing.assert_allclose(known.covariance_after(tests), covariance, rtol=1e-6, atol=1e-8)
    assert known.variance_after(tests) == pytest.approx(known.weights @ covariance @ known.weights, rel=1e-6)
    further = [known.weights @ recomputed(known, [*tests, *[case] * repeats]) @ known.weights for case in range(4)]
    np.testing.assert_allclose(known.variance_after_each(tests, repeats), further, rtol=1e-6)


def drawn(log_values: np.ndarray, weights: np.ndarray, noise: float) -> Forecast:
    """Return the forecast of a goal on k from draws, shape (draws, cases, parameters)."""
    cases = cases_of(log_values.shape[1])
    errors = np.broadcast_to(noise * np.eye(1), (len(cases), 1, 1))
    held = Candidates(cases, len(cases), ("k", "energy_per_cycle"), log_values, errors)
    return forecast(held, Goal("goal", "energy_per_cycle", weights, "cases"))


def test_a_goal_on_what_is_not_measured_gains_by_what_is_measured_with_it():
    rng = np.random.default_rng(1)
    k = rng.normal(0.0, 0.1, size=(4000, 2))
    energy = 2.0 * k + rng.normal(0.0, 0.05, size=(4000, 2))
    known = drawn(np.stack([k, energy], axis=-1), np.array([1.0, 0.0]), 0.01)
    # Var(energy) is 0.0425, and a test of k with error 0.01 takes Cov^2 / (0.01 + 0.01) = 0.02^2 / 0.02 = 0.02 of it;
    # 4000 draws know a variance within 2.2 %, standard deviation; 10 % is beyond 4 of them.
    assert known.variance_after(()) == pytest.approx(0.0425, rel=0.1)
    assert known.variance_after([0]) == pytest.approx(0.0225, rel=0.1)
    assert known.variance_after([1]) == pytest.approx(0.0425, rel=0.1)


def test_what_follows_from_measured_values_is_no_goal_in_a_new_case():
    cases = cases_of(2)
    held = Candidates(cases, 1, ("k", "energy_per_cycle"), np.ones((5, 2, 2)), np.ones((2, 1, 1)))
    goal = Goal("energy_per_cycle new", "energy_per_cycle", np.array([0.0, 1.0]), "one case")
    with pytest.raises(BadInput, match="name a case with records"):
        forecast(held, goal)
    assert forecast(held, goal._replace(parameter="k")).median == pytest.approx(np.e)


def test_a_width_is_the_full_interval_over_the_median():
    known = drawn(np.random.default_rng(2).normal(0.3, 0.02, size=(4000, 1, 2)), np.array([1.0]), 0.01)
    goal = np.exp(known.log_goal)
    lower, median, upper = np.quantile(goal, [0.025, 0.5, 0.975])
    assert known.median == pytest.approx(median, rel=1e-6)
    assert known.width() == pytest.approx((upper - lower) / median, rel=1e-4)
    # A quarter of the variance is half of the standard deviation.
    assert known.width(known.variance_after(()) / 4.0) == pytest.approx(known.width() / 2.0, rel=1e-2)


def test_a_forecast_is_doubtful_where_the_draws_are_skewed_or_have_heavy_tails():
    rng = np.random.default_rng(3)
    shape = (4000, 1, 2)
    draws = rng.normal(size=shape), rng.standard_exponential(shape), rng.standard_t(3, shape)
    assert [drawn(0.1 * one, np.ones(1), 0.01).doubtful for one in draws] == [False, True, True]


def width_by_quadrature(prior: Callable[[np.ndarray], np.ndarray], noise: float) -> float:
    """Return the mean width, over outcomes of a test of the goal itself, of the posterior after it, on grids."""
    value = np.linspace(-0.6, 0.9, 6001)
    outcome = np.linspace(-0.8, 1.1, 401)
    joint = prior(value) * stats.norm.pdf(outcome[:, None], value, np.sqrt(noise))
    shares = np.cumsum(joint, axis=1)
    mass = shares[:, -1]
    lower, middle, upper = np.exp([np.interp([0.025, 0.5, 0.975], s / m, value) for s, m in zip(shares, mass)]).T  # noqa: B905
    return float(np.average((upper - lower) / middle, weights=mass))


SHAPES: dict[str, Any] = {
    "normal": stats.norm(scale=0.05),
    "skewed": stats.expon(scale=0.05),
    "heavy": stats.t(3, scale=0.03),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_what_is_expected_is_right_whatever_the_shape_of_the_posterior(kind):
    shape, draws = SHAPES[kind], 20_000
    values = shape.ppf((np.arange(draws) + 0.5) / draws)[:, None, None]  # without Monte Carlo error of their own
    log_values = np.concatenate([values, values], axis=-1)  # the goal is what is measured
    known = drawn(log_values, np.ones(1), 0.05**2)
    actual = width_by_quadrature(shape.pdf, 0.05**2)
    value, method = known.expected([0])
    assert method == ("normal" if kind == "normal" else "reweighted")
    # The mean of 100 widths, which scatter by a quarter to a third, is known to 3 %: three of them.
    assert value == pytest.approx(actual, rel=0.02 if kind == "normal" else 0.09)
    if kind == "skewed":
        assert abs(known.width(known.variance_after([0])) / actual - 1.0) > 0.15  # what the normal update would say
    assert known.expected_after_each(1) == [known.expected([0])]
    assert known.expected(()).value == known.width()


def test_tests_that_leave_few_draws_with_weight_are_forecast_by_the_normal_update():
    values = SHAPES["skewed"].ppf((np.arange(2000) + 0.5) / 2000)[:, None, None]
    known = drawn(np.concatenate([values, values], axis=-1), np.ones(1), 1e-7)
    assert known.doubtful
    assert known.expected([0]) == (known.width(known.variance_after([0])), "normal")
