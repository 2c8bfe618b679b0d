"""Log density of each record under a posterior, as ArviZ's group `log_likelihood`: for `az.loo` and `az.compare`."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.leave_one_out import as_measured, densities_of_records, thinned
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings

GROUP, VARIABLE = "log_likelihood", "record_force"


def with_log_likelihood(tree: xr.DataTree, table: pd.DataFrame, model: ModelSettings) -> xr.DataTree:
    """Return the posterior with a group `log_likelihood`: the log density of each record, dims chain, draw, record.

    A record is one observation, as in `compare`: its own k, beta and noise are integrated out. The group has about 500
    draws, evenly spaced among those of the posterior.

    Parameters
    ----------
    tree, table, model:
        The posterior, the checked record table that it was fitted to, and the model's settings.

    Raises
    ------
    BadInput
        For records that are not those of the posterior.
    """
    posterior = as_measured(thinned(tree))
    records = prepare_records(table, model)
    names = records.batch.records
    if "record" not in posterior.dims or [*map(str, posterior["record"].to_numpy())] != [*names]:
        raise BadInput("these are not the records that the posterior was fitted to; give the same table")
    densities = densities_of_records(posterior, records, model)
    sizes = posterior.sizes["chain"], posterior.sizes["draw"], len(names)
    group = xr.Dataset(
        {VARIABLE: (("chain", "draw", "record"), np.asarray(densities.log_density).reshape(sizes))},
        {**{name: posterior[name] for name in ("chain", "draw")}, "record": list(names)},
    )
    with_group = tree.copy()
    with_group[GROUP] = xr.DataTree(group)
    return with_group
