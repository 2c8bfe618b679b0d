"""Doubts about the records: each is raised by what it is about, and by nothing else."""

import re

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.inference.diagnostics.data_checks import decided_by_given_priors, failed_checks
from bayes_tyre.inference.diagnostics.sampling_checks import Check
from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.priors import Priors

FACTORS = grid(("single",))
SHAPE = (4, 250)


def dataset(changed: dict[str, np.ndarray], factor_table: pd.DataFrame = FACTORS) -> xr.Dataset:
    return posterior(scattered(factor_table, seed=1) | changed, factor_table)["posterior"].to_dataset()


def spread(middle: float, log_sd: float, *shape: int) -> np.ndarray:
    return middle * np.exp(log_sd * np.random.default_rng(2).normal(size=(*SHAPE, *shape)))


def odd(records: list[int]) -> np.ndarray:
    """Probabilities of 0.9 for these records and 0.05 for the others."""
    probability = np.full(len(FACTORS), 0.05)
    probability[records] = 0.9
    return np.broadcast_to(probability, (*SHAPE, len(FACTORS))).copy()


def only(doubts: list[Check]) -> str:
    assert len(doubts) == 1, doubts
    return doubts[0].reason


def test_ordinary_records_raise_none():
    assert failed_checks(dataset({"beta_group": spread(0.05, 0.3, 2), "sd_log_k_repeat": spread(0.05, 0.3)})) == []


# The prior's standard deviation of the logarithm of k is 1, that of beta 2.
def test_stiffness_of_a_group_as_wide_as_its_prior_is_named():
    assert failed_checks(dataset({"k_group": spread(1.0, 0.5, 2)})) == []
    both = np.concatenate([spread(1.0, 0.1, 1), spread(1.0, 0.9, 1)], axis=2)
    said = only(failed_checks(dataset({"k_group": both})))
    assert said.startswith("k_group[single unloading]: not determined by the records")
    assert "; " in said


def stated(median: float, sd_log: float) -> Priors:
    return PRIORS.changed({"k_group": {"median": median, "sd_log": sd_log}})


def test_a_prior_that_is_narrow_by_intention_is_said_and_fails_nothing():
    as_wide = dataset({"k_group": spread(2.0, 0.05, 2)})
    narrow = stated(2.0, 0.05)
    assert failed_checks(as_wide, narrow) == []
    said = decided_by_given_priors(as_wide, narrow)
    assert [sentence.partition(": ")[0] for sentence in said] == [
        "k_group[single loading]",
        "k_group[single unloading]",
    ]
    assert "decided by the prior that was given" in said[0]
    assert decided_by_given_priors(as_wide, PRIORS) == []  # the records decide, against the default prior
    # A prior as good as the default is none that decides by intention.
    open_still = dataset({"k_group": spread(1.0, 0.9, 2)})
    assert len(failed_checks(open_still, stated(1.0, 0.95))) == 2
    assert decided_by_given_priors(open_still, stated(1.0, 0.95)) == []


def test_a_prior_knows_of_no_factor_on_force_or_displacement():
    """Records good to 0.02, the factor to 0.2: what is printed is wider than the prior of 0.1, what was sampled not."""
    measured = dataset({"k_group": spread(2.0, 0.02, 2)})
    factor = np.exp(np.random.default_rng(1).normal(0.0, 0.2, SHAPE))
    scale = xr.DataArray(factor, dims=("chain", "draw"))
    scaled = measured.assign(k_group=(measured["k_group"] / scale).transpose("chain", "draw", "group"))
    scaled = scaled.assign(displacement_scale=scale)
    prior = stated(2.0, 0.1)
    for draws in (measured, scaled):
        assert failed_checks(draws, prior) == []
        assert decided_by_given_priors(draws, prior) == []
    assert decided_by_given_priors(scaled.drop_vars("displacement_scale"), prior)


@pytest.mark.parametrize(("off", "fails"), [(2.0, False), (5.0, True)])
def test_a_narrow_prior_that_printed_means_contradict_fails(off, fails):
    """Means whose own log k is so many standard errors off, with a variance 4 times the prior's: contraction 0.2."""
    sd, contraction = 0.05, 0.2
    shift = off * np.sqrt(5.0) * sd * contraction
    pulled = dataset({"k_group": spread(2.0 * np.exp(shift), sd * np.sqrt(1 - contraction), 2)}).drop_vars("k")
    found = failed_checks(pulled, stated(2.0, sd))
    assert len(found) == (2 if fails else 0)
    assert len(decided_by_given_priors(pulled, stated(2.0, sd))) == (0 if fails else 2)
    if fails:
        # 1000 draws: contraction 0.2 +- 0.036, so that 5 is known to a tenth or so.
        assert re.search(r"given, [45]\.\d standard errors off the records; check the units", found[0].reason)


def test_records_that_leave_beta_and_J_open_fail_nothing():
    wide = {"beta_group": spread(1.0, 1.9, 2), "J_group": np.random.default_rng(0).normal(0.0, 2.0, (*SHAPE, 2))}
    assert failed_checks(dataset(wide)) == []


@pytest.mark.parametrize(("parameter", "usual", "too_much"), [("k", 0.3, 0.7), ("beta", 0.6, 1.4)])
def test_repeats_that_are_none_are_named(parameter, usual, too_much):
    name = f"sd_log_{parameter}_repeat"
    assert failed_checks(dataset({name: spread(usual, 0.1)})) == []
    assert only(failed_checks(dataset({name: spread(too_much, 0.1)}))).startswith(f"{name}: repeats of a case differ")


def test_a_case_most_of_whose_repeats_are_discordant_is_named():
    assert failed_checks(dataset({"outlier_probability": odd([0, 4, 7])})) == []  # one in each of three cases
    said = only(failed_checks(dataset({"outlier_probability": odd([3, 5])})))
    assert said.startswith("k[single (0)30-20]: 2 of its 3 repeats are discordant")


def test_discordance_is_found_without_words_too():
    bare = FACTORS[["record"]]
    everything = odd(list(range(8)))
    assert only(failed_checks(dataset({"outlier_probability": everything}, bare))).startswith(
        "k[all records]: 8 of its 12"
    )


def test_records_without_noise_are_named():
    sigma = spread(0.03, 0.05, len(FACTORS))
    assert failed_checks(dataset({"sigma": sigma})) == []
    sigma[..., 2] = 1e-9
    assert only(failed_checks(dataset({"sigma": sigma}))).startswith(f"sigma[{FACTORS['record'][2]}]: 1e-09 kN")


def test_a_doubt_fails_the_verdict():
    tree = posterior(scattered(FACTORS, seed=1) | {"sd_log_k_repeat": spread(0.7, 0.1)}, FACTORS)
    found = diagnose(tree)
    assert found.verdict == "fail"
    assert found.reasons == tuple(check.reason for check in failed_checks(tree["posterior"].to_dataset()))


def test_a_label_may_hold_what_separates_finding_and_remedy():
    """A check is found, named and mended by its fields, not by taking its sentence apart."""
    label = "type 4; 9.00: R20"
    named = FACTORS.assign(configuration=label)
    tree = posterior(scattered(named, seed=1) | {"outlier_probability": odd([3, 5])}, named)
    (row,) = [row for row in diagnose(tree).checks if not row["passed"] and row["kind"] == "data"]
    assert row["where"] == f"k[{label} (0)30-20]"
    assert row["remedy"] == "repeat the test"
