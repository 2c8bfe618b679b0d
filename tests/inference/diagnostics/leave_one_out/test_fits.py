"""A fit without a record has the model of the fit with it, though a case may have too few repeats for it now.

A fit without one of two records has one record, whose noise says little of another's.
"""

import numpy as np
import pytest
import xarray as xr
from helpers.simulated_records import Plan, simulate
from scipy import stats

from bayes_tyre.inference.diagnostics.leave_one_out.fits import _refitted, with_noise_of_records
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record_table import check_record_table

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


@pytest.mark.slow
def test_a_fit_without_one_of_three_repeats_can_still_call_the_others_discordant():
    table = simulate(Plan(speeds=(0.0,), repeats=3), seed=1)[0]
    kept = (table["repeat"] == 1) | (table["record"].str.startswith("single (0)20-30"))
    model = ModelSettings(noise="iid")
    records = prepare_records(check_record_table(table[kept]), model)
    assert sorted(records.factors.repeats)[-2:] == [1, 3]
    one = int(np.argmax(records.factors.repeats[records.factors.of_record]))
    settings = SamplerSettings(chains=2, warmup=60, draws=20, target_accept=0.8)
    posterior = _refitted(records, np.arange(len(records.batch.records)) != one, settings, model)
    assert {"discordant_weight", "outlier_probability"} <= set(posterior.data_vars)
    assert posterior.sizes["record"] == len(records.batch.records) - 1


def test_correlated_noise_likewise_and_several_records_are_left_as_they_are():
    one = of_one("atanh_rho_typical", 0.4)
    assert set(with_noise_of_records(one, PRIORS, 1).data_vars) == {"atanh_rho_typical", "sd_atanh_rho"}
    several = of_one("sigma_typical", OWN).merge(of_one("sd_log_sigma", 0.3))
    assert with_noise_of_records(several, PRIORS, 1).identical(several)
