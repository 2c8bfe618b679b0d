"""Units left out by importance sampling, and what a fit without one says, or leaves where it fails."""

from collections.abc import Callable

import numpy as np
import pytest

from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import left_out
from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST

NAMES, ENOUGH = ["a", "b", "c"], np.full(3, 99.0)


def with_one_heavy_draw() -> np.ndarray:
    """Return log densities, all weight of the second unit resting on one draw."""
    densities = np.random.default_rng(2).normal(size=(4, 250, 3))
    densities[0, 0, 1] = -60.0
    return densities


def test_the_effective_number_of_parameters_follows_what_a_refit_says():
    densities = with_one_heavy_draw()
    found = left_out(densities, NAMES, ENOUGH, lambda _: np.full((4, 50), -3.0), lambda _: None)
    assert found.refitted.tolist() == [False, True, False]
    assert found.elpd.elpd_i.to_numpy()[1] == pytest.approx(-3.0)
    lppd = float(np.sum(np.log(np.exp(densities).mean(axis=(0, 1)))))
    assert found.elpd.p == pytest.approx(lppd - found.elpd.elpd)
    assert found.trusted


def test_the_limit_of_k_is_the_one_for_so_many_draws():
    """Tail indices about 0.66: too large for 500 draws, whose limit is 1 - 1 / log10(500) = 0.63, under 0.7."""
    # Importance ratios that are exactly Pareto's, by their quantiles: the fit of the tail gives the index nearly back.
    quantiles = (np.arange(500) + 0.5) / 500
    ratios = np.random.default_rng(1).permutation((1.0 - quantiles) ** -0.72)
    densities = np.random.default_rng(2).normal(size=(4, 125, 3)) * 0.01
    densities[..., 1] = -np.log(ratios).reshape(4, 125)
    asked: list[str] = []
    found = left_out(densities, NAMES, ENOUGH, lambda _: np.zeros((4, 50)), asked.append)
    assert 0.63 < found.pareto_k[1] < PARETO_K_MOST
    assert asked == ["b"]
    assert not left_out(densities, NAMES, ENOUGH, None, asked.append).trusted


def test_a_refit_whose_chains_disagree_is_not_trusted():
    def disagreeing(unit: int) -> np.ndarray:
        return np.random.default_rng(unit).normal(np.arange(4)[:, None], 1.0, (4, 125))

    found = left_out(with_one_heavy_draw(), NAMES, ENOUGH, disagreeing, lambda _: None)
    assert found.disagreeing.tolist() == [False, True, False]
    assert not found.trusted


def test_a_refit_of_one_chain_is_judged_by_its_halves():
    """R-hat of halves that agree is above 1.05 with probability 1e-4, of a shift by 2 sd above 1.5."""

    def refit(shift: float) -> Callable[[int], np.ndarray]:
        return lambda _: np.random.default_rng(3).normal(np.where(np.arange(250) < 125, 0.0, shift), 1.0)[None]

    alike, drifting = (left_out(with_one_heavy_draw(), NAMES, ENOUGH, refit(by), lambda _: None) for by in (0.0, 2.0))
    assert not alike.disagreeing.any()
    assert alike.trusted
    assert drifting.disagreeing.tolist() == [False, True, False]


def test_a_refit_of_few_effective_draws_is_not_trusted():
    """Chains that agree, of 4 x 125 draws of which each is much as the one before: 0.98 leaves a hundredth of them."""

    def refit(rho: float) -> Callable[[int], np.ndarray]:
        noise = np.random.default_rng(4).normal(size=(4, 125))
        for i in range(1, 125):
            noise[:, i] = rho * noise[:, i - 1] + np.sqrt(1.0 - rho**2) * noise[:, i]
        return lambda _: noise

    slow, quick = (left_out(with_one_heavy_draw(), NAMES, ENOUGH, refit(rho), lambda _: None) for rho in (0.98, 0.0))
    assert slow.few_draws.tolist() == [False, True, False]
    assert not slow.trusted
    assert not quick.few_draws.any()


def test_a_refit_that_fails_leaves_the_estimate_of_importance_sampling():
    densities = with_one_heavy_draw()
    attempts, told = Attempts(), []

    def refit(record: int) -> np.ndarray:
        raise KeyError("sd_log_sigma")

    found = left_out(densities, NAMES, ENOUGH, refit, told.append, attempts)
    smoothed = left_out(densities, NAMES, ENOUGH, None, told.append)
    assert found.pareto_k[1] > PARETO_K_MOST
    assert told == ["b"]
    assert not found.refitted.any()
    np.testing.assert_array_equal(found.elpd.elpd_i.to_numpy(), smoothed.elpd.elpd_i.to_numpy())
    assert attempts.failed[0].reason.startswith("fit without b failed: KeyError: 'sd_log_sigma'; ")
