"""The scan for valleys of the profile: its sums are the RSS, on fewer points too, and points may stand in any order."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from helpers.one_record import NAN, fit_one

from bayes_tyre.inference.least_squares.beta_grid import _POINTS, _averaged, _sums_on_grid, grid_minima
from bayes_tyre.inference.least_squares.parameters import BETA, F_I, C, K
from bayes_tyre.inference.least_squares.scaled_problem import Problem, scale_problem
from bayes_tyre.inference.least_squares.small_linear_algebra import residual_of_last
from bayes_tyre.inference.least_squares.starting_values import SCANNED_BETAS
from bayes_tyre.inference.least_squares.variable_projection import ends, optimum, profile_of, solve

LONG = 400


def curve(points: int, beta: float, noise: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    u = 1.5 * (1 - np.cos(np.pi * np.linspace(0, 1, points)))
    noisy = noise * np.random.default_rng(seed).normal(size=points)
    return 10 + u, 14 + (0.4 + 1.6 * u) * -np.expm1(-u / beta) + noisy


def profile(d: np.ndarray, F: np.ndarray, free: tuple[int, ...]):
    fixed = jnp.full(5, NAN).at[K].set(NAN if K in free else 1.6)
    problem = Problem(jnp.asarray(d), jnp.asarray(F), jnp.ones(len(d), bool), fixed, jnp.full((1, 5), NAN))
    return profile_of(scale_problem(problem, free))


@pytest.mark.parametrize("free", [(K, C, BETA), (K, C, BETA, F_I), (C, BETA)])
@pytest.mark.parametrize("points", [40, LONG])
def test_the_sums_are_the_rss_of_the_best_fit_for_each_beta(points, free):
    @jax.jit
    def both(record):
        sums, rounding = _sums_on_grid(record, optimum(record, ends(record)[0], free), free, None)
        betas = SCANNED_BETAS[1] * 2.0 ** (-jnp.arange(len(sums)) / 3)
        return sums, rounding, jax.lax.map(lambda beta: optimum(record, beta, free).rss, betas)

    sums, rounding, rss = (np.asarray(found) for found in both(profile(*curve(points, 0.1, 0.03), free)))
    if points <= _POINTS:
        np.testing.assert_allclose(sums, rss, rtol=1e-9, atol=float(rounding))
    else:  # neighbours at their mean: their own scatter is missing, and is the same for every beta
        np.testing.assert_allclose(sums - sums.min(), rss - rss.min(), atol=1e-3 * np.ptp(rss))
        assert abs(sums.argmin() - rss.argmin()) <= 1


def test_small_betas_of_an_exact_record_are_told_apart():
    """E is 1e-9 at the second point: products of the forces would lose its square, those of what is left do not."""
    free = (K, C, BETA)
    u = curve(40, 1.0, 0.0)[0] - 10
    beta = u[1] / (9 * np.log(10))
    record = profile(10 + u, 14 + (0.4 + 1.6 * u) * -np.expm1(-u / beta), free)
    found = grid_minima(record, optimum(record, ends(record)[0], free), free)
    assert float(found.log_betas[0]) == pytest.approx(np.log(beta / u[-1]), abs=np.log(2) / 3)


def test_points_far_from_their_neighbours_are_not_put_together():
    d, F = curve(LONG, 0.1, 0.03)
    apart = [bool(_averaged(profile(*rows, (K, C, BETA)))[2]) for rows in ((d, F), shuffled(d, F))]
    assert apart == [False, True]


def shuffled(d: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.append(0, 1 + np.random.default_rng(0).permutation(len(d) - 1))
    return d[order], F[order]


def test_a_long_record_gives_the_same_in_any_order():
    d, F = curve(LONG, 0.02, 0.03)
    here, there = fit_one(d, F), fit_one(*shuffled(d, F))
    assert here.value == pytest.approx(there.value, rel=1e-7)
    assert here.standard_error == pytest.approx(there.standard_error, rel=1e-7, nan_ok=True)


def test_a_start_that_is_not_wanted_is_not_looked_at():
    record, start = profile(*curve(40, 0.1, 0.03), (K, C, BETA)), jnp.log(0.05)
    found = solve(record, start, jnp.array(False), (K, C, BETA), 1e-11, 64)
    assert found.result == optx.RESULTS.successful
    assert found.stats["num_steps"] == 0
    assert np.isinf(found.state.f)


def test_what_is_left_of_the_last_column_is_its_distance_from_the_others():
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(4, 30))
    columns[1] = 2.0 * columns[0]  # takes nothing out that the first has not
    products = [[jnp.asarray(a @ b) for b in columns[: i + 1]] for i, a in enumerate(columns)]
    _, (expected,), *_ = np.linalg.lstsq(columns[[0, 2]].T, columns[3])
    assert float(residual_of_last(products)) == pytest.approx(expected, rel=1e-12)
