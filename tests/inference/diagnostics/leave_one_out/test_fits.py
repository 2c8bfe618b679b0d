"""A fit without one of two records has one record, whose noise says little of another's."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.leave_one_out.fits import left_out, with_noise_of_records
from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST
from bayes_tyre.inference.model.default_priors import PRIORS

OWN = 0.03


def of_one(name: str, value: float) -> xr.Dataset:
    return xr.Dataset({name: (("chain", "draw"), np.full((4, 5000), value))})


def test_the_noise_of_another_record_follows_from_that_of_one():
    found = with_noise_of_records(of_one("sigma_typical", OWN), PRIORS, seed=1)
    sd, typical = found["sd_log_sigma"].to_numpy().ravel(), np.log(found["sigma_typical"].to_numpy()).ravel()
    # By quadrature: of the typical value, prior times likelihood of the record's own, at each of many deviations.
    grid_of_sd = stats.halfnorm(scale=PRIORS["sd_log_sigma"].parameters[0]).ppf((np.arange(400) + 0.5) / 400)
    t = np.linspace(-12.0, 4.0, 4001)
    prior = stats.norm.pdf(t, *PRIORS["sigma_typical"].parameters)
    density = prior * stats.norm.pdf(np.log(OWN), t, grid_of_sd[:, None])
    density /= density.sum(axis=1, keepdims=True)
    mean = float((density @ t).mean())
    spread = float(np.sqrt((density @ (t - mean) ** 2).mean()))
    # 20,000 independent draws: within five standard errors, one false alarm in a million.
    assert typical.mean() == pytest.approx(mean, abs=5 * spread / np.sqrt(20_000))
    assert typical.std() == pytest.approx(spread, rel=0.05)
    assert sd.mean() == pytest.approx(grid_of_sd.mean(), rel=0.03)


def test_correlated_noise_likewise_and_several_records_are_left_as_they_are():
    one = of_one("atanh_rho_typical", 0.4)
    assert set(with_noise_of_records(one, PRIORS, 1).data_vars) == {"atanh_rho_typical", "sd_atanh_rho"}
    several = of_one("sigma_typical", OWN).merge(of_one("sd_log_sigma", 0.3))
    assert with_noise_of_records(several, PRIORS, 1).identical(several)


def test_a_refit_that_fails_leaves_the_estimate_of_importance_sampling():
    densities = np.random.default_rng(2).normal(size=(4, 250, 3))
    densities[0, 0, 1] = -60.0  # the draw that all weight of this record would rest on
    attempts, told = Attempts(), []

    def refit(record: int) -> float:
        raise KeyError("sd_log_sigma")

    found = left_out(densities, ["a", "b", "c"], np.full(3, 99.0), refit, told.append, attempts)
    smoothed = left_out(densities, ["a", "b", "c"], np.full(3, 99.0), None, told.append)
    assert found.pareto_k[1] > PARETO_K_MOST
    assert told == ["b"]
    assert not found.refitted.any()
    np.testing.assert_array_equal(found.elpd.elpd_i.to_numpy(), smoothed.elpd.elpd_i.to_numpy())
    assert attempts.failed[0].reason.startswith("fit without b failed: KeyError: 'sd_log_sigma'; ")
