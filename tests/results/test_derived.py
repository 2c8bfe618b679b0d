"""Printed quantities as draws: ArviZ's own summary of them gives the numbers of the tables."""

import arviz as az
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.formats.netcdf import read_tree, write_tree
from bayes_tyre.results import contrasts, summary
from bayes_tyre.results.derived import DERIVED, with_derived


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    return with_derived(posterior(scattered(grid(), seed=1), grid()))


def by_arviz(tree: xr.DataTree, name: str) -> pd.DataFrame:
    found = az.summary(
        tree, var_names=[name], group=DERIVED, kind="stats", ci_kind="eti", ci_prob=0.95, round_to="none"
    )
    assert isinstance(found, pd.DataFrame)
    return found


@pytest.mark.parametrize("parameter", ["k", "beta"])
def test_means_over_cases_are_those_of_the_summary(tree, parameter):
    table = summary.summary(tree, "pass").query(f"parameter == '{parameter}_mean'")
    found = by_arviz(tree, f"{parameter}_mean")
    assert list(found.index) == [
        f"{parameter}_mean[{configuration} {direction}]"
        for configuration, direction in zip(table["configuration"], table["direction"], strict=True)
    ]
    for ours, theirs in {"mean": "mean", "sd": "sd", "lower": "eti95_lb", "upper": "eti95_ub"}.items():
        np.testing.assert_allclose(table[ours].to_numpy(), found[theirs].to_numpy(), rtol=1e-12)


@pytest.mark.parametrize("parameter", ["k", "beta"])
def test_average_ratios_are_those_of_the_contrasts(tree, parameter):
    table = contrasts.contrasts(tree, "pass").query("parameter == @parameter")
    averages = table[table[["direction", "configuration", "speed_km_h"]].isna().all(axis=1)]
    draws = tree[DERIVED][f"{parameter}_ratio"]
    assert draws["contrast"].to_numpy().tolist() == [*(averages["contrast"] + ", " + averages["matching"])]
    assert "dual / single, same case" in draws["contrast"]
    found = draws.quantile([0.025, 0.5, 0.975], ["chain", "draw"]).T
    np.testing.assert_allclose(found, averages[["lower", "median", "upper"]], rtol=1e-12)


@pytest.mark.parametrize(
    ("missing", "labels"),
    [
        (["configuration"], ["loading", "unloading"]),
        (["direction"], ["single"]),
        (["configuration", "direction"], [""]),
    ],
)
def test_means_are_labelled_by_the_factors_that_there_are(missing, labels):
    factors = grid(("single",)).drop(columns=missing)
    found = with_derived(posterior(scattered(factors, seed=1), factors))[DERIVED]
    assert found["mean_of"].to_numpy().tolist() == labels


def test_a_single_case_has_a_mean_and_no_ratio():
    one = grid().iloc[:3]
    found = with_derived(posterior(scattered(one, seed=1), one))[DERIVED]
    assert set(found.data_vars) == {"k_mean", "beta_mean"}


def test_they_have_units_and_are_kept_in_the_file(tree, tmp_path):
    read = read_tree(write_tree(tree, tmp_path / "posterior.nc"))
    assert read[DERIVED]["k_mean"].attrs["units"] == "kN/mm"
    assert read[DERIVED]["beta_ratio"].attrs["units"] == "1"
    xr.testing.assert_identical(read[DERIVED]["k_ratio"].load(), tree[DERIVED]["k_ratio"])
