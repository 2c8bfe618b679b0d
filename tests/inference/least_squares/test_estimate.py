"""Least squares on Equation 2: the optimum itself, standard errors, coverage, failures as values."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.one_record import NAN, POINTS, Fit, equation_2, fit_one, record, rows
from helpers.simulated_records import Plan, simulate
from scipy import optimize, stats

from bayes_tyre.batch import batches
from bayes_tyre.inference.least_squares.estimate import estimate_batch
from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, C, K
from bayes_tyre.inference.least_squares.scaled_problem import Problem


def finite_difference_errors(d: np.ndarray, F: np.ndarray, value: np.ndarray, free: list[int]) -> np.ndarray:
    """Standard errors from RSS / (points - fitted) and a Jacobian by central differences, in numpy alone."""
    steps = np.diag(1e-5 * np.abs(value))[free]
    jacobian = np.stack([(equation_2(d, value + h) - equation_2(d, value - h)) / (2 * h.sum()) for h in steps], axis=1)
    variance = np.sum((F - equation_2(d, value)) ** 2) / (len(d) - len(free))
    return np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian)))


@pytest.mark.parametrize("sign", [1, -1])
def test_standard_errors_are_those_of_a_finite_difference_jacobian(sign):
    d, F, _ = record(sign=sign, noise=0.03)
    found = fit_one(d, F)
    expected = finite_difference_errors(d, F, found.value, [K, C, BETA])
    np.testing.assert_allclose(found.standard_error[[K, C, BETA]], expected, rtol=1e-6)
    assert found.rss == pytest.approx(np.sum((F - equation_2(d, found.value)) ** 2), rel=1e-12)


def test_residuals_are_orthogonal_to_the_tangents():
    # The stationary point itself, whatever the solver says of it: no multiple of any tangent lowers the RSS.
    d, F, _ = record(noise=0.03)
    value = fit_one(d, F).value
    residual = F - equation_2(d, value)
    for i in (K, C, BETA):
        h = np.zeros(5)
        h[i] = 1e-5 * abs(value[i])
        tangent = equation_2(d, value + h) - equation_2(d, value - h)
        assert abs(tangent @ residual) < 1e-7 * np.linalg.norm(tangent) * np.linalg.norm(residual)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_freed_d_i_is_the_best_that_many_starts_find_though_every_point_is_a_kink(seed):
    d, F, truth = record(beta=0.15, noise=0.03, seed=seed)
    found = fit_one(d, F, (K, C, BETA, D_I))
    best = np.inf
    for d_i in 10.0 + np.array([-0.3, -0.1, -0.03, 0.005, 0.02, 0.05, 0.09, 0.15, 0.25]):
        best = min(best, 2 * nonlinear_cost(d, F, truth, d_i))
    assert found.converged
    assert found.rss <= best * (1 + 1e-9)


def nonlinear_cost(d: np.ndarray, F: np.ndarray, truth: np.ndarray, d_i: float) -> float:
    """Half the RSS where scipy ends from the truth with another d_i; k, C, log beta and d_i free."""

    def residual(x: np.ndarray) -> np.ndarray:
        return equation_2(d, np.array([x[0], x[1], np.exp(x[2]), x[3], F[0]])) - F

    start = np.array([truth[K], truth[C], np.log(truth[BETA]), d_i])
    return float(optimize.least_squares(residual, start, x_scale="jac", xtol=1e-13, ftol=1e-13).cost)


FITTED = [K, C, BETA, F_I]


@pytest.fixture(scope="module")
def simulated() -> tuple[np.ndarray, np.ndarray, np.ndarray, Fit]:
    """512 records with noise on every point: displacement, force, truth (k, beta), and the estimates, F_i free."""
    table, truth = simulate(Plan(repeats=32), seed=11)
    (batch,) = batches(table)
    nan = jnp.full((len(batch.records), 5), NAN)
    d, F, used = map(jnp.asarray, (batch.displacement_mm, batch.force_kN, batch.present))
    estimates = estimate_batch(Problem(d, F, used, nan, nan[:, None]), tuple(FITTED))
    truth = truth.set_index("record").loc[list(batch.records), ["k", "beta"]].to_numpy()
    return batch.displacement_mm[:, :60], batch.force_kN[:, :60], truth, Fit(*map(np.asarray, estimates))


@pytest.mark.slow
@pytest.mark.parametrize(("parameter", "column"), [(K, 0), (BETA, 1)], ids=["k", "beta"])
def test_intervals_cover_the_truth_as_often_as_they_say(simulated, parameter, column):
    _, _, truth, found = simulated
    assert found.converged.all()
    half = stats.t.ppf(0.975, 60 - len(FITTED)) * found.standard_error[:, parameter]
    covered = np.abs(found.value[:, parameter] - truth[:, column]) < half
    # If coverage is 95 %, a seed in 1000 leaves this range (binomial, 512 records: 91.6 to 97.9 %).
    low, high = stats.binom.interval(1 - 1e-3, len(covered), 0.95)
    assert low <= covered.sum() <= high


def test_estimates_scatter_about_the_truth_by_their_standard_error(simulated):
    _, _, truth, found = simulated
    for parameter, column in ((K, 0), (BETA, 1)):
        z = (found.value[:, parameter] - truth[:, column]) / found.standard_error[:, parameter]
        # A bias of a fifth of a standard error would be 4.5 of its own; the bound is passed by chance 1 time in 1e4.
        assert abs(z.mean()) < 3.9 / np.sqrt(len(z))


def test_standard_errors_with_F_i_free_are_those_of_a_finite_difference_jacobian(simulated):
    d, F, _, found = simulated
    for i in (0, 100, 511):
        expected = finite_difference_errors(d[i], F[i], found.value[i], FITTED)
        np.testing.assert_allclose(found.standard_error[i, FITTED], expected, rtol=1e-6)


def test_d_i_is_the_first_point_unless_given_or_fitted(simulated):
    d, _, _, found = simulated
    np.testing.assert_array_equal(found.value[:, D_I], d[:, 0])
    assert np.isnan(found.standard_error[:, D_I]).all()


def test_a_record_that_cannot_be_fitted_is_a_value_and_spoils_no_neighbour():
    d, F, _ = record(noise=0.03)
    spoilt = np.stack([F, np.where(np.arange(POINTS) == 12, np.inf, F), F])
    nan = jnp.full((3, 5), NAN)
    problems = Problem(jnp.array([d] * 3), jnp.asarray(spoilt), jnp.ones((3, POINTS), bool), nan, nan[:, None])
    found = rows(estimate_batch(problems, (K, C, BETA)), ["before", "spoilt", "behind"])
    assert not found["spoilt"].converged
    assert found["before"].converged
    np.testing.assert_array_equal(found["before"].value, found["behind"].value)
    np.testing.assert_allclose(found["before"].value, fit_one(d, F).value, rtol=1e-9)
