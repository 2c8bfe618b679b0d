"""Gradients of Fancher's law: right against central differences, and finite everywhere a sampler may go."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.laws.fancher import Fancher, equation_2, equation_2_offset, small_step_limit

many = settings(max_examples=300)
some = settings(max_examples=100)

betas = st.floats(-6.0, 3.0).map(lambda power: 10.0**power)
slopes, forces = st.floats(0.1, 5.0), st.floats(-20.0, 40.0)
frictions = st.floats(0.0, 3.0)
starts = st.sampled_from([0.0, 0.6, -3.0, 7.3])
directions = st.sampled_from([-1.0, 1.0])
# Moves in units of beta, where the law bends, and in mm, where it is often long settled or hardly begun.
moves = st.tuples(st.floats(-2.0, 1.6).map(lambda power: 10.0**power), st.booleans())


def eq_2(theta):
    d, d_i, beta, k, C, F_i = theta
    return equation_2(d, k=k, C=C, beta=beta, d_i=d_i, F_i=F_i)


def eq_2_offset(theta):
    u, beta, k, J = theta
    return equation_2_offset(u, k=k, J=J, beta=beta)


def limit(theta):
    d, d_i, beta, k, C, F_i, x = theta
    return small_step_limit(d, k=k, C=C, x=x, beta=beta, d_i=d_i, F_i=F_i)


class Compiled(NamedTuple):
    value: jax.stages.Wrapped
    gradient: jax.stages.Wrapped


FUNCTIONS = {f: Compiled(jax.jit(jax.vmap(jax.vmap(f))), jax.jit(jax.grad(f))) for f in (eq_2, eq_2_offset, limit)}


def powers_of_two(steps: np.ndarray) -> np.ndarray:
    """The next smaller powers of two, so that a displacement plus a step is exact."""
    return 2.0 ** np.floor(np.log2(steps))


def check_gradient(function, theta: list[float], steps: list[float], scale: float) -> None:
    """Compare with five-point central differences; `scale` is the size of the terms of the force.

    The slack is the differences' own error, rounding and truncation, which stays where the terms cancel.
    """
    point, h = np.array(theta), powers_of_two(np.array(steps))
    shifts = np.array([-2.0, -1.0, 1.0, 2.0])
    values = FUNCTIONS[function].value(point + shifts[:, None, None] * np.diag(h))
    expected = np.array([1.0, -8.0, 8.0, -1.0]) @ np.asarray(values) / (12 * h)
    slack = 1024 * np.finfo(float).eps * scale / h
    gradient = np.asarray(FUNCTIONS[function].gradient(point))
    assert np.all(np.abs(gradient - expected) <= 2e-6 * np.abs(expected) + slack), (gradient, expected, slack)


def move_and_steps(move: tuple[float, bool], direction: float, beta: float) -> tuple[float, float, float]:
    """The signed move u, mm, and steps in displacement and in beta that stay on its side and resolve its bend."""
    length = move[0] * (beta if move[1] else 1.0)
    along = min(beta / 256, length / 4)
    return direction * length, along, beta / 512 / np.clip(length / beta, 1.0, 40.0)


@many
@given(moves, directions, betas, slopes, forces, forces, starts)
def test_gradient_of_equation_2(move, direction, beta, k, C, F_i, d_i):
    u, along, h_beta = move_and_steps(move, direction, beta)
    theta = [d_i + u, d_i, beta, k, C, F_i]
    scale = abs(F_i) + abs(C) + k * (abs(d_i) + abs(u))
    if abs(theta[0] - d_i) > 3 * along:  # a move lost to rounding of d has no side to difference on
        check_gradient(eq_2, theta, [along, along, h_beta, 0.1, 1.0, 1.0], scale)


@many
@given(moves, directions, betas, slopes, forces)
def test_gradient_of_equation_2_offset(move, direction, beta, k, J):
    u, along, h_beta = move_and_steps(move, direction, beta)
    check_gradient(eq_2_offset, [u, beta, k, J], [along, h_beta, 0.1, 1.0], abs(J) + k * abs(u))


@many
@given(moves, directions, betas, slopes, forces, forces, starts, frictions)
def test_gradient_of_the_limit(move, direction, beta, k, C, F_i, d_i, x):
    u, along, h_beta = move_and_steps(move, direction, beta)
    theta = [d_i + u, d_i, beta, k, C, F_i, x]
    scale = abs(F_i) + abs(C) + x + k * (abs(d_i) + 2 * abs(u))
    if abs(theta[0] - d_i) > 3 * along:
        check_gradient(limit, theta, [along, along, h_beta, 0.1, 1.0, 1.0, 1.0], scale)


@some
@given(betas, slopes, forces, forces, starts)
def test_gradient_of_equation_2_at_its_start(beta, k, C, F_i, d_i):
    gradient = FUNCTIONS[eq_2].gradient(np.array([d_i, d_i, beta, k, C, F_i]))
    np.testing.assert_array_equal(gradient, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@some
@given(betas, slopes, forces, forces, starts, frictions)
def test_gradient_of_the_limit_at_its_start(beta, k, C, F_i, d_i, x):
    by_d, by_start, *others = FUNCTIONS[limit].gradient(np.array([d_i, d_i, beta, k, C, F_i, x]))
    # Loading starts with slope (line + x - F_i) / beta, unloading with (F_i - line + x) / beta: mean x / beta.
    assert by_d == pytest.approx(x / beta, rel=1e-9, abs=1e-9)
    assert by_start == pytest.approx(-x / beta, rel=1e-9, abs=1e-9)
    np.testing.assert_array_equal(others, [0.0, 0.0, 0.0, 1.0, 0.0])


def test_limit_at_its_start_has_the_slope_of_a_central_difference():
    def force(d):
        return small_step_limit(d, k=1.8, C=10.0, x=0.3, beta=0.05, d_i=0.6, F_i=11.0)

    h = 1e-7
    assert jax.grad(force)(0.6) == pytest.approx(float(force(0.6 + h) - force(0.6 - h)) / (2 * h), rel=1e-5)


SHAPE = np.array([0.0, 1.0, 1.0, 2.5, 0.7, -0.4, -0.4, 3.0])
WEIGHTS = np.array([0.3, -1.0, 0.7, 1.1, -0.5, 0.9, 0.2, 1.3])


def path_of_limit(theta, stretch):
    k, C, x, beta, F_start = theta
    return WEIGHTS @ Fancher(k=k, C=C, x=x, beta=beta).force(stretch * SHAPE, F_start)


PATHS = Compiled(jax.jit(jax.vmap(jax.vmap(path_of_limit, (0, None)), (0, None))), jax.jit(jax.grad(path_of_limit)))


@some
@given(slopes, forces, frictions, betas, forces, st.floats(-2.0, 1.6))
def test_gradient_along_a_path(k, C, x, beta, F_start, power):
    stretch = min(beta * 10.0**power, 10.0)
    theta = np.array([k, C, x, beta, F_start])
    h = np.array([0.1, 1.0, 1.0, beta / 512 / np.clip(3.4 * stretch / beta, 1.0, 40.0), 1.0])
    shifts = np.array([-2.0, -1.0, 1.0, 2.0])
    values = np.asarray(PATHS.value(theta + shifts[:, None, None] * np.diag(h), stretch))
    expected = np.array([1.0, -8.0, 8.0, -1.0]) @ values / (12 * h)
    scale = abs(F_start) + abs(C) + x + 7 * k * stretch
    slack = 1024 * np.finfo(float).eps * scale / h
    gradient = np.asarray(PATHS.gradient(theta, stretch))
    assert np.all(np.abs(gradient - expected) <= 2e-6 * np.abs(expected) + slack), (gradient, expected, slack)


@pytest.mark.parametrize("beta", [1e-6, 1e-4, 1e-2, 1.0, 1e3])
@pytest.mark.parametrize("function", [eq_2, limit])
def test_values_and_derivatives_are_finite(function, beta):
    sizes = np.array([0.0, 5e-324, 1e-300, 1e-16, 1e-9, 1e-6, 1e-4, 1e-2, 1.0, 40.0, 1e3, 1e6])
    d = np.concatenate([-sizes, sizes])
    rest = (0.0, beta, 1.8, 10.0, 9.0, 0.3)[: 5 if function is eq_2 else 6]
    theta = np.stack(np.broadcast_arrays(d, *rest), axis=-1)
    for derivative in (function, jax.grad(function), jax.jacfwd(function)):
        assert np.all(np.isfinite(jax.jit(jax.vmap(derivative))(theta)))


@pytest.mark.parametrize("mode", [jax.jacrev, jax.jacfwd])
def test_path_gradients_are_finite(mode):
    beta, stretch = np.meshgrid([1e-6, 1e-4, 1e-2, 1.0, 1e3], [0.0, 1e-300, 1e-9, 1e-3, 1.0, 1e3])
    theta = np.stack(np.broadcast_arrays(1.8, 10.0, 0.3, beta.ravel(), 9.0), axis=-1)
    for gradient in jax.jit(jax.vmap(mode(path_of_limit, argnums=(0, 1))))(theta, stretch.ravel()):
        assert np.all(np.isfinite(gradient))


def test_gradient_by_a_law_is_a_law():
    law = Fancher(k=1.8, C=10.0, x=0.3, beta=0.05)
    path = jnp.array([0.0, 0.3, 0.1])
    gradient = jax.grad(lambda law: law.force(path, 9.0)[-1])(law)
    assert isinstance(gradient, Fancher)
    np.testing.assert_allclose(gradient.C, 1 - np.exp(-0.5 / 0.05), rtol=1e-12)
