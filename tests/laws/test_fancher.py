"""Fancher's law: how its three forms (Eq. 1, Eq. 2, the limit) agree, and where they must not."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.laws.fancher import Fancher, equation_2, equation_2_offset, small_step_limit, small_step_limit_offset

K, C, X, BETA = 1.8, 10.0, 0.3, 0.05
LAW = Fancher(k=K, C=C, x=X, beta=BETA)


def recursion(path: np.ndarray, F: float) -> np.ndarray:
    """The force along a path by Eq. 1, step by step, towards the line k d + C + x or k d + C - x."""
    forces = [F]
    for before, d in pairwise(path):
        line = K * d + C + np.sign(d - before) * X
        F = line + (F - line) * np.exp(-abs(d - before) / BETA)
        forces.append(F)
    return np.array(forces)


def through(turns: list[float], steps: int) -> np.ndarray:
    """The turning points joined by the given number of even steps each."""
    legs = [np.linspace(a, b, steps + 1)[1:] for a, b in pairwise(turns)]
    return np.concatenate([[turns[0]], *legs])


@pytest.mark.parametrize("d", [3.0, 0.61, 0.6, 0.59, -2.0])
def test_equation_2_is_as_printed(d):
    d_i, F_i = 0.6, 9.0
    expected = F_i + ((K * d + C) - F_i) * (1 - np.exp(-abs(d - d_i) / BETA))
    assert equation_2(d, k=K, C=C, beta=BETA, d_i=d_i, F_i=F_i) == pytest.approx(expected, rel=1e-14)
    change = equation_2_offset(d - d_i, k=K, J=K * d_i + C - F_i, beta=BETA)
    assert F_i + change == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("u", [1e-12, 1e-6, -1e-6, 1e-3])
def test_small_moves_on_a_long_beta_keep_their_digits(u):
    expected = -np.expm1(-abs(u) / 1e3) * (0.7 + K * u)
    assert equation_2_offset(u, k=K, J=0.7, beta=1e3) == pytest.approx(expected, rel=1e-14, abs=0.0)
    change = small_step_limit(u, k=K, C=0.0, x=X, beta=1e3, d_i=0.0, F_i=0.0)
    series = (X * u + K * u * abs(u) / 2) / 1e3
    assert change == pytest.approx(series, rel=1e-6, abs=1e-15 * K * abs(u))


def test_equation_2_broadcasts_records_against_points():
    d = np.linspace(0.0, 3.0, 7) + np.zeros((2, 1))
    k, beta, F_i = np.array([[1.5], [2.5]]), np.array([[0.02], [0.3]]), np.array([[9.0], [8.0]])
    together = equation_2(d, k=k, C=C, beta=beta, d_i=d[:, :1], F_i=F_i)
    for row in range(2):
        alone = equation_2(d[row], k=k[row, 0], C=C, beta=beta[row, 0], d_i=d[row, 0], F_i=F_i[row, 0])
        np.testing.assert_array_equal(together[row], alone)


@pytest.mark.parametrize("d", [0.7, 2.0, 0.5, -1.0])
def test_one_step_of_equation_1_is_equation_2(d):
    d_i, F_i = 0.6, 9.0
    force = recursion(np.array([d_i, d]), F_i)
    line = C + np.sign(d - d_i) * X
    np.testing.assert_allclose(force[1], equation_2(d, k=K, C=line, beta=BETA, d_i=d_i, F_i=F_i), rtol=1e-14)


def test_equation_1_converges_to_the_limit_at_first_order():
    turns = [0.0, 0.2, 0.05, 0.3]
    exact = LAW.force(jnp.array(turns), 9.9)

    def error(steps: int) -> float:
        fine = recursion(through(turns, steps), 9.9)
        return float(jnp.max(jnp.abs(fine[::steps] - exact)))

    errors = np.array([error(steps) for steps in (100, 200, 400, 800, 1600)])
    ratios = errors[:-1] / errors[1:]
    assert np.all((ratios > 1.95) & (ratios < 2.05))
    assert abs(ratios[-1] - 2) < abs(ratios[0] - 2)


def test_limit_solves_its_differential_equation():
    d_i, F_i, h = 0.6, 9.0, 1e-6
    for s, d in [(1, 0.63), (1, 2.0), (-1, 0.57), (-1, -1.0)]:
        low, mid, high = (small_step_limit(v, k=K, C=C, x=X, beta=BETA, d_i=d_i, F_i=F_i) for v in (d - h, d, d + h))
        slope = s * (K * d + C + s * X - mid) / BETA
        assert (high - low) / (2 * h) == pytest.approx(float(slope), rel=1e-7)


compiled_force = jax.jit(lambda path: LAW.force(path, 9.5))


@settings(max_examples=50)
@given(st.lists(st.floats(0.0, 1.0), min_size=12, max_size=12))
def test_limit_does_not_depend_on_sampling(fractions):
    turns = [0.0, 0.4, 0.1, 0.9]
    path, corners = [turns[0]], [0]
    for leg, (a, b) in enumerate(pairwise(turns)):
        between = sorted(fractions[4 * leg : 4 * leg + 4])
        path += [a + f * (b - a) for f in between] + [b]
        corners.append(len(path) - 1)
    force, expected = compiled_force(np.array(path)), compiled_force(np.array(turns))
    np.testing.assert_allclose(force[np.array(corners)], expected, rtol=1e-13)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_offset_form_of_the_limit_is_the_limit(way):
    d_i, F_i = 0.6, 9.0
    u = way * np.linspace(0.0, 2.0, 41)
    J = K * d_i + C + way * (X - K * BETA) - F_i
    expected = small_step_limit(d_i + u, k=K, C=C, x=X, beta=BETA, d_i=d_i, F_i=F_i) - F_i
    np.testing.assert_allclose(small_step_limit_offset(u, k=K, J=J, beta=BETA), expected, rtol=0, atol=1e-13)


def test_equation_1_depends_on_sampling():
    # One coarse step lands on the envelope, fine ones lag it by k beta: why the limit is the law to fit.
    coarse = recursion(np.array([0.0, 1.0]), 9.5)[-1]
    fine = recursion(np.linspace(0.0, 1.0, 100_001), 9.5)[-1]
    assert float(coarse - fine) == pytest.approx(K * BETA, rel=1e-3)


def test_limit_lags_equation_2_by_up_to_k_beta():
    d = jnp.linspace(0.0, 2.0, 2001)
    lag = equation_2(d, k=K, C=C + X, beta=BETA, d_i=d[0], F_i=9.0) - LAW.force(d, 9.0)
    assert float(jnp.max(lag)) == pytest.approx(K * BETA, rel=1e-6)
    assert float(jnp.min(lag)) >= -1e-12


@pytest.mark.parametrize("x", [0.0, 0.02, K * BETA, 0.3])
@pytest.mark.parametrize("F_start", [2.0, 10.0, 15.0])
def test_force_settles_after_a_reversal(x, F_start):
    law = Fancher(k=K, C=C, x=x, beta=BETA)
    turns = jnp.array([0.0, 50 * BETA, 5 * BETA, 60 * BETA])
    direction = np.array([1, -1, 1])
    force = law.force(turns, F_start)[1:]
    np.testing.assert_allclose(force, K * turns[1:] + C + direction * (x - K * BETA), rtol=1e-12)


def test_unloading_mirrors_loading():
    path = jnp.array([0.0, 0.1, 0.03, 0.5])
    up = LAW.force(path, 9.8) - C
    down = LAW.force(-path, 2 * C - 9.8) - C
    np.testing.assert_allclose(down, -up, rtol=1e-12)


def test_law_is_a_spring_and_a_dahl_element():
    # The limit is a linear spring plus Dahl friction x - k beta: dz/dd = (friction - s z) / beta.
    path, friction = jnp.array([0.0, 0.1, 0.03, 0.5]), X - K * BETA
    z = [jnp.asarray(9.8 - C)]
    for a, b in pairwise(path):
        s = jnp.sign(b - a)
        z.append(s * friction + (z[-1] - s * friction) * jnp.exp(-jnp.abs(b - a) / BETA))
    np.testing.assert_allclose(LAW.force(path, 9.8), K * path + C + jnp.array(z), rtol=1e-13)


def test_vmap_over_parameters_is_a_loop():
    key = jax.random.key(0)
    k, c, x, beta = jax.random.uniform(key, (4, 6), minval=0.1, maxval=2.0)
    path = jnp.asarray(through([0.0, 1.0, 0.2], 5))
    laws = jax.vmap(Fancher)(k, c, x, beta)
    together = jax.jit(jax.vmap(lambda law: law.force(path, 1.0)))(laws)
    for i in range(6):
        alone = Fancher(k=k[i], C=c[i], x=x[i], beta=beta[i]).force(path, 1.0)
        np.testing.assert_allclose(together[i], alone, rtol=1e-12)
