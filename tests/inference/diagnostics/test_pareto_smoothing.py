"""Importance weights: the tail index of a known tail, and weights that have none."""

import numpy as np
import pytest

from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST, smooth_log_weights


def test_the_tail_index_is_that_of_the_ratios():
    # Ratios u^-k have a Pareto tail of index k; its estimate from 600 of 40,000 has a standard deviation of 0.06.
    u = np.random.default_rng(5).uniform(size=40_000)
    for k in (0.2, 0.5, 0.9):
        log_weights, found = smooth_log_weights(-k * np.log(u))
        assert found == pytest.approx(k, abs=0.25)
        assert np.exp(log_weights).sum() == pytest.approx(1)


@pytest.mark.parametrize("below", [100.0, 550.0, 720.0, 1e4])
@pytest.mark.parametrize("heavy", [1, 3, 20])
def test_a_few_draws_with_all_of_the_weight_are_never_trusted(below, heavy):
    """ArviZ's fit of such a tail overflows, which would be an error here, and may return an index of 0.07."""
    rng = np.random.default_rng(6)
    log_ratios = np.append(rng.standard_normal(heavy), 3 * rng.standard_normal(400 - heavy) - below)
    log_weights, k = smooth_log_weights(log_ratios)
    assert k > PARETO_K_MOST
    assert np.exp(log_weights).sum() == pytest.approx(1)
