"""The collapsed sampler: the posterior of the joint one, cases that stand apart, and records that it cannot sum up."""

from dataclasses import replace
from functools import cache
from typing import Any

import arviz as az
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.diagnostics.repeat_checks import repeat_checks
from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.inference.model.collapsed.record_summaries import RecordSummaries
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling import pilot
from bayes_tyre.inference.sampling.datatree import PROBABILITIES
from bayes_tyre.inference.sampling.hierarchical_fit import LEAST_COLLAPSED, collapses, fit_hierarchical
from bayes_tyre.inference.sampling.pilot import Location, Pilot
from bayes_tyre.inference.sampling.run import Draws, SamplerSettings, sampler_runs
from bayes_tyre.inference.sampling.summary_error import RECORD_SUMMARIES, SUMMARY_ERROR_MOST, SummaryError
from bayes_tyre.record_table import check_record_table

pytestmark = pytest.mark.usefixtures("iterations_fully_compiled")

#: 108 records in 36 cases; the same with one case off by six standard deviations of a remainder, and one of the other
#: cases' repeats discordant; and the same with noise that hides beta. All of one shape: each sampler is compiled once.
CLEAN = Plan(speeds=(0.0, 25.0, 35.0), loads=(20.0, 25.0, 30.0), points=30)
CASE, FACTOR = "dual (25)30-20", 1.6
APART = replace(CLEAN, apart=((CASE, FACTOR),), discordant=("single (0)20-30(2)",))
WEAK = replace(CLEAN, noise_kN=1.5)
ENOUGH = SamplerSettings(chains=2, warmup=300, draws=1000, target_accept=0.8)
STATISTICS = ("mean", "sd")
#: Of three tyres of each configuration, on which the repeats of a case take turns: how many times as stiff each is.
TYRES = {"1": 0.93, "2": 1.0, "3": 1.07}
#: By how much log k grows with a standard deviation of a pressure.
SLOPE = 0.04
LEVELS: dict[str, Any] = {"specimen": "tyre", "covariates": ("pressure_bar",)}


@cache
def fitted(
    plan: Plan, sampler: str = "collapsed", weight: float = PRIORS.apart_weight, levels: bool = False
) -> xr.DataTree:
    table = check_record_table(simulate(plan, 1)[0])
    priors, options = PRIORS.changed({"apart_weight": weight}), LEVELS if levels else {}
    model = ModelSettings(sampler=sampler, priors=priors, **options)
    return fit_hierarchical(on_tyres(table) if levels else table, ENOUGH, model)


def on_tyres(table: pd.DataFrame) -> pd.DataFrame:
    """Return the records as if made on several tyres and at several pressures: a stiffer one is pressed in less."""
    number = table.groupby("record", sort=False).ngroup().to_numpy()
    pressure = np.random.default_rng(6).standard_normal(number.max() + 1)
    pressure = ((pressure - pressure.mean()) / pressure.std())[number]
    tyre = table["repeat"].astype(int).astype(str)
    stiffer = tyre.map(TYRES).to_numpy() * np.exp(SLOPE * pressure)
    start = table.groupby("record", sort=False)["displacement_mm"].transform("first")
    displacement = start + (table["displacement_mm"] - start) / stiffer
    return table.assign(displacement_mm=displacement, tyre=tyre, pressure_bar=8.0 + 0.5 * pressure)


@pytest.mark.slow
@pytest.mark.parametrize("levels", [False, True])
def test_both_samplers_give_one_posterior(levels):
    trees = fitted(APART, levels=levels), fitted(APART, "joint", levels=levels)
    assert [sampler_runs(tree)[0].sampler for tree in trees] == ["collapsed", "joint"]
    one, other = (tree["posterior"].to_dataset() for tree in trees)
    assert set(one.data_vars) == set(other.data_vars)
    for statistic in STATISTICS:
        # The standard deviation of a probability that is 0 or 1 in most draws rests on the few in between: its Monte
        # Carlo error is not known from them, as the verdict has it too. Of probabilities the means are compared.
        names = [name for name in one.data_vars if statistic == "mean" or name not in PROBABILITIES]
        off = np.concatenate([_off(one[[name]], other[[name]], statistic) for name in names])
        # Some 900 numbers, many of which move together. Their errors are estimates too: one in 900 beyond 5 in 5e-4 of
        # seeds if they were normal, and rms within 15 % of 1 where 40 of them were independent.
        assert np.abs(off).max() < 5
        assert np.sqrt(np.mean(off**2)) < 1.25


def _off(one: xr.Dataset, other: xr.Dataset, statistic: str) -> np.ndarray:
    """Return by how many of its standard errors a statistic of each element differs."""
    values = [getattr(draws, {"mean": "mean", "sd": "std"}[statistic])(("chain", "draw")) for draws in (one, other)]
    errors = [az.mcse(draws, method=statistic) for draws in (one, other)]
    arrays = [next(iter(each.data_vars.values())).to_numpy().ravel() for each in (*values, *errors)]
    error = np.hypot(*arrays[2:])
    return (arrays[0] - arrays[1])[error > 0] / error[error > 0]


@pytest.mark.slow
def test_what_tyres_and_pressures_differ_by_is_found():
    tree = fitted(APART, levels=True)
    posterior = tree["posterior"].to_dataset()
    assert posterior["specimen"].to_numpy().tolist() == [
        f"{tyres} {name}" for tyres in ("dual", "single") for name in TYRES
    ]
    # Of the tyres of each configuration: the mean of all of them is the configuration's own.
    found = posterior["log_k_specimen"].transpose("chain", "draw", "specimen").to_numpy().reshape(-1, 2, len(TYRES))
    true = np.log(list(TYRES.values()))
    off = (found - found.mean(axis=2, keepdims=True) - (true - true.mean())).reshape(len(found), -1)
    slope = posterior["log_k_covariate"].to_numpy().reshape(len(found), 1) - SLOPE
    # 5 posterior standard deviations: a false alarm in a million of seven.
    for each in (off, slope):
        assert (np.abs(each.mean(axis=0)) < 5 * each.std(axis=0)).all()
    # As precise as 18 repeats of 4 % scatter a tyre, and 108 records, say.
    assert off.std(axis=0).max() < 0.02
    assert slope.std() < 0.01
    assert all(check.passed for check in repeat_checks(posterior))


@pytest.mark.slow
def test_what_it_was_sampled_by_is_judged_and_said():
    tree = fitted(APART)
    error = SummaryError.from_json(tree.attrs[RECORD_SUMMARIES])
    assert error.at_least <= SUMMARY_ERROR_MOST
    (check,) = [check for check in diagnose(tree).checks if check["name"] == "record_summaries"]
    assert (check["passed"], check["value"], check["where"]) == (True, error.total, error.case)
    assert RECORD_SUMMARIES not in fitted(APART, "joint").attrs


def posterior_of(tree: xr.DataTree) -> xr.Dataset:
    return tree["posterior"].to_dataset()


def label_of(posterior: xr.Dataset) -> str:
    (label,) = (label for label in map(str, posterior["case"].to_numpy()) if label.startswith(CASE))
    return label


def interval(draws: xr.DataArray) -> np.ndarray:
    return draws.quantile([0.025, 0.975], ("chain", "draw")).to_numpy()


@pytest.mark.slow
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


@pytest.mark.slow
def test_repeats_of_the_others_and_of_the_case_scatter_as_if_it_were_one_of_them():
    """The same repeats about a case that is moved: a normal remainder puts part of the distance into their scatter."""
    trees = fitted(CLEAN), fitted(APART), fitted(APART, weight=0.0)
    at_25 = [posterior_of(tree)["sd_log_k_repeat_by_speed"].sel(speed=25.0) for tree in trees]
    usual, mixed, alone = (float(draws.median()) for draws in at_25)
    # Medians of 1,000 effective draws that scatter by 18 % are known within 0.7 %.
    assert mixed == pytest.approx(usual, rel=0.08)
    assert alone > mixed


@pytest.mark.slow
def test_widths_of_clean_records_are_those_of_a_normal_remainder():
    mixed, normal = (posterior_of(tree) for tree in (fitted(CLEAN), fitted(CLEAN, weight=0.0)))
    for name in ("k_case", "beta_case"):
        ends = [np.log(interval(each[name])) for each in (mixed, normal)]
        widths = [upper - lower for lower, upper in ends]
        # 36 widths of some 1,000 effective draws, each known within 4 %: their mean within 1 % or so.
        assert np.mean(widths[0] / widths[1]) == pytest.approx(1.0, abs=0.05)
    assert "k_apart_probability" not in normal


@pytest.mark.slow
def test_records_that_no_summary_stands_for_are_sampled_as_well():
    notes = []
    settings = replace(ENOUGH, draws=20, on_note=notes.append)
    tree = fit_hierarchical(check_record_table(simulate(WEAK, 1)[0]), settings)
    (note,) = notes
    assert note.startswith("summaries of the records move the log density of what they share by")
    assert [one.sampler for one in sampler_runs(tree) if one.kept] == ["joint"]
    (check,) = [check for check in diagnose(tree).checks if check["name"] == "record_summaries"]
    assert check["passed"]
    assert "records were sampled as well" in check["note"]


@pytest.mark.slow
def test_chains_find_the_posterior_without_its_mode_too(monkeypatch):
    monkeypatch.setattr(pilot, "normal_approximation", lambda *_: None)
    tree = fit_hierarchical(check_record_table(simulate(CLEAN, 1)[0]), ENOUGH)
    # After so short a pilot from so far off, summaries may have to be made anew about the draws of a first run.
    assert [one.sampler for one in sampler_runs(tree) if one.kept] == ["collapsed"]
    assert SummaryError.from_json(tree.attrs[RECORD_SUMMARIES]).at_least <= SUMMARY_ERROR_MOST
    names = ["k_group", "beta_group", "sd_log_k_case", "sd_log_k_repeat", "sd_J"]
    off = _off(posterior_of(tree)[names], posterior_of(fitted(CLEAN))[names], "mean")
    assert np.abs(off).max() < 5


@pytest.mark.slow
def test_what_the_summaries_miss_is_added_by_its_slope(monkeypatch):
    summaries_about = pilot._summaries_about

    def off(*arguments: Any) -> RecordSummaries:
        """Return summaries of which each likes more noise: the typical one would move by 0.27 standard deviations."""
        summaries = summaries_about(*arguments)
        quadratic = summaries.noise.quadratic
        tilted = quadratic._replace(slope=quadratic.slope.at[:, 0].add(0.2))
        return summaries._replace(noise=summaries.noise._replace(quadratic=tilted))

    monkeypatch.setattr(pilot, "_summaries_about", off)
    # As if the records were too many for a regression to tell.
    monkeypatch.setattr(pilot, "_BY_CHANCE_MOST", 0.0)
    monkeypatch.setattr(pilot, "_MANY_RECORDS", 0)
    tree = fit_hierarchical(check_record_table(simulate(CLEAN, 1)[0]), ENOUGH)
    assert [(one.sampler, one.kept) for one in sampler_runs(tree)] == [("collapsed", True)]
    assert SummaryError.from_json(tree.attrs[RECORD_SUMMARIES]).total < 0.15
    names = ["sigma_typical", "k_group", "beta_group", "sd_log_k_case"]
    difference = _off(posterior_of(tree)[names], posterior_of(fitted(CLEAN))[names], "mean")
    # Some 40 standard errors, of which sigma's would be 5 or more without the slope.
    assert np.abs(difference).max() < 4


@pytest.mark.slow
def test_a_run_whose_summaries_were_off_is_followed_by_one_about_its_draws(monkeypatch):
    notes, of_draws, error_of = [], [], Pilot.error
    settings = replace(ENOUGH, draws=300, on_note=notes.append)

    def off_at_first(self: Pilot, location: Location, draws: Draws) -> SummaryError:
        error = error_of(self, location, draws)
        of_draws.append(error)
        return error._replace(at_least=2 * SUMMARY_ERROR_MOST) if of_draws == [error] else error

    monkeypatch.setattr(Pilot, "error", off_at_first)
    tree = fit_hierarchical(check_record_table(simulate(CLEAN, 1)[0]), settings)
    (note,) = notes
    assert note.endswith("made anew about these draws, for another run")
    assert [(one.sampler, one.kept) for one in sampler_runs(tree)] == [("collapsed", False), ("collapsed", True)]
    assert SummaryError.from_json(tree.attrs[RECORD_SUMMARIES]) == of_draws[-1]


def test_few_records_and_students_repeats_or_noise_are_sampled_as_well():
    def chosen(records: int, **options: Any) -> bool:
        prepared = prepare_records(check_record_table(simulate(CLEAN, 1)[0]), ModelSettings(likelihood="direct"))
        some = np.arange(len(prepared.batch.records)) < records
        model = ModelSettings(likelihood="direct", **options)
        return collapses(prepared.only(some, model), model)

    assert chosen(LEAST_COLLAPSED)
    assert not chosen(LEAST_COLLAPSED - 1)
    assert not chosen(LEAST_COLLAPSED, repeats="student")
    assert not chosen(LEAST_COLLAPSED, sampler="joint")
    assert not chosen(LEAST_COLLAPSED, noise="student")
