"""From draws to the verdict: whatever is computed on the way may fail, and the draws remain."""

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.inference.diagnostics import judge as module
from bayes_tyre.inference.diagnostics.attempts import Attempt, Attempts
from bayes_tyre.inference.diagnostics.convergence import GROUP
from bayes_tyre.inference.diagnostics.judge import judge, with_failures


def fails(*_: object) -> xr.DataTree:
    raise ValueError("All tail values are the same")


def as_it_is(tree: xr.DataTree, attempt: Attempt) -> xr.DataTree:
    return tree


@pytest.fixture
def tree() -> xr.DataTree:
    factor_table = grid(("single",))
    return posterior(scattered(factor_table, seed=1, chains=4, draws=400), factor_table)


def test_a_posterior_is_judged_with_its_statistics(tree):
    judged, found = judge(tree, as_it_is, Attempts(), lambda _: 0.05)
    assert GROUP in judged.children
    assert (found.verdict, found.residual_autocorrelation) == ("pass", 0.05)
    assert all(check["passed"] for check in found.checks)


def test_what_fails_fails_the_verdict_and_leaves_the_rest(tree):
    judged, found = judge(tree, fails, Attempts(), lambda _: float(fails()))  # pyright: ignore[reportArgumentType]
    assert GROUP in judged.children
    assert found.verdict == "fail"
    assert [reason.split(" failed: ")[0] for reason in found.reasons] == [
        "prior sensitivity",
        "autocorrelation of residuals",
    ]
    assert all("ValueError: All tail values are the same; " in reason for reason in found.reasons)
    failed = [check for check in found.checks if not check["passed"]]
    assert [check["name"] for check in failed] == ["prior sensitivity", "autocorrelation of residuals"]
    assert {check["where"] for check in failed} == {"ValueError: All tail values are the same"}
    assert found.r_hat_max < 1.01


def test_draws_that_cannot_be_diagnosed_are_counted_all_the_same(tree, monkeypatch):
    monkeypatch.setattr(module, "diagnose", fails)
    monkeypatch.setattr(module, "with_figures", fails)
    judged, found = judge(tree, as_it_is, Attempts())
    assert GROUP not in judged.children
    assert (found.verdict, found.draws, found.chains, found.divergences) == ("fail", 400, 4, 0)
    assert [reason.split(" failed: ")[0] for reason in found.reasons] == ["convergence statistics", "diagnostics"]
    assert np.isnan(found.r_hat_max)


def test_a_failure_that_is_named_already_is_not_named_again(tree):
    attempts = Attempts()
    _, found = judge(tree, fails, attempts)
    assert with_failures(found, attempts.failed) == found
