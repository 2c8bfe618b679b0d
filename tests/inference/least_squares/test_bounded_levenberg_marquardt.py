"""The lowest point of a quadratic in a box, and the solver that steps to it: against enumeration, KKT and scipy."""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy import optimize

from bayes_tyre.inference.least_squares.bounded_levenberg_marquardt import BoxLevenbergMarquardt
from bayes_tyre.inference.least_squares.small_linear_algebra import minimise_bounded_quadratic, solve_positive


def quadratics(n: int, likeness: float, count: int, seed: int) -> tuple[np.ndarray, ...]:
    """Convex quadratics whose columns are nearly alike (`likeness` towards 0), and boxes around zero."""
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(count, 12, 1)) + likeness * rng.normal(size=(count, 12, n))
    H = np.einsum("nij,nik->njk", J, J)
    gradient = rng.normal(size=(count, n)) * np.sqrt(np.einsum("njj->nj", H))
    return H, gradient, -rng.exponential(size=(count, n)), rng.exponential(size=(count, n))


@pytest.mark.parametrize("n", [1, 2, 3, 5])
@pytest.mark.parametrize("likeness", [1.0, 1e-2, 1e-5])
def test_the_lowest_point_meets_the_conditions_of_karush_kuhn_and_tucker(n, likeness):
    H, gradient, low, high = quadratics(n, likeness, 2000, seed=n)
    low[:200], high[200:400] = -np.inf, np.inf
    x = np.asarray(jax.jit(jax.vmap(minimise_bounded_quadratic))(*map(jnp.asarray, (H, gradient, low, high))))
    assert np.all((low <= x) & (x <= high))
    size = np.sqrt(np.einsum("njj->nj", H))
    slope = (np.einsum("njk,nk->nj", H, x) + gradient) / size
    against = np.where(x <= low, np.minimum(slope, 0), np.where(x >= high, np.maximum(slope, 0), slope))
    # Rounding of H x, which is as large as its largest part.
    scale = np.abs(gradient / size).max(axis=1) + np.abs(x * size).max(axis=1)
    assert np.abs(against).max(axis=1) == pytest.approx(0.0, abs=1e-9 * scale.max())
    assert np.all(np.abs(against).max(axis=1) < 1e-9 * scale)


def test_the_lowest_point_is_the_best_of_all_faces():
    H, gradient, low, high = quadratics(3, 1e-2, 20, seed=4)
    found = np.asarray(jax.vmap(minimise_bounded_quadratic)(*map(jnp.asarray, (H, gradient, low, high))))
    for h, g, lo, hi, x in zip(H, gradient, low, high, found, strict=True):
        best = min(
            height for face in product((-1, 0, 1), repeat=3) if (height := on_face(h, g, lo, hi, face)) is not None
        )
        assert x @ h @ x / 2 + g @ x == pytest.approx(best, rel=1e-9)


def on_face(h: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray, face: tuple[int, ...]) -> float | None:
    """The lowest value with unknowns held at low (-1) or high (1), or nothing where the others leave the box."""
    side = np.array(face)
    x, free = np.where(side < 0, low, high), side == 0
    if free.any():
        x[free] = np.linalg.solve(h[np.ix_(free, free)], -g[free] - h[np.ix_(free, ~free)] @ x[~free])
    return float(x @ h @ x / 2 + g @ x) if np.all((low - 1e-12 <= x) & (x <= high + 1e-12)) else None


def test_unknowns_that_others_replace_are_zero_and_the_rest_is_solved():
    rng = np.random.default_rng(1)
    J = rng.normal(size=(9, 4))
    J = np.stack([J[:, 0], 1e-9 * J[:, 1], 3 * J[:, 0], np.zeros(9), J[:, 2]], axis=1)
    right = J.T @ rng.normal(size=9)
    x = np.asarray(solve_positive(jnp.asarray(J.T @ J), jnp.asarray(right)))
    assert x[[2, 3]].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(J.T @ J @ x, right, rtol=1e-9, atol=1e-30)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((-np.inf, -np.inf), (np.inf, np.inf)),
        ((-np.inf, -np.inf), (0.5, np.inf)),
        ((-np.inf, 1.5), (np.inf, np.inf)),
        ((-2.0, -1.0), (0.2, 0.02)),
        ((1.0, 1.0), (3.0, 3.0)),
    ],
)
def test_rosenbrock_s_valley_in_a_box_ends_where_scipy_does(low, high):
    def residual(y, _):
        return jnp.stack([10.0 * (y[1] - y[0] ** 2), 1.0 - y[0]])

    lo, hi = np.array(low), np.array(high)
    start = np.clip([-1.2, 1.0], lo + 1e-3, hi - 1e-3)
    solver = BoxLevenbergMarquardt(low=jnp.asarray(lo), high=jnp.asarray(hi), rtol=1e-12, atol=1e-12)
    found = optx.least_squares(residual, solver, jnp.asarray(start), max_steps=500).value
    expected = optimize.least_squares(lambda y: np.asarray(residual(y, None)), start, bounds=(lo, hi), xtol=1e-15)
    assert np.all((lo <= found) & (found <= hi))
    np.testing.assert_allclose(found, expected.x, atol=2e-5)  # scipy stays strictly inside
    assert np.sum(np.asarray(residual(found, None)) ** 2) <= 2 * expected.cost + 1e-15
