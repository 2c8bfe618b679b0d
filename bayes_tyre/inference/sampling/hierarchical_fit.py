"""From a table to a posterior: the two hierarchical fits, put together from their parts."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.inference.model.coordinates.laplace import RecordEstimates, empty_approximation, laplace_approximation
from bayes_tyre.inference.model.coordinates.sites import (
    hyperparameter_starts,
    published_in_coordinates,
    records_in_coordinates,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites, published_sites
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.datatree import scale_displacement, to_datatree
from bayes_tyre.inference.sampling.run import RUNS, SamplerSettings, make_chains, run_until_sound, runs_to_json
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.record_table import origin_of


def fit_hierarchical(
    table: pd.DataFrame,
    settings: SamplerSettings | None = None,
    model: ModelSettings | None = None,
    records: PreparedRecords | None = None,
) -> xr.DataTree:
    """Return the posterior of k, beta, J, C and sigma of every record, their cases and hyperparameters.

    Parameters
    ----------
    table:
        A checked record table (`bayes_tyre.record_table.check_record_table`).
    settings:
        How much to sample.
    model:
        Options of the model.
    records:
        The table's records as the model takes them, where they are at hand already.

    Returns
    -------
    xarray.DataTree
        Groups `posterior`, `sample_stats`; dims `record`, `case`, `group`, ...;
        units in `attrs["units"]`.

    Raises
    ------
    BadInput
        For a record with too few points or no travel.
    """
    settings, model = settings or SamplerSettings(), model or ModelSettings()
    tree = fit_prepared(records or prepare_records(table, model), settings, model)
    tree.attrs["origin"] = origin_of(table)
    if model.displacement_scale_sd > 0:
        tree = scale_displacement(tree, model.displacement_scale_sd, settings.seed)
    return tree


def fit_prepared(records: PreparedRecords, settings: SamplerSettings, model: ModelSettings) -> xr.DataTree:
    """Return the posterior of records as `fit_hierarchical` does, for displacement as it was measured."""
    factors, arguments = records.factors, records.arguments(model)
    # Least squares and the chains are compiled side by side: these need the shapes of the approximation alone.
    with ThreadPoolExecutor(1) as beside:
        estimating = beside.submit(
            laplace_approximation, records.batch, factors, model.noise, records.whitening, model.priors
        )
        blank = {"approximation": empty_approximation(len(records.batch.records), factors), **arguments}
        chains = make_chains(records_in_coordinates, blank, settings, starts_of(arguments))
        approximation = estimating.result()
    known = {"approximation": approximation, **arguments}
    draws, runs = run_until_sound(chains.given(known, starts_of(arguments, approximation.records)), settings)
    attributes = {name: str(getattr(model, name)) for name in ("repeats", "noise", "noise_window")}
    attributes |= {"model": "records", "priors": model.priors.to_json(), RUNS: runs_to_json(runs)}
    return to_datatree(draws.sites, draws.statistics, factors, records.factor_table, attributes)


def starts_of(arguments: Mapping[str, Any], estimates: RecordEstimates | None = None) -> dict[str, np.ndarray]:
    """Return where the hyperparameters of records start: their medians, and where estimates say more, these.

    Parameters
    ----------
    arguments:
        As `PreparedRecords.arguments` gives them.
    estimates:
        Of the records; None: not known yet.
    """
    priors = arguments["priors"]
    values = priors.medians()
    if estimates is not None:
        values["sd_J"] = np.sqrt(np.mean(np.asarray(estimates.centre[:, 1]) ** 2)) + 1e-3
    sites = prior_sites(arguments["factors"], arguments["repeats"], arguments["noise"])
    return hyperparameter_starts(sites, values, priors)


def fit_published(table: pd.DataFrame, settings: SamplerSettings | None = None, priors: Priors = PRIORS) -> xr.DataTree:
    """Return what printed case means of k and beta alone support, such as Tables 9 and 11.

    Parameters
    ----------
    table:
        A row a case: the case words, `k_kN_per_mm`, `beta_mm`.
    settings:
        How much to sample.
    """
    factors = find_factors(table[list(CASE_FACTORS)])
    columns = {"k": "k_kN_per_mm", "beta": "beta_mm"}
    values = {name: table[column].to_numpy(dtype=float) for name, column in columns.items()}
    arguments = {"values": values, "factors": factors, "priors": priors}
    starts = hyperparameter_starts(published_sites(factors), priors.medians(), priors)
    settings = settings or SamplerSettings()
    draws, runs = run_until_sound(make_chains(published_in_coordinates, arguments, settings, starts), settings)
    attributes = {"origin": "published", "model": "published", "priors": priors.to_json(), RUNS: runs_to_json(runs)}
    return to_datatree(draws.sites, draws.statistics, factors, pd.DataFrame({"record": []}), attributes)
