"""Units left out by importance sampling, and what a refit that fails leaves."""

import numpy as np

from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import left_out
from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST


def test_a_refit_that_fails_leaves_the_estimate_of_importance_sampling():
    densities = np.random.default_rng(2).normal(size=(4, 250, 3))
    densities[0, 0, 1] = -60.0  # the draw that all weight of this record would rest on
    attempts, told = Attempts(), []

    def refit(record: int) -> float:
        raise KeyError("sd_log_sigma")

    found = left_out(densities, ["a", "b", "c"], np.full(3, 99.0), refit, told.append, attempts)
    smoothed = left_out(densities, ["a", "b", "c"], np.full(3, 99.0), None, told.append)
    assert found.pareto_k[1] > PARETO_K_MOST
    assert told == ["b"]
    assert not found.refitted.any()
    np.testing.assert_array_equal(found.elpd.elpd_i.to_numpy(), smoothed.elpd.elpd_i.to_numpy())
    assert attempts.failed[0].reason.startswith("fit without b failed: KeyError: 'sd_log_sigma'; ")
