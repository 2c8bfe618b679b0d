"""Factors of cases and records: beside the draws inside, in a group of their own outside, the same either way."""

import arviz as az
import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.formats.constant_data import put_together, set_apart


@pytest.fixture(scope="module")
def tree():
    factors = grid()
    return posterior(scattered(factors, seed=1), factors)


def test_what_is_set_apart_comes_together_again(tree):
    apart = set_apart(tree)
    assert set(apart["posterior"].coords) <= set(apart["posterior"].dims)
    assert "case_direction" in apart["constant_data"]
    assert not {"chain", "draw"} & set(apart["constant_data"].dims)
    together = put_together(apart)
    xr.testing.assert_identical(together["posterior"].to_dataset(), tree["posterior"].to_dataset())
    assert "constant_data" not in together.children
    assert "case_direction" in tree["posterior"].coords, "what is given stays as it is"


def test_once_is_as_good_as_twice(tree):
    assert set_apart(set_apart(tree)).identical(set_apart(tree))
    assert put_together(tree).identical(tree)


def test_arviz_summarises_all_draws_at_once(tree):
    table = az.summary(set_apart(tree), kind="stats")
    assert len(table) == sum(draws[0, 0].size for draws in tree["posterior"].data_vars.values())


def test_factors_of_other_records_are_refused(tree):
    apart = set_apart(tree)
    few = apart["constant_data"].to_dataset().isel(record=np.arange(2))
    apart["constant_data"] = xr.DataTree(few)
    with pytest.raises(ValueError, match="record"):
        put_together(apart)
