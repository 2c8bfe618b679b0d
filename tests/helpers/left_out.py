"""Leave-one-record-out results put there instead of computed."""

import numpy as np
import xarray as xr
from arviz_stats import ELPDDataLOO

from bayes_tyre.inference.diagnostics.leave_one_out.left_out import LeaveOneOut


def made_up(
    elpd: np.ndarray,
    records: list[str],
    pareto_k: float = 0.1,
    effective: float = 200.0,
    disagreeing: bool = False,
    few_draws: bool = False,
) -> LeaveOneOut:
    """Return a result with these log predictive densities of the records."""
    values = xr.DataArray(elpd, dims="record", coords={"record": records})
    k = np.full(len(records), pareto_k)
    data = ELPDDataLOO(
        elpd=float(values.sum()),
        se=float(np.sqrt(len(records) * np.var(elpd))),
        p=1.0,
        n_samples=100,
        n_data_points=len(records),
        scale="log",
        warning=False,
        good_k=0.7,
        elpd_i=values,
        pareto_k=xr.DataArray(k, dims="record", coords={"record": records}),
    )
    none = np.zeros(len(records), bool)
    return LeaveOneOut(data, k, none, np.full(len(records), effective), none | disagreeing, none | few_draws)
