"""The normal approximation at a mode: exact for a normal posterior, bounded at a flat one, none without a density."""

import numpy as np
import pytest
from jaxtyping import Float

from bayes_tyre.inference.sampling.posterior_mode import normal_approximation

#: Correlated and of three scales; points are asked for two at a time, so that the last of five is alone.
MODE = np.array([1.0, -2.0, 0.5, 3.0, 0.0])
ROOT = np.array([[1.0, 0, 0, 0, 0], [0.7, 0.5, 0, 0, 0], [0, 0, 0.1, 0, 0], [0, 0.3, 0, 1.5, 0], [0.2, 0, 0, 0, 1.0]])
PRECISION = np.linalg.inv(ROOT @ ROOT.T)
POINTS = 2


def normal(points: Float[np.ndarray, "points 5"]) -> tuple[np.ndarray, np.ndarray]:
    assert len(points) == POINTS
    off = points - MODE
    return 0.5 * np.einsum("pi,ij,pj->p", off, PRECISION, off), off @ PRECISION


def test_it_is_a_normal_posterior_itself():
    found = normal_approximation(normal, np.zeros(5), POINTS)
    assert found is not None
    # The search ends where the gradient is below 0.1.
    assert np.abs(PRECISION @ (found.mode - MODE)).max() < 0.1
    np.testing.assert_allclose(found.covariance, ROOT @ ROOT.T, rtol=1e-6, atol=1e-8)


def test_draws_have_its_mode_and_covariance():
    found = normal_approximation(normal, MODE, POINTS)
    assert found is not None
    draws = found.draw(4000, seed=1)
    z = np.linalg.solve(ROOT, (draws - MODE).T)
    # 5 means and 15 products of 4,000 standard normals: 5 standard errors are exceeded in 1e-5 of seeds.
    assert np.abs(z.mean(axis=1)).max() < 5 / np.sqrt(4000)
    assert np.abs(np.cov(z) - np.eye(5)).max() < 5 * np.sqrt(2 / 4000)


def test_a_flat_direction_has_a_standard_deviation_of_two():
    def flat(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 0.5 * points[:, 0] ** 2, points * [1.0, 0.0]

    found = normal_approximation(flat, np.array([1.0, 7.0]), POINTS)
    assert found is not None
    np.testing.assert_allclose(found.covariance, np.diag([1.0, 4.0]), atol=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_without_a_density_there_is_none(value):
    def nowhere(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.full(len(points), value), np.full(points.shape, np.nan)

    assert normal_approximation(nowhere, np.zeros(3), POINTS) is None


def test_with_a_covariance_only_the_mode_is_found_and_at_once():
    taken = []

    def counted(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        taken.append(points)
        return normal(points)

    covariance = ROOT @ ROOT.T
    found = normal_approximation(counted, MODE + 3.0, POINTS, covariance)
    assert found is not None
    assert found.covariance is covariance
    # In its own units a normal posterior is round: two or three points lead to the mode.
    assert len(taken) <= 4
    np.testing.assert_allclose(found.mode, MODE, atol=0.1)
