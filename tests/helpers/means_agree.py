"""Two posteriors of the same quantities: whether their means agree within their Monte Carlo errors."""

import arviz as az
import numpy as np
import xarray as xr


def assert_means_agree(one: xr.Dataset, other: xr.Dataset, least: int) -> None:
    """Fail where a mean differs by 5 errors, or fewer than `least` are compared.

    Of some 120 to 230 means, with errors known to a tenth, one beyond 5 of them comes up in 1 of 1000 seeds.
    """
    error = np.sqrt(az.mcse(one) ** 2 + az.mcse(other) ** 2)
    off = (one.mean(("chain", "draw")) - other.mean(("chain", "draw"))) / error
    values = np.concatenate([np.atleast_1d(each).ravel() for each in off.data_vars.values()])
    assert len(values) > least
    assert np.isfinite(values).all()
    assert np.abs(values).max() < 5
