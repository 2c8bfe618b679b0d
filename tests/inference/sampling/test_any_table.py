"""The hierarchical fit takes any number of levels and repeats, says what its quantities are, and can be repeated."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.simulated_records import Plan, simulate

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record_table import check_record_table

#: For what is only looked at, not believed. A stated acceptance keeps a run with a divergence from being repeated.
GLANCE = SamplerSettings(chains=1, warmup=50, draws=50, seed=1, target_accept=0.65)
FOUR_CASES = Plan(("x", "y"), (0.0,), (20.0,), (-5.0, 5.0), repeats=2)


def fit(plan: Plan, settings: SamplerSettings = GLANCE) -> tuple[xr.Dataset, pd.DataFrame]:
    table, truth = simulate(plan, 2)
    return fit_hierarchical(check_record_table(table), settings)["posterior"].to_dataset(), truth


@pytest.fixture(scope="module")
def glance() -> xr.Dataset:
    """Return a few draws for two configurations, two directions and two repeats."""
    return fit(FOUR_CASES)[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "plan",
    [
        Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=1),
        Plan(("a", "b", "c"), (0.0, 10.0), (20.0,), (5.0,), repeats=1),
    ],
    ids=["one record", "three configurations"],
)
def test_any_number_of_levels_can_be_fitted(plan):
    posterior, truth = fit(plan)
    assert posterior.sizes["record"] == len(truth)
    assert "outlier_probability" not in posterior
    assert np.isfinite(posterior["k_case"].to_numpy()).all()
    assert posterior["k"].median(("chain", "draw")).to_numpy() == pytest.approx(truth["k"].to_numpy(), rel=0.2)


@pytest.mark.slow
def test_a_table_without_words_is_fitted_as_repeats_of_one_case():
    table, truth = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=3), seed=2)
    tree = fit_hierarchical(check_record_table(table[["record", "displacement_mm", "force_kN"]]), GLANCE)
    posterior = tree["posterior"].to_dataset()
    assert (posterior.sizes["case"], posterior.sizes["record"]) == (1, 3)
    assert "outlier_probability" in posterior  # three can be judged
    assert posterior["k"].median(("chain", "draw")).to_numpy() == pytest.approx(truth["k"].to_numpy(), rel=0.2)


@pytest.mark.slow
def test_every_quantity_has_its_unit_and_named_dimension(glance):
    assert glance["k"].attrs["units"] == "kN/mm"
    assert glance["beta_case"].attrs["units"] == "mm"
    assert glance["C"].dims == ("chain", "draw", "record")
    assert glance["case_configuration"].to_numpy().tolist() == ["x", "x", "y", "y"]
    assert "outlier_probability" not in glance  # of two repeats nobody knows which is odd
    for name, draws in glance.data_vars.items():
        assert "units" in draws.attrs, name
        assert not any(str(dim).endswith("_dim_0") for dim in draws.dims), name


@pytest.mark.parametrize("what", ["points", "travel", "force"])
def test_a_hopeless_record_is_refused_by_name(what):
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=2), seed=2)
    name = table["record"].iloc[-1]
    rows = table.index[table["record"] == name]
    if what == "points":
        table = table.drop(rows[5:])
    else:
        column = "displacement_mm" if what == "travel" else "force_kN"
        table.loc[rows, column] = 1.0
    with pytest.raises(BadInput, match="remove the record") as error:
        fit_hierarchical(check_record_table(table), GLANCE)
    assert repr(name) in str(error.value)


@pytest.mark.slow
def test_another_seed_gives_other_draws(glance):
    other, _ = fit(FOUR_CASES, replace(GLANCE, seed=2))
    assert not np.array_equal(glance["k_case"], other["k_case"])
