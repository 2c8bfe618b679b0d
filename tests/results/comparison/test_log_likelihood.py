"""Leave-one-record-out of a real fit, as ArviZ and as `compare` have it, and a fit without the record."""

from dataclasses import replace
from typing import Any

import arviz_base
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from arviz_stats import ELPDData
from arviz_stats.loo import loo
from helpers.short_fits import OF_STANDING, STANDING
from helpers.simulated_records import simulate

import bayes_tyre as bt
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.leave_one_out import fits as leave_out
from bayes_tyre.inference.diagnostics.leave_one_out import left_out
from bayes_tyre.inference.diagnostics.leave_one_out.fits import leave_one_record_out
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import LeaveOneOut
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.record_table import check_record_table
from bayes_tyre.results.comparison.log_likelihood import GROUP, VARIABLE, with_log_likelihood

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:Estimated shape parameter:UserWarning")]

TABLE, MODEL = check_record_table(simulate(STANDING, seed=3)[0]), bt.ModelSettings(repeats="normal")


@pytest.fixture(scope="module")
def posterior() -> xr.DataTree:
    return fit_hierarchical(TABLE, OF_STANDING, MODEL)


@pytest.fixture(scope="module")
def smoothed(posterior) -> LeaveOneOut:
    """Return the leave-one-record-out by importance sampling alone."""
    return leave_one_record_out(posterior, TABLE, MODEL)


def test_arviz_leaves_records_out_as_compare_does(posterior, smoothed):
    # The model is the posterior's own, and the records may come in any order.
    backwards = pd.concat([rows for _, rows in sorted(TABLE.groupby("record"), reverse=True)])
    tree = bt.with_log_likelihood(posterior, backwards)
    assert tree[GROUP][VARIABLE].dims == ("chain", "draw", "record")
    assert [*tree[GROUP]["record"].to_numpy()] == [*posterior["posterior"]["record"].to_numpy()]
    assert tree["posterior"].sizes["draw"] == tree[GROUP].sizes["draw"]  # ArviZ takes the ratio of both
    of_arviz = loo(tree, reff=1.0)
    assert isinstance(of_arviz, ELPDData)
    assert of_arviz.elpd == pytest.approx(smoothed.elpd.elpd, rel=1e-9)
    assert GROUP not in posterior.children  # what is given is not changed
    assert arviz_base.extract(tree, group=GROUP).sizes["record"] == len(np.unique(TABLE["record"]))
    assert of_arviz.se == pytest.approx(smoothed.elpd.se, rel=1e-9)
    np.testing.assert_allclose(of_arviz.pareto_k, smoothed.pareto_k)


def test_what_is_not_the_posterior_s_own_is_refused(posterior):
    with pytest.raises(BadInput, match="not the records that the posterior was fitted to"):
        bt.with_log_likelihood(posterior, TABLE[TABLE["record"] != TABLE["record"].iloc[0]])
    with pytest.raises(BadInput, match="the readings are not those that the posterior was fitted to"):
        bt.with_log_likelihood(posterior, TABLE.assign(force_kN=TABLE["force_kN"] + 0.5))
    for model, said in (
        (bt.ModelSettings(), "repeats normal, not mixture"),
        (bt.ModelSettings(repeats="normal", law="small_step_limit"), "law equation_2, not small_step_limit"),
        (bt.ModelSettings(repeats="normal", noise="iid"), "noise auto, not iid"),
    ):
        with pytest.raises(BadInput, match=f"fitted with {said}; leave model out"):
            bt.with_log_likelihood(posterior, TABLE, model)
    with pytest.raises(BadInput, match="other priors; leave priors out"):
        bt.with_log_likelihood(posterior, TABLE, MODEL, {"discordant_widening": 20.0})


def test_a_single_record_is_refused():
    one = xr.DataTree.from_dict({"posterior": xr.Dataset({"k": (("chain", "draw", "record"), np.ones((1, 9, 1)))})})
    one["posterior"] = one["posterior"].to_dataset().assign_coords(record=["a"])
    with pytest.raises(BadInput, match="one record cannot be predicted from others"):
        with_log_likelihood(one, TABLE)


def test_the_records_above_the_largest_k_are_fitted_without(posterior, smoothed, monkeypatch):
    assert not smoothed.refitted.any()
    record, refitted, told = int(smoothed.pareto_k.argmax()), [], []
    between = float(np.sort(smoothed.pareto_k)[-2:].mean())

    def of_other_limit(*given: Any, **options: Any) -> object:
        found: Any = loo(*given, **options)
        return replace(found, good_k=between)

    monkeypatch.setattr(left_out, "loo", of_other_limit)
    exactly = np.full((4, 9), 70.0)
    monkeypatch.setattr(leave_out, "_refit_without", lambda record, *_: refitted.append(record) or exactly)
    exact = leave_one_record_out(posterior, TABLE, MODEL, OF_STANDING, told.append)
    assert refitted == [record]
    assert exact.refitted.tolist() == [i == record for i in range(24)]
    assert told == [str(exact.elpd.elpd_i["record"].to_numpy()[record])]
    elpd_i = smoothed.elpd.elpd_i.to_numpy().copy()
    elpd_i[record] = 70.0
    np.testing.assert_allclose(exact.elpd.elpd_i, elpd_i)
    assert exact.elpd.elpd == pytest.approx(elpd_i.sum())


def test_importance_sampling_and_a_fit_without_the_record_agree(smoothed):
    # The record with the largest k that importance sampling is said to handle.
    handled = int(np.where(smoothed.pareto_k <= smoothed.elpd.good_k, smoothed.pareto_k, -1.0).argmax())
    draws = leave_out._refit_without(handled, prepare_records(TABLE, MODEL), OF_STANDING, MODEL)
    again = np.logaddexp.reduce(draws, axis=None) - np.log(draws.size)
    # Two Monte Carlo estimates of one number of the order of 70. 600 draws each leave some 0.15; k up to 0.7 a few.
    assert again == pytest.approx(smoothed.elpd.elpd_i.to_numpy()[handled], abs=0.6)
