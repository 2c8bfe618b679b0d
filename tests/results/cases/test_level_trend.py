"""Effects of levels that were not tested: held by their intervals whether there is a trend or none."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import helmert

from bayes_tyre.results.cases import level_trend
from bayes_tyre.results.cases.level_trend import effects_by_trend

TESTED, NEW = np.array([0.0, 15.0, 25.0, 35.0]), np.array([20.0, 45.0, 60.0])
SD = 0.06
#: The posterior of the standard deviation of effects, on a grid, with the half-normal prior of this scale.
GRID, PRIOR = np.linspace(0.005, 0.4, 80), 0.1
type Truth = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def no_trend(levels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return rng.normal(0.0, SD, len(levels))


def line(levels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return rng.normal(0.0, SD) * levels / 15.0


def curve(levels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a wave of unknown phase, half of which fits between the first level and 45 km/h."""
    return SD * np.sqrt(2.0) * np.sin(levels * np.pi / 45.0 + rng.uniform(0.0, 2.0 * np.pi))


def drawn(truth: Truth, rng: np.random.Generator, draws: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Return the true effects of the new levels, from the mean of those tested, and draws of them."""
    effects = truth(np.concatenate([TESTED, NEW]), rng)
    effects -= effects[: len(TESTED)].mean()
    tested = effects[: len(TESTED)]
    log_density = -0.5 * (np.sum(tested**2) / GRID**2 + (GRID / PRIOR) ** 2) - 3.0 * np.log(GRID)
    weight = np.exp(log_density - log_density.max())
    sd = rng.choice(GRID, draws, p=weight / weight.sum())
    return effects[len(TESTED) :], effects_by_trend(TESTED, np.tile(tested, (draws, 1)), NEW, sd, rng)


@pytest.mark.parametrize(("truth", "least"), [(no_trend, 0.93), (line, 0.95), (curve, 0.88)])
def test_intervals_hold_levels_between_and_beyond_those_tested(truth, least):
    """800 sets: 95 % have a standard error of 0.8 %; the wave's second half, at 60 km/h, is beyond what is known."""
    rng = np.random.default_rng(3)
    held = []
    for _ in range(800):
        true, draws = drawn(truth, rng)
        lower, upper = np.quantile(draws, [0.025, 0.975], axis=0)
        held.append((lower < true) & (true < upper))
    assert np.all(np.mean(held, axis=0) > least)


def test_intervals_of_a_trend_grow_with_the_distance_from_the_levels_tested():
    effects = np.tile([-0.09, -0.02, 0.03, 0.08], (4000, 1))
    new = np.array([20.0, 40.0, 50.0, 80.0])
    draws = effects_by_trend(TESTED, effects, new, np.full(4000, SD), np.random.default_rng(1))
    widths = np.ptp(np.quantile(draws, [0.16, 0.84], axis=0), axis=0)
    assert np.all(np.diff(widths) > 0)
    # Between 15 and 25 km/h, with -0.02 and 0.03; no trend says 0 there, with 1.12 of the standard deviation.
    assert np.median(draws[:, 0]) == pytest.approx(0.005, abs=0.01)
    assert draws[:, 0].std() < 0.8 * SD * np.sqrt(1.25)


@pytest.mark.parametrize("tested", [1, 2])
def test_one_or_two_levels_show_no_trend(tested):
    """10,000 draws: a standard deviation is known to 0.7 %."""
    effects = np.tile(0.05 * (np.arange(tested) - (tested - 1) / 2.0), (10_000, 1))
    draws = effects_by_trend(TESTED[:tested], effects, NEW, np.full(10_000, SD), np.random.default_rng(2))
    np.testing.assert_allclose(draws.mean(axis=0), 0.0, atol=0.003)
    # An effect is counted from the mean of the levels tested, itself uncertain; two new ones share that.
    np.testing.assert_allclose(draws.std(axis=0), SD * np.sqrt(1.0 + 1.0 / tested), rtol=0.03)
    np.testing.assert_allclose(np.cov(draws.T)[0, 1], SD**2 / tested, rtol=0.1)


def test_the_effects_of_a_smooth_process_are_predicted_as_its_formula_says():
    """Against the conditional normal written out, for one length and no other choice."""
    rng = np.random.default_rng(4)
    levels, own = np.concatenate([TESTED, NEW]), level_trend.OWN
    kernel = own * np.eye(7) + (1.0 - own) * np.exp(-0.5 * ((levels[:, None] - levels) / 35.0) ** 2)
    centred = np.eye(7) - np.pad(np.full((7, 4), 0.25), [(0, 0), (0, 3)])
    covariance = centred @ kernel @ centred.T
    unit = np.trace(covariance[:4, :4]) / 3.0
    tested = rng.multivariate_normal(np.zeros(4), covariance[:4, :4] / unit)
    gain = covariance[4:, :4] @ np.linalg.pinv(covariance[:4, :4])
    coordinates = (tested @ helmert(4).T)[None]
    _, mean, root = level_trend._given_tested(level_trend._of_trend(levels, 4, 1.0), coordinates)
    np.testing.assert_allclose(mean[0], gain @ tested, rtol=1e-9)
    left = (covariance[4:, 4:] - gain @ covariance[:4, 4:]) / unit
    np.testing.assert_allclose(root @ root.T, left, rtol=1e-9)
