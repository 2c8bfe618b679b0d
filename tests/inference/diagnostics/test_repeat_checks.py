"""Cases against their repeats: a case that is drawn away from repeats that agree is named, scatter is not."""

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior

from bayes_tyre.inference.diagnostics.course_checks import CHANCE
from bayes_tyre.inference.diagnostics.repeat_checks import repeat_checks
from bayes_tyre.inference.diagnostics.sampling_checks import Check

SCATTER, DRAWS = 0.04, 200
FACTORS = grid(("single", "dual", "wide"))  # 12 cases x 3 repeats, 6 cases at each of two speeds


def made(rng: np.random.Generator, drawn: float = 0.0) -> xr.DataTree:
    """Return a posterior near a truth of the model; the first case is drawn away by so much of its logarithm."""
    cases = np.repeat(np.arange(12), 3)
    log_case = np.log(1.8) + 0.1 * rng.normal(size=12)
    log_record = log_case[cases] + SCATTER * rng.normal(size=36)
    mean = np.bincount(cases, log_record) / 3
    # What a posterior without knowledge of the cases but their repeats has.
    of_case = mean + SCATTER / np.sqrt(3) * rng.normal(size=(2, DRAWS, 12))
    of_case[..., 0] -= drawn
    of_record = log_record + 0.002 * rng.normal(size=(2, DRAWS, 36))
    draws = {f"{name}{at}": np.exp(of) for name in ("k", "beta") for at, of in (("", of_record), ("_case", of_case))}
    return posterior(draws, FACTORS)


def checks(tree: xr.DataTree) -> dict[str, Check]:
    return {check.name: check for check in repeat_checks(tree["posterior"].to_dataset())}


def test_cases_that_agree_with_their_repeats_pass():
    """The median over draws is less extreme than one draw: fewer than one of a thousand fails by chance."""
    for seed in range(20):
        found = checks(made(np.random.default_rng(seed)))
        assert list(found) == ["cases_and_repeats_k", "cases_and_repeats_beta"]
        assert all(check.passed and not check.not_checked for check in found.values())


def test_a_case_that_excludes_its_repeats_is_named_with_both_values():
    """As dual (35)30-25 of the campaign: repeats of 2.55, 2.59, 2.45 and a case of 2.01."""
    for seed in range(5):
        found = checks(made(np.random.default_rng(seed), drawn=0.23))["cases_and_repeats_k"]
        assert not found.passed
        assert found.value < CHANCE == found.limit
        assert found.where == "single (0)20-30"
        assert "where its repeats agree on" in found.finding
        assert "repeats.csv" in found.remedy


def test_an_interval_that_holds_none_of_the_repeats_is_noted_though_the_check_passes():
    near = checks(made(np.random.default_rng(3)))["cases_and_repeats_k"]
    drawn = checks(made(np.random.default_rng(3), drawn=0.12))["cases_and_repeats_k"]
    assert "single (0)20-30" not in near.note
    assert drawn.passed
    assert drawn.note.startswith("k_case: intervals hold none of their repeats, for other cases say otherwise: ")
    assert "single (0)20-30 (" in drawn.note


def test_cases_that_probably_stand_apart_are_named_and_fail_nothing():
    posterior_set = made(np.random.default_rng(1))["posterior"].to_dataset()
    probability = xr.zeros_like(posterior_set["k_case"])
    probability[:, :, 3], probability[:, :, 5] = 0.6, 0.9
    labels = posterior_set["case"].to_numpy()
    by_name = {check.name: check for check in repeat_checks(posterior_set.assign(k_apart_probability=probability))}
    found = by_name["cases_and_repeats_k"]
    assert found.passed
    assert found.note.startswith(
        f"k_case: probably apart from the other cases, which then say little of them: "
        f"{labels[5]} (0.90), {labels[3]} (0.60)"
    )
    assert "apart" not in by_name["cases_and_repeats_beta"].note


def test_a_discordant_repeat_is_not_counted_among_those_that_agree():
    tree = made(np.random.default_rng(1))
    posterior_set = tree["posterior"].to_dataset()
    k = posterior_set["k"].copy()
    k[:, :, 0] = k[:, :, 0] * 1.6
    probability = xr.zeros_like(k)
    with_one = posterior_set.assign(k=k, outlier_probability=probability)
    probability[:, :, 0] = 1.0
    named = posterior_set.assign(k=k, outlier_probability=probability)
    by_name = {check.name: check for check in repeat_checks(named)}
    assert by_name["cases_and_repeats_k"].passed
    assert {check.name for check in repeat_checks(with_one)} == set(by_name)


@pytest.mark.parametrize("repeats", [1, 2])
def test_too_few_repeats_say_nothing(repeats):
    factors = grid(("single",), repeats=repeats)
    rng = np.random.default_rng(2)
    draws = {"k": np.exp(rng.normal(size=(2, 10, len(factors)))), "k_case": np.exp(rng.normal(size=(2, 10, 4)))}
    draws |= {"beta": draws["k"], "beta_case": draws["k_case"]}
    for check in checks(posterior(draws, factors)).values():
        assert check.passed
        assert np.isnan(check.value)
        assert check.not_checked == "fewer than 6 repeats beyond one of each case"
        assert check.row["not_checked"] == check.not_checked
