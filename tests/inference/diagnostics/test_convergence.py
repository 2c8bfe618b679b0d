"""The statistics that a tree keeps are those taken anew, of all quantities and of one."""

import numpy as np
import pytest
import xarray as xr

from bayes_tyre.inference.diagnostics.convergence import monitor, statistics_of, stored_statistics, with_statistics
from bayes_tyre.inference.sampling.common_scales import with_scale


def tree_of(chains: int) -> xr.DataTree:
    rng = np.random.default_rng(0)
    posterior = xr.Dataset(
        {
            "k_case": (("chain", "draw", "case"), rng.lognormal(size=(chains, 200, 3))),
            "sd_J": (("chain", "draw"), rng.standard_normal((chains, 200))),
        },
        {"case": ["a", "b", "c"]},
    )
    return xr.DataTree.from_dict({"posterior": posterior})


@pytest.mark.parametrize("chains", [1, 4])
def test_figures_kept_are_those_taken_anew(chains):
    tree = tree_of(chains)
    kept, anew = statistics_of(with_statistics(tree)), monitor(tree["posterior"].to_dataset())
    assert statistics_of(tree).ess_bulk.identical(anew.ess_bulk)
    for one, other in zip(kept, anew, strict=True):
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            xr.testing.assert_allclose(one.drop_vars("figure", errors="ignore"), other, rtol=0, atol=0)


def test_one_quantity_has_its_own():
    tree = with_statistics(tree_of(4))
    statistics = stored_statistics(tree, "k_case")
    assert statistics is not None
    assert statistics.r_hat is not None
    assert list(statistics.r_hat.data_vars) == ["k_case"]
    assert stored_statistics(tree, "beta_case") is None
    assert stored_statistics(tree_of(4), "k_case") is None


def test_a_common_factor_does_not_hide_chains_that_disagree():
    rng = np.random.default_rng(0)
    k = 2 * np.exp(0.003 * rng.standard_normal((4, 500)) + np.array([0, 0, 0, 0.008])[:, None])
    draws = {"k_case": (("chain", "draw", "case"), k[..., None])}
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset(draws, {"case": ["a"]})})
    plain = monitor(tree["posterior"].to_dataset())
    scaled = monitor(with_scale(tree, "force_scale", 0.05, 1)["posterior"].to_dataset())
    assert plain.r_hat is not None
    assert scaled.r_hat is not None
    assert float(plain.r_hat["k_case"][0]) > 1.2
    np.testing.assert_allclose(scaled.r_hat["k_case"], plain.r_hat["k_case"], rtol=1e-6)
    np.testing.assert_allclose(scaled.ess_bulk["k_case"], plain.ess_bulk["k_case"], rtol=1e-6)
    np.testing.assert_allclose(scaled.ess_tail["k_case"], plain.ess_tail["k_case"], rtol=1e-6)
    # 0.05 of 2, over the root of 2000 independent draws; the standard deviation of a sample sd of as many is 1.6 %.
    assert float(scaled.mcse_mean["k_case"][0]) == pytest.approx(0.1 / np.sqrt(2000), rel=0.15)
