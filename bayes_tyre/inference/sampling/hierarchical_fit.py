"""From a table to a posterior: the two hierarchical fits, put together from their parts."""

from concurrent.futures import ThreadPoolExecutor

import pandas as pd
import xarray as xr

from bayes_tyre.inference.model.collapsed.repeats import can_collapse
from bayes_tyre.inference.model.coordinates.laplace import empty_approximation
from bayes_tyre.inference.model.coordinates.sites import (
    hyperparameter_starts,
    published_in_coordinates,
    record_starts,
    records_in_coordinates,
)
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites, published_sites, unused_priors
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.collapsed_fit import ATTEMPTS, sample_collapsed
from bayes_tyre.inference.sampling.common_scales import with_scale, with_scales_of
from bayes_tyre.inference.sampling.datatree import RECORDS_DIGEST, attributes_of, to_datatree
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.run import (
    RUNS,
    RUNS_AT_MOST,
    Draws,
    SamplerRun,
    SamplerSettings,
    after_runs,
    make_chains,
    run_until_sound,
    runs_to_json,
)
from bayes_tyre.inference.sampling.summary_error import RECORD_SUMMARIES
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.record_table import origin_of

#: Fewest records that are integrated out: fewer are sampled as quickly, and leave sd_J and the typical noise wide open.
LEAST_COLLAPSED = 100


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
    settings, model = settings or SamplerSettings(), with_scales_of(table, model or ModelSettings())
    records = records or prepare_records(table, model)
    if text := without_effect(records.factors, model):
        settings.on_note(text)
    if model.noise == "student" and model.sampler == "collapsed" and len(records.batch.records) >= LEAST_COLLAPSED:
        settings.on_note("noise student has no summaries of records: records are sampled as well")
    tree = fit_prepared(records, settings, model)
    tree.attrs["origin"] = origin_of(table)
    if model.displacement_scale_sd:
        tree = with_scale(tree, "displacement_scale", model.displacement_scale_sd, settings.seed)
    if model.force_scale_sd:
        tree = with_scale(tree, "force_scale", model.force_scale_sd, settings.seed + 1)
    return tree


def without_effect(factors: Factors, model: ModelSettings) -> str:
    """Return which priors were changed of quantities that the model of these records does not have; nothing if none."""
    unused = unused_priors(model.priors, prior_sites(factors, model.repeats, model.correlation))
    return f"priors of {', '.join(unused)}: not in the model of these records, so without effect" if unused else ""


def fit_prepared(
    records: PreparedRecords, settings: SamplerSettings, model: ModelSettings, chains: Chains | None = None
) -> xr.DataTree:
    """Return the posterior of records as `fit_hierarchical` does, for displacement as it was measured.

    `chains`, of `joint_chains`, may be those of other records of the same factors and number of points.
    """
    attributes = {"model": "records", RECORDS_DIGEST: records.measured.digest, **attributes_of(model)}
    draws, runs = None, ()
    if collapses(records, model):
        draws, runs, error = sample_collapsed(records, settings, model)
        attributes[RECORD_SUMMARIES] = error.to_json()
    if draws is None:
        draws, joint = _sample_joint(
            records, after_runs(settings, ATTEMPTS * RUNS_AT_MOST) if runs else settings, model, chains
        )
        runs += joint
    attributes[RUNS] = runs_to_json(runs)
    return to_datatree(draws.sites, draws.statistics, records.factors, records.factor_table, attributes)


def collapses(records: PreparedRecords, model: ModelSettings) -> bool:
    """Return whether records are integrated out: of few, what they share is not known well enough for summaries.

    Nor are they with Student-t noise, which keeps F_i and J of each open.
    """
    quadratic = model.noise != "student" and can_collapse(records.factors, model.repeats)
    return model.sampler == "collapsed" and len(records.batch.records) >= LEAST_COLLAPSED and quadratic


def joint_chains(records: PreparedRecords, settings: SamplerSettings, model: ModelSettings) -> Chains:
    """Return the chains of the joint sampler compiled for records, which need not be estimated for it."""
    arguments = records.arguments(model)
    blank = {"approximation": empty_approximation(len(records.batch.records), records.factors), **arguments}
    return make_chains(records_in_coordinates, blank, settings, record_starts(arguments))


def _sample_joint(
    records: PreparedRecords, settings: SamplerSettings, model: ModelSettings, chains: Chains | None
) -> tuple[Draws, tuple[SamplerRun, ...]]:
    """Return draws of the joint sampler, and its runs."""
    arguments = records.arguments(model)
    # Least squares runs while the chains compile, which need only the shapes of the approximation.
    with ThreadPoolExecutor(1) as beside:
        estimating = beside.submit(records.approximation, model)
        chains = chains or joint_chains(records, settings, model)
        approximation = estimating.result()
    data = {"approximation": approximation, **arguments}
    return run_until_sound(chains.given(data, record_starts(arguments, approximation.records)), settings)


def fit_published(table: pd.DataFrame, settings: SamplerSettings | None = None, priors: Priors = PRIORS) -> xr.DataTree:
    """Return what printed case means of k and beta alone support, such as Tables 9 and 11.

    Parameters
    ----------
    table:
        A row a case: the factors, `k_kN_per_mm`, `beta_mm`.
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
