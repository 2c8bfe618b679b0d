"""The sampler's criteria by themselves: the error of a probability's mean."""

import arviz as az
import numpy as np
import pytest
import xarray as xr

from bayes_tyre.inference.diagnostics.sampling_checks import Check, mean_error


def test_the_error_of_a_mean_is_that_of_independent_draws_and_zero_without_variance():
    draws = np.random.default_rng(1).beta(1.0, 9.0, size=(4, 500, 3))
    draws[..., 1] = 0.3
    draws[..., 2] = 1.0
    error = mean_error(xr.DataArray(draws, dims=("chain", "draw", "record"), name="outlier_probability")).to_numpy()
    assert error[1:].tolist() == [0.0, 0.0]
    assert error[0] == pytest.approx(float(az.mcse(draws[..., 0], method="mean")), rel=1e-12)
    # Within 20 %: the ESS of 2000 independent draws is off by some per cent.
    assert error[0] == pytest.approx(draws[..., 0].std() / np.sqrt(2000), rel=0.2)


def test_chains_that_stand_apart_do_not_know_the_mean():
    apart = np.broadcast_to(np.array([0.0, 0.0, 1.0, 1.0])[:, None, None], (4, 500, 1))
    error = mean_error(xr.DataArray(apart, dims=("chain", "draw", "record"), name="outlier_probability"))
    assert float(error[0]) > 0.1


@pytest.mark.parametrize("passed", [True, False])
def test_a_check_shows_its_remedy_only_where_it_has_failed(passed):
    row = Check("bfmi", "sampling", passed, 0.5, 0.3, "chain 1", "energy: low", "raise --warmup").row
    assert list(row) == ["name", "kind", "passed", "value", "limit", "where", "remedy"]
    assert row["remedy"] == ("" if passed else "raise --warmup")
