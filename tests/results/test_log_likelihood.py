"""The group `log_likelihood`: ArviZ's leave-one-out on it is the one of `compare`, and other records are refused."""

import arviz_base
import numpy as np
import pytest
import xarray as xr
from arviz_stats import ELPDData
from arviz_stats.loo import loo
from helpers.short_fits import OF_STANDING, STANDING
from helpers.simulated_records import simulate

import bayes_tyre as bt
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.leave_one_out import leave_one_record_out
from bayes_tyre.results.log_likelihood import GROUP, VARIABLE

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:Estimated shape parameter:UserWarning")]


def test_arviz_leaves_records_out_as_compare_does():
    table, _ = simulate(STANDING, seed=3)
    model = bt.ModelSettings(repeats="normal")
    posterior = bt.fit(table, OF_STANDING, model, progress=False)
    tree = bt.with_log_likelihood(posterior, table, model)
    assert tree[GROUP][VARIABLE].dims == ("chain", "draw", "record")
    assert [*tree[GROUP]["record"].to_numpy()] == [*posterior["posterior"]["record"].to_numpy()]
    of_compare = leave_one_record_out(posterior, table, model).elpd
    of_arviz = loo(tree, reff=1.0)
    assert isinstance(of_arviz, ELPDData)
    assert of_arviz.elpd == pytest.approx(of_compare.elpd, rel=1e-9)
    assert GROUP not in posterior.children  # what is given is not changed
    assert arviz_base.extract(tree, group=GROUP).sizes["record"] == len(np.unique(table["record"]))
    with pytest.raises(BadInput, match="not the records that the posterior was fitted to"):
        bt.with_log_likelihood(posterior, table[table["record"] != table["record"].iloc[0]], model)
    assert isinstance(tree, xr.DataTree)
