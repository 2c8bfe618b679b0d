"""Thinned draws of records: as many as asked for, together with what records share, on disk and back."""

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.formats.netcdf import read_tree, write_tree
from bayes_tyre.inference.sampling.record_draws import GROUP, KEPT, thin_records, with_records

FACTORS = grid()
RECORDS = len(FACTORS)


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    return posterior(scattered(FACTORS, seed=5), FACTORS)  # 4 chains of 250 draws


@pytest.mark.parametrize(
    ("kept", "most_records", "left"),
    [(None, RECORDS, None), (None, RECORDS - 1, KEPT), (40, RECORDS, 40), (3, RECORDS, 4), (1000, RECORDS, None)],
)
def test_as_many_draws_as_asked_for_and_of_many_records_few(tree, kept, most_records, left):
    thinned = thin_records(tree, kept, most_records)
    if left is None:
        assert thinned is tree
        return
    own = thinned[GROUP].to_dataset()
    assert own.sizes["chain"] * own.sizes["draw"] == left
    assert own["k"].attrs["units"] == "kN/mm"
    assert thinned["posterior"].sizes["draw"] == 250
    assert not any("record" in draws.dims for draws in thinned["posterior"].data_vars.values())
    assert list(thinned["posterior"]["record"].to_numpy()) == list(FACTORS["record"])
    assert "k" in tree["posterior"], "the posterior that was thinned is left as it was"


def test_thinned_draws_are_those_of_what_records_share_from_disk_too(tree, tmp_path):
    thinned = read_tree(write_tree(thin_records(tree, 40), tmp_path / "posterior.nc"))
    together, whole = with_records(thinned), tree["posterior"].to_dataset()
    assert with_records(tree).identical(whole)
    assert set(together.data_vars) == set(whole.data_vars)
    at = together["draw"].to_numpy()
    assert (at[0], at[-1], len(at)) == (0, 249, 10)
    for name, draws in together.data_vars.items():
        np.testing.assert_array_equal(draws.to_numpy(), whole[name].sel(draw=at).transpose(*draws.dims).to_numpy())


def test_printed_cases_have_no_records_to_thin():
    draws = {name: values for name, values in scattered(FACTORS, seed=5).items() if name.endswith("_case")}
    printed = posterior(draws, FACTORS.drop(columns=["record", "repeat"]).drop_duplicates())
    assert thin_records(printed, 4) is printed
