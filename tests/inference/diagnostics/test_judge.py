"""From draws to the verdict: whatever is computed on the way may fail, and the draws remain."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.inference.diagnostics import judge as module
from bayes_tyre.inference.diagnostics.attempts import Attempt, Attempts
from bayes_tyre.inference.diagnostics.convergence import GROUP
from bayes_tyre.inference.diagnostics.judge import judge, with_failures
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.diagnostics.verdict import diagnose


def fails(*_: object) -> xr.DataTree:
    raise ValueError("All tail values are the same")


def as_it_is(tree: xr.DataTree, attempt: Attempt) -> xr.DataTree:
    return tree


@pytest.fixture
def tree() -> xr.DataTree:
    factor_table = grid(("single",))
    return posterior(scattered(factor_table, seed=1, chains=4, draws=400), factor_table)


def test_a_posterior_is_judged_with_its_statistics(tree):
    judged, found = judge(tree, as_it_is, Attempts())
    assert GROUP in judged.children
    assert found.verdict == "pass"
    assert {check["kind"] for check in found.checks} == {"sampling", "data"}
    assert all(check["passed"] for check in found.checks)


def test_a_posterior_of_records_is_held_against_their_points(tree, monkeypatch):
    table, finding = pd.DataFrame({"record": ["a"]}), "a: off its curve"
    wrong = Check("record_curves", "model", False, 0.05, 0.01, "a", finding, "try another --law")
    monkeypatch.setattr(
        module, "model_checks", lambda of, points: [wrong] if points is table and of is not None else []
    )
    judged, found = judge(tree, as_it_is, Attempts(), table)
    assert found.reasons == ("a: off its curve; try another --law",)
    # The posterior carries them: it can be diagnosed again without the table.
    assert diagnose(judged).reasons == found.reasons


def test_what_fails_fails_the_verdict_and_leaves_the_rest(tree):
    judged, found = judge(tree, fails, Attempts(), pd.DataFrame({"no": ["records"]}))
    assert GROUP in judged.children
    assert found.verdict == "fail"
    assert [reason.split(" failed: ")[0] for reason in found.reasons] == ["prior sensitivity", "model checks"]
    assert "ValueError: All tail values are the same; " in found.reasons[0]
    assert "KeyError: " in found.reasons[1]
    failed = [check for check in found.checks if not check["passed"]]
    assert [check["name"] for check in failed] == ["prior sensitivity", "model checks"]
    assert found.r_hat_max < 1.01


def test_draws_that_cannot_be_diagnosed_are_counted_all_the_same(tree, monkeypatch):
    monkeypatch.setattr(module, "diagnose", fails)
    monkeypatch.setattr(module, "with_statistics", fails)
    judged, found = judge(tree, as_it_is, Attempts())
    assert GROUP not in judged.children
    assert (found.verdict, found.draws, found.chains, found.divergences) == ("fail", 400, 4, 0)
    assert [reason.split(" failed: ")[0] for reason in found.reasons] == ["convergence statistics", "diagnostics"]
    assert np.isnan(found.r_hat_max)


def test_a_failure_that_is_named_already_is_not_named_again(tree):
    attempts = Attempts()
    _, found = judge(tree, fails, attempts)
    assert with_failures(found, attempts.failed) == found
