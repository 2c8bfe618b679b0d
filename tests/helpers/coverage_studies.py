"""Made-up estimates of the study of coverage: normal errors about the simulated truth, and a verdict by number."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.studies.coverage import QUANTITIES, CoverageFit, intervals
from bayes_tyre.studies.coverage_data import KINDS, simulate

SD_LOG = 0.05


def posterior_about(truth: pd.DataFrame, seed: int) -> xr.Dataset:
    """Return two chains of draws of each quantity, log-normal about an estimate that is as far from the truth."""
    rng, quantities = np.random.default_rng(seed), {}
    for name, dim in QUANTITIES.items():
        if name not in truth:  # what is predicted and not estimated
            continue
        true = truth.drop_duplicates(dim).set_index(dim)[name]
        estimate = np.log(true.to_numpy()) + SD_LOG * rng.standard_normal(len(true))
        draws = np.exp(estimate + SD_LOG * rng.standard_normal((2, 50, len(true))))
        quantities[name] = xr.DataArray(draws, {dim: true.index.to_numpy()}, ("chain", "draw", dim))
    return xr.Dataset(quantities)


def estimated(_: CoverageFit, name: str, seed: int, number: int) -> pd.DataFrame:
    """Return what `CoverageFit.estimate` would; data sets of odd number fail two checks."""
    truth = simulate(KINDS[name], seed, number)[1]
    rows = intervals(posterior_about(truth, number), truth)
    rows.insert(0, "kind", name)
    rows.insert(1, "settings", KINDS[name].settings)
    rows.insert(2, "set", number)
    verdict, failed = ("fail", "r_hat; law") if number % 2 else ("pass", "")
    return rows.assign(verdict=verdict, failed_checks=failed, seconds=2.0, origin="simulated")
