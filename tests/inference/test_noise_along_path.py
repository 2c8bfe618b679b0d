"""Noise near the start against that elsewhere: sizes, degrees of freedom and likelihoods against NumPy and SciPy."""

import numpy as np
import pytest
from scipy import stats

from bayes_tyre.inference.noise_along_path import freedom, log_likelihood, near_start, variance_ratio

RECORDS, POINTS = 40, 50


def padded() -> tuple[np.ndarray, np.ndarray]:
    """Return which points are present, the last records shorter, and displacements in mm."""
    present = np.arange(POINTS) < np.where(np.arange(RECORDS) < 30, POINTS, 30)[:, None]
    return present, np.where(present, np.linspace(0.0, -5.0, POINTS), 0.0)


def test_near_is_what_lies_within_reach_on_either_way():
    present, u = padded()
    near = near_start(u, np.full(RECORDS, 1.0), present)
    np.testing.assert_array_equal(near, present & (np.abs(u) < 1.0))
    assert near.any()
    assert not near.all()


def test_the_ratio_of_variances_is_found_with_its_error():
    """Of 20 sets each z is standard normal: one beyond 4.5 comes up in one of 7,000 runs; their mean square is
    chi-square, outside 0.3 to 2.3 with probability 1e-3.
    """
    present, u = padded()
    near = near_start(u, np.full(RECORDS, 1.5), present)
    columns = np.stack([np.ones_like(u), u], axis=2) * present[:, :, None]
    z = []
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal(u.shape) * np.where(near, 3.0, 1.0) * present
        weighted = columns * np.where(near, 1.0 / 3.0, 1.0)[:, :, None]
        # Weighted least squares in NumPy: what it leaves is what a record's residuals are.
        left = np.stack(
            [
                y - x @ np.linalg.lstsq(w, v, rcond=None)[0]
                for y, x, w, v in zip(noise, columns, weighted, noise * np.where(near, 1 / 3, 1.0), strict=True)
            ]
        )
        found = variance_ratio(left**2, freedom(weighted, present), near)
        z.append((found.value - 2.0 * np.log(3.0)) / found.error)
        assert found.gain > 100.0
    assert np.abs(z).max() < 4.5
    assert 0.3 < np.mean(np.square(z)) < 2.3


def test_a_part_of_few_points_says_nothing():
    present, u = padded()
    near = near_start(u, np.zeros(RECORDS), present)
    found = variance_ratio(np.ones(u.shape), present.astype(float), near)
    assert (found.value, found.error, found.gain) == (0.0, np.inf, 0.0)
    without_noise = variance_ratio(np.zeros(u.shape), present.astype(float), near_start(u, np.ones(RECORDS), present))
    assert (without_noise.value, without_noise.error) == (0.0, np.inf)


def test_a_fit_leaves_as_many_degrees_of_freedom_as_points_less_parameters():
    present, u = padded()
    columns = np.stack([np.ones_like(u), u, u**2], axis=2) * present[:, :, None]
    left = freedom(columns, present)
    np.testing.assert_allclose(left.sum(axis=1), present.sum(axis=1) - 3, rtol=1e-12)
    assert not left[~present].any()


def test_the_likelihood_is_that_of_normal_residuals_at_the_likeliest_size():
    present, u = padded()
    random = np.random.default_rng(1)
    variance, residual = np.exp(random.normal(size=u.shape)), random.normal(size=u.shape) * present
    ours = [log_likelihood(residual**2, each, present.astype(float)) for each in (variance, np.ones_like(variance))]
    theirs = []
    for each in (variance, np.ones_like(variance)):
        total = 0.0
        for y, v, here in zip(residual, each, present, strict=True):
            size = np.mean(y[here] ** 2 / v[here])
            total += stats.norm.logpdf(y[here], 0.0, np.sqrt(size * v[here])).sum()
        theirs.append(total)
    assert ours[0] - ours[1] == pytest.approx(theirs[0] - theirs[1], rel=1e-10)
