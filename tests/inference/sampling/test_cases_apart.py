"""A case that stands apart from the others: believed by its own repeats, and no harm to what the others say."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.diagnostics.repeat_checks import repeat_checks
from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record_table import check_record_table

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("fully_compiled")]

#: 108 records in 36 cases; and the same repeats with one case off by six standard deviations of a remainder.
CLEAN = Plan(speeds=(0.0, 25.0, 35.0), loads=(20.0, 25.0, 30.0), points=30)
CASE, FACTOR = "dual (25)30-20", 1.6
APART = replace(CLEAN, apart=((CASE, FACTOR),))
ENOUGH = SamplerSettings(chains=2, warmup=300, draws=1000, target_accept=0.8)


@cache
def fitted(plan: Plan, sampler: str = "collapsed", weight: float = PRIORS.apart_weight) -> xr.DataTree:
    table = check_record_table(simulate(plan, 1)[0])
    priors = PRIORS.changed({"apart_weight": weight})
    return fit_hierarchical(table, ENOUGH, ModelSettings(sampler=sampler, priors=priors))


def posterior_of(tree: xr.DataTree) -> xr.Dataset:
    return tree["posterior"].to_dataset()


def label_of(posterior: xr.Dataset) -> str:
    (label,) = (label for label in map(str, posterior["case"].to_numpy()) if label.startswith(CASE))
    return label


def interval(draws: xr.DataArray) -> np.ndarray:
    return draws.quantile([0.025, 0.975], ("chain", "draw")).to_numpy()


@pytest.mark.parametrize("sampler", ["collapsed", "joint"])
def test_a_case_that_stands_apart_is_found_and_its_interval_holds_its_truth(sampler):
    tree, (_, truth) = fitted(APART, sampler), simulate(APART, 1)
    posterior = posterior_of(tree)
    label = label_of(posterior)
    (k_case,) = truth.loc[truth["record"].str.startswith(CASE), "k_case"].unique()
    own = posterior["k_case"].sel(case=label)
    lower, upper = interval(own)
    assert lower < k_case < upper
    assert float(posterior["k_apart_probability"].sel(case=label).mean()) > 0.9
    assert float(posterior["k_apart_probability"].drop_sel(case=label).mean()) < 0.1
    assert diagnose(tree).divergences == 0
    of_k = next(iter(repeat_checks(posterior)))
    assert of_k.passed
    assert f"probably apart from the other cases, which then say little of them: {label} (" in of_k.note


def test_repeats_of_the_others_and_of_the_case_scatter_as_if_it_were_one_of_them():
    """The same repeats about a case that is moved: a normal remainder puts part of the distance into their scatter."""
    trees = fitted(CLEAN), fitted(APART), fitted(APART, weight=0.0)
    at_25 = [posterior_of(tree)["sd_log_k_repeat_by_speed"].sel(speed=25.0) for tree in trees]
    usual, mixed, alone = (float(draws.median()) for draws in at_25)
    # Medians of 1,000 effective draws that scatter by 18 % are known within 0.7 %.
    assert mixed == pytest.approx(usual, rel=0.08)
    assert alone > mixed


def test_widths_of_clean_records_are_those_of_a_normal_remainder():
    mixed, normal = (posterior_of(tree) for tree in (fitted(CLEAN), fitted(CLEAN, weight=0.0)))
    for name in ("k_case", "beta_case"):
        ends = [np.log(interval(each[name])) for each in (mixed, normal)]
        widths = [upper - lower for lower, upper in ends]
        # 36 widths of some 1,000 effective draws, each known within 4 %: their mean within 1 % or so.
        assert np.mean(widths[0] / widths[1]) == pytest.approx(1.0, abs=0.05)
    assert "k_apart_probability" not in normal
