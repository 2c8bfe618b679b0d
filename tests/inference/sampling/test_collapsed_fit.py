"""The collapsed sampler: the posterior of the joint one, and the joint one where summaries are not good enough."""

from functools import cache
from typing import Any

import arviz as az
import numpy as np
import pytest
import xarray as xr
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.diagnostics.verdict import diagnose
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import LEAST_COLLAPSED, collapses, fit_hierarchical
from bayes_tyre.inference.sampling.run import SamplerSettings, sampler_runs
from bayes_tyre.inference.sampling.summary_error import RECORD_SUMMARIES, SUMMARY_ERROR_MOST, SummaryError
from bayes_tyre.record_table import check_record_table

#: 108 records in 36 cases; in the second table their noise hides beta.
GOOD = Plan(speeds=(0.0, 25.0, 35.0), loads=(20.0, 25.0, 30.0), points=30, discordant=("single (0)20-30(2)",))
WEAK = Plan(speeds=(0.0, 25.0, 35.0), loads=(20.0, 25.0, 30.0), points=30, noise_kN=1.5)
ENOUGH = SamplerSettings(chains=2, warmup=300, draws=500, target_accept=0.8)
STATISTICS = ("mean", "sd")


@cache
def fitted(sampler: str) -> xr.DataTree:
    table = check_record_table(simulate(GOOD, 1)[0])
    return fit_hierarchical(table, ENOUGH, ModelSettings(sampler=sampler))


@pytest.mark.slow
def test_both_samplers_give_one_posterior():
    trees = fitted("collapsed"), fitted("joint")
    assert [sampler_runs(tree)[0].sampler for tree in trees] == ["collapsed", "joint"]
    one, other = (tree["posterior"].to_dataset() for tree in trees)
    assert set(one.data_vars) == set(other.data_vars)
    for statistic in STATISTICS:
        off = np.concatenate([_off(one[[name]], other[[name]], statistic) for name in one.data_vars])
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
def test_what_it_was_sampled_by_is_judged_and_said():
    tree = fitted("collapsed")
    error = SummaryError.from_json(tree.attrs[RECORD_SUMMARIES])
    assert error.at_least <= SUMMARY_ERROR_MOST
    (check,) = [check for check in diagnose(tree).checks if check["name"] == "record_summaries"]
    assert (check["passed"], check["value"], check["where"]) == (True, error.total, error.case)
    assert RECORD_SUMMARIES not in fitted("joint").attrs


@pytest.mark.slow
def test_records_that_no_summary_stands_for_are_sampled_as_well():
    notes = []
    settings = SamplerSettings(chains=2, warmup=100, draws=20, target_accept=0.8, on_note=notes.append)
    tree = fit_hierarchical(check_record_table(simulate(WEAK, 1)[0]), settings)
    (note,) = notes
    assert note.startswith("summaries of the records move the log density of what they share by")
    assert [one.sampler for one in sampler_runs(tree) if one.kept] == ["joint"]
    (check,) = [check for check in diagnose(tree).checks if check["name"] == "record_summaries"]
    assert check["passed"]
    assert "records were sampled as well" in check["note"]


def test_few_records_and_students_repeats_are_sampled_as_well():
    def chosen(records: int, **options: Any) -> bool:
        prepared = prepare_records(check_record_table(simulate(GOOD, 1)[0]), ModelSettings(likelihood="direct"))
        some = np.arange(len(prepared.batch.records)) < records
        model = ModelSettings(likelihood="direct", **options)
        return collapses(prepared.only(some, model), model)

    assert chosen(LEAST_COLLAPSED)
    assert not chosen(LEAST_COLLAPSED - 1)
    assert not chosen(LEAST_COLLAPSED, repeats="student")
    assert not chosen(LEAST_COLLAPSED, sampler="joint")
