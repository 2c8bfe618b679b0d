"""What a posterior would say of a case without one of its records: draws weighed anew, nothing fitted again."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.constant_data import put_together
from bayes_tyre.inference.diagnostics.leave_one_out.record_marginal import (
    hyperparameters,
    record_density,
    standard_points,
)
from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST, smooth_log_weights
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.datatree import CASE_PARAMETERS
from bayes_tyre.record import RECORD_UNITS


def case_without(tree: xr.DataTree, table: pd.DataFrame, record: str, interval: float = 0.95) -> pd.DataFrame:
    """Return k and beta of a record's case with the record and without it.

    Every draw is weighed by one over the density that it gives the record, the record's own parameters integrated out,
    by Pareto-smoothed importance sampling (Vehtari et al. 2024, "Pareto smoothed importance sampling").

    Parameters
    ----------
    tree, table:
        A posterior of records with independent noise, and the checked record table that it was fitted to, all points.
    record:
        Which is left out; another of its case must be there.
    interval:
        Probability inside `lower` and `upper`, equal-tailed.

    Returns
    -------
    pandas.DataFrame
        `parameter`, `unit`, `records` (``with`` | ``without``), `median`, `lower`, `upper`, `interval`, `pareto_k`,
        `origin`, `trusted`: whether `pareto_k` is at most 0.7; above it, fit again without the record.

    Raises
    ------
    BadInput
        For a record that is not there.
    """
    model = ModelSettings(repeats=tree.attrs["repeats"], noise=tree.attrs["noise"])
    records = prepare_records(table, model)
    names = records.batch.records
    if record not in names:
        raise BadInput(f"record {record!r} is not in the table; name one of {', '.join(names[:3])}, ...")
    one, posterior = (
        records.only(np.array([name == record for name in names]), model),
        put_together(tree)["posterior"].to_dataset(),
    )
    case, estimates = one.factors.of_record, estimate_records(one.batch, model.noise)
    of, z = hyperparameters(posterior, one.factors), standard_points(5, seed=0)
    density = record_density(one.likelihood, one.data, estimates, of, z)
    log_weights, pareto_k = smooth_log_weights(-np.asarray(density.log_density)[:, 0])
    weights = np.exp(log_weights - np.max(log_weights))
    tails, rows = [(1.0 - interval) / 2.0, 0.5, (1.0 + interval) / 2.0], []
    for parameter in CASE_PARAMETERS:
        draws = posterior[f"{parameter}_case"].transpose("chain", "draw", ...).to_numpy()[..., case[0]].ravel()
        for name, weighed in (("with", np.ones_like(weights)), ("without", weights)):
            lower, median, upper = np.quantile(draws, tails, method="inverted_cdf", weights=weighed)
            row = {"parameter": parameter, "unit": RECORD_UNITS[parameter], "records": name}
            row |= {"median": median, "lower": lower, "upper": upper, "interval": interval}
            row |= {"pareto_k": pareto_k if name == "without" else np.nan, "origin": tree.attrs["origin"]}
            rows.append(row | {"trusted": name == "with" or pareto_k <= PARETO_K_MOST})
    return pd.DataFrame(rows)
