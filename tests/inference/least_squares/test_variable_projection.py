"""The profile over log beta: its derivatives, its solver, and that it ends where the fit of all parameters does."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from helpers.one_record import NAN, record

from bayes_tyre.inference.least_squares.estimate import estimate_record
from bayes_tyre.inference.least_squares.parameters import BETA, F_I, C, K
from bayes_tyre.inference.least_squares.scalar_newton import Derivatives, ScalarNewton
from bayes_tyre.inference.least_squares.scaled_problem import Problem, scale_problem
from bayes_tyre.inference.least_squares.small_linear_algebra import r_factor
from bayes_tyre.inference.least_squares.variable_projection import optimum, profile_at, profile_of


def problem_of(seed: int, fixed_k: float = NAN) -> Problem:
    d, F, _ = record(beta=0.15, noise=0.05, seed=seed)
    fixed = jnp.full(5, NAN).at[K].set(fixed_k)
    return Problem(jnp.asarray(d), jnp.asarray(F), jnp.ones(len(d), bool), fixed, jnp.full((1, 5), NAN))


@pytest.mark.parametrize("free", [(K, C, BETA, F_I), (C, BETA)])
def test_slope_and_curvature_are_the_derivatives_of_the_profile(free):
    profile = profile_of(scale_problem(problem_of(1, 1.5 if K not in free else NAN), free))

    def half(log_beta):
        return 0.5 * optimum(profile, jnp.exp(log_beta), free).rss

    value, derivatives, _ = jax.jit(lambda beta: profile_at(profile, beta, free))(0.06)
    assert derivatives.exact
    assert value == pytest.approx(float(half(jnp.log(0.06))), rel=1e-9)
    assert derivatives.slope == pytest.approx(float(jax.grad(half)(jnp.log(0.06))), rel=1e-7)
    assert derivatives.curvature == pytest.approx(float(jax.hessian(half)(jnp.log(0.06))), rel=1e-6)


@pytest.mark.parametrize("free", [(K, C, BETA), (K, C, BETA, F_I), (C, BETA)])
def test_the_profile_ends_where_the_fit_of_all_parameters_does(free):
    problems = [problem_of(seed, 1.5 if K not in free else NAN) for seed in range(4)]
    batch = jax.tree.map(lambda *fields: jnp.stack(fields), *problems)
    full, short = (
        jax.jit(jax.vmap(lambda problem, alone=alone: estimate_record(problem, free, alone)))(batch)
        for alone in (False, True)
    )
    assert full.converged.all()
    assert short.converged.all()
    np.testing.assert_allclose(short.rss, full.rss, rtol=1e-11)
    index = list(free)
    off = np.abs(short.value - full.value)[:, index]
    assert np.all(off < 1e-6 * full.standard_error[:, index])
    np.testing.assert_allclose(short.standard_error, full.standard_error, rtol=1e-6)
    np.testing.assert_array_equal(short.beta_open_below, full.beta_open_below)
    np.testing.assert_array_equal(short.beta_open_above, full.beta_open_above)


def test_a_start_ends_in_the_valley_that_it_lies_in():
    def valleys(y, _):  # lowest at -1.04 and at 0.96, with a ridge between
        value, slope, bend = (y**2 - 1) ** 2 + 0.3 * y + 1, 4 * y**3 - 4 * y + 0.3, 12 * y**2 - 4
        return value, Derivatives(slope, jnp.where(bend > 0, bend, 1.0), bend > 0)

    solver = ScalarNewton(low=jnp.array(-3.0), high=jnp.array(3.0), rtol=1e-12, atol=1e-12, ftol=jnp.array(0.0))
    roots = np.sort(np.roots([4, 0, -4, 0.3]).real)
    for start, end in ((-2.5, roots[0]), (0.5, roots[2]), (2.5, roots[2])):
        found = optx.minimise(valleys, solver, jnp.array(start), has_aux=True, throw=False)
        assert found.result == optx.RESULTS.successful
        assert float(found.value) == pytest.approx(end, abs=1e-9)


def test_an_end_of_the_interval_is_reached_exactly():
    solver = ScalarNewton(low=jnp.array(-1.0), high=jnp.array(2.0), rtol=1e-12, atol=1e-12, ftol=jnp.array(0.0))
    found = optx.minimise(
        lambda y, _: ((y - 5.0) ** 2 + 1.0, Derivatives(2.0 * (y - 5.0), jnp.array(2.0), jnp.array(True))),
        solver,
        jnp.array(0.0),
        has_aux=True,
        throw=False,
    )
    assert float(found.value) == 2.0


def test_the_triangle_is_that_of_householder_though_columns_are_nearly_alike():
    rng = np.random.default_rng(2)
    matrix = rng.normal(size=(40, 1)) + 1e-6 * rng.normal(size=(40, 3))
    found = np.asarray(r_factor([jnp.asarray(column) for column in matrix.T]))
    expected = np.linalg.qr(matrix, mode="r")
    np.testing.assert_allclose(np.abs(found), np.abs(expected), rtol=1e-9, atol=1e-15)
    assert np.all(r_factor([jnp.zeros(4), jnp.ones(4)]) == np.array([[0.0, 0.0], [0.0, 2.0]]))
