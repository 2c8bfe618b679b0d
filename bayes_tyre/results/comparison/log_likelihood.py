"""Log density of each record under a posterior, as ArviZ's group `log_likelihood`: for `az.loo` and `az.compare`."""

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.leave_one_out.fits import check_several, densities_of_records, thinned
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.inference.sampling.datatree import OPTIONS, attributes_of, model_of
from bayes_tyre.results.fitted_records import fitted_records

GROUP, VARIABLE = "log_likelihood", "record_force"


def with_log_likelihood(tree: xr.DataTree, table: pd.DataFrame) -> xr.DataTree:
    """Return the posterior with a group `log_likelihood`: the log density of each record, dims chain, draw, record.

    A record is one observation, as in `compare`: its own k, beta and noise are integrated out. It takes time, so about
    500 draws are kept, evenly spaced, of `posterior` as well: ArviZ compares the numbers of both.

    Parameters
    ----------
    tree, table:
        The posterior, and the checked record table that it was fitted to, its records in any order.

    Raises
    ------
    BadInput
        For records that are not those of the posterior, and for a single one, which no other can predict.
    """
    posterior = thinned(tree)
    if "record" not in posterior.dims:
        raise BadInput("the posterior is of no records, so none can be left out; fit a record table")
    names, model = [str(name) for name in posterior["record"].to_numpy()], model_of(tree)
    check_several(names)
    records = prepare_records(fitted_records(tree, table), model)
    densities = densities_of_records(as_measured(posterior), records, model)
    sizes = posterior.sizes["chain"], posterior.sizes["draw"], len(names)
    group = xr.Dataset(
        {VARIABLE: (("chain", "draw", "record"), np.asarray(densities.log_density).reshape(sizes))},
        {**{name: posterior[name] for name in ("chain", "draw")}, "record": names},
    )
    with_group = tree.copy()
    with_group["posterior"], with_group[GROUP] = xr.DataTree(posterior), xr.DataTree(group)
    return with_group


def check_same_model(tree: xr.DataTree, model: ModelSettings) -> None:
    """Refuse a model that is not the one that a posterior of records was fitted with.

    Raises
    ------
    BadInput
        Naming the first option that differs.
    """
    fitted, given = attributes_of(model_of(tree)), attributes_of(model)
    for name in OPTIONS:
        if name in tree.attrs and fitted[name] != given[name]:
            raise BadInput(f"the posterior was fitted with {name} {fitted[name]}, not {given[name]}; leave model out")
    if fitted["priors"] != given["priors"]:
        raise BadInput("the posterior was fitted with other priors; leave priors out")
