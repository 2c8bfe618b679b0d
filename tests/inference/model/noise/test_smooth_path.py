"""Readings near the start of a slow record: what smoothing leaves of their errors, and where it must not reach."""

import numpy as np
import pytest

from bayes_tyre.inference.model.noise.smooth_path import SmoothPath, smooth_near_start

SD, START = 0.004, 10.0


def smoothed(true: np.ndarray, seed: int) -> SmoothPath:
    """Return the path through readings of a displacement (mm) with noise."""
    return smooth_near_start(true + SD * np.random.default_rng(seed).standard_normal(len(true)), START, SD)


def after_a_rest(points: int, rest: int) -> np.ndarray:
    """Return a displacement, mm: at rest, then along half a cosine of 5 mm."""
    return START + 2.5 * (1.0 - np.cos(np.r_[np.zeros(rest), np.linspace(0.0, np.pi, points)]))


def squares(true: np.ndarray) -> tuple[float, float]:
    """Return the mean square of what smoothed points are off, over the noise's; and over what is said of each."""
    of_noise, of_said = [], []
    for seed in range(200):
        path, averaged = smoothed(true, seed)
        chosen = averaged > 1.0
        square = ((path - true)[chosen] / SD) ** 2
        of_noise.append(np.mean(square))
        of_said.append(np.mean(square * averaged[chosen]))
    return float(np.mean(of_noise)), float(np.mean(of_said))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_parabola_without_noise_stays_as_it_is(way):
    read = START + way * 15.0 * SD * np.linspace(0.0, 1.0, 200) ** 2
    path, averaged = smooth_near_start(read, START, SD)
    np.testing.assert_allclose(path, read, atol=1e-12)
    # The weight of the middle of m readings in a parabola through them is 3 (3 m^2 - 7) / (4 m (m^2 - 4)), m = 57.
    np.testing.assert_allclose(averaged[28:-28], 4 * 57 * (57**2 - 4) / (3 * (3 * 57**2 - 7)))
    np.testing.assert_array_equal(averaged[[0, 1, 2, 3, -4, -3, -2, -1]], 1.0)
    assert np.all(np.diff(averaged[:29]) >= 0.0)


def test_points_along_a_parabola_are_off_by_as_much_as_is_said():
    """200 paths: the standard error is 0.022; one off by four of them comes up with probability 6e-5."""
    _, of_said = squares(START + 15.0 * SD * np.linspace(0.0, 1.0, 400) ** 2)
    assert of_said == pytest.approx(1.0, abs=0.09)


@pytest.mark.parametrize(("points", "rest"), [(400, 0), (400, 30), (400, 60), (2000, 60)])
def test_points_of_a_slow_start_are_off_by_little_more(points, rest):
    """No parabola goes from rest into motion: those that pass are off by up to about their own error.

    So the square is up to twice what is said; 1.0 to 1.4 in these, with a standard error of 0.06.
    """
    of_noise, of_said = squares(after_a_rest(points, rest))
    assert of_said < 2.0
    assert of_noise < 0.15


def test_a_tremor_larger_than_the_noise_is_left_as_it_was_read():
    """Of 9 readings a parabola leaves 8 sd of such a tremor nearly whole: their squares are far beyond the limit."""
    true = START + 8.0 * SD * np.sin(2.0 * np.pi * np.arange(300) / 5.0)
    for seed in range(10):
        read = true + SD * np.random.default_rng(seed).standard_normal(len(true))
        path, averaged = smooth_near_start(read, START, SD)
        np.testing.assert_array_equal(path, read)
        np.testing.assert_array_equal(averaged, 1.0)


def test_a_bend_larger_than_the_noise_makes_the_windows_small():
    """A bend of 40 readings: half of it has the form of a parabola, no more; the points are nearer than the readings.

    Their mean square is 0.22 of the noise's, with a standard error of 0.01.
    """
    true, square = START + 8.0 * SD * np.sin(2.0 * np.pi * np.arange(300) / 40.0), []
    for seed in range(10):
        path, averaged = smoothed(true, seed)
        assert averaged.max() < 20.0
        square.append(np.mean((path - true) ** 2) / SD**2)
    assert np.mean(square) < 0.3


def test_readings_far_from_the_start_or_from_each_other_stay_as_they_are():
    slow, fast = after_a_rest(400, 30), after_a_rest(40, 0)
    for seed in range(10):
        read = slow + SD * np.random.default_rng(seed).standard_normal(len(slow))
        path, averaged = smooth_near_start(read, START, SD)
        far = np.abs(read - START) >= 20.0 * SD
        np.testing.assert_array_equal(path[far], read[far])
        np.testing.assert_array_equal(averaged[far], 1.0)
        assert np.mean(averaged[4:50] > 1.0) > 0.9  # a window fails by chance in some per cent
        np.testing.assert_array_equal(smoothed(fast, seed).averaged, 1.0)
