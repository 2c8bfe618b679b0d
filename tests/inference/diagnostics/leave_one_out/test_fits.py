"""A fit without one of two records has one record, whose noise says little of another's."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from bayes_tyre.inference.diagnostics.leave_one_out.fits import with_noise_of_records
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
