"""How well a fit predicts a record, or a case, that it has not seen: leave-one-out, all of its points at a time."""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Bool, Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.attempts import Attempt, directly
from bayes_tyre.inference.diagnostics.leave_one_out.case_marginal import densities_of_cases
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import LeaveOneOut, left_out
from bayes_tyre.inference.diagnostics.leave_one_out.record_marginal import (
    RecordDensity,
    hyperparameters,
    record_density,
    standard_points,
    unknowns,
)
from bayes_tyre.inference.model.collapsed.repeats import can_collapse
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.inference.sampling.hierarchical_fit import fit_prepared
from bayes_tyre.inference.sampling.run import SamplerSettings

#: Draws of the posterior at which each record's density is taken.
DRAWS = 500
#: Of the noise of records: its typical value, its standard deviation among records, to the scale on which it is normal,
#: and back.
_NOISE = (
    ("sigma_typical", "sd_log_sigma", np.log, np.exp),
    ("atanh_rho_typical", "sd_atanh_rho", np.positive, np.positive),
)


def leave_one_record_out(
    tree: xr.DataTree,
    table: pd.DataFrame,
    model: ModelSettings,
    refit: SamplerSettings | None = None,
    on_refit: Callable[[str], None] = lambda _: None,
    attempt: Attempt = directly,
) -> LeaveOneOut:
    """Return how well a fitted model predicts each record from the others.

    Parameters
    ----------
    tree, table, model:
        The posterior, the checked record table that it was fitted to, and the model's other settings.
    refit:
        Sampler settings of the refit where importance sampling fails; None: no refit, the estimate stays as it is.
    on_refit:
        Called with the record's name before each refit.
    attempt:
        Runs each refit; without the one that fails the estimate stays as it is.

    Raises
    ------
    BadInput
        With a single record: there is nothing to predict it from.
    """
    records = prepare_records(table, model)
    names = records.batch.records
    check_several(names)
    densities = densities_of_records(as_measured(thinned(tree)), records, model)

    def refit_without(record: int) -> Float[np.ndarray, "chains draws"]:
        return _refit_without(record, records, refit or SamplerSettings(), model)

    refitting = None if refit is None else refit_without
    by_chain, effective = _by_chain(densities, tree)
    return left_out(by_chain, names, effective, refitting, on_refit, attempt)


def check_several(records: Sequence[str]) -> None:
    """Raise BadInput for a single record: there is nothing to predict it from."""
    if len(records) < 2:
        raise BadInput("one record cannot be predicted from others; models are compared on two or more")


def leave_one_case_out(
    tree: xr.DataTree,
    table: pd.DataFrame,
    model: ModelSettings,
    refit: SamplerSettings | None = None,
    on_refit: Callable[[str], None] = lambda _: None,
    attempt: Attempt = directly,
) -> LeaveOneOut | None:
    """Return how well a fitted model predicts the records of each case from the other cases.

    None for models whose cases cannot be integrated out, with Student-t repeats or noise or more than six repeats of a
    case, and for a single case.
    Parameters are those of `leave_one_record_out`.
    """
    records = prepare_records(table, model)
    labels = [case.label for case in records.factors.cases]
    if len(labels) < 2 or model.noise == "student" or not can_collapse(records.factors, model.repeats):
        return None
    densities = densities_of_cases(as_measured(thinned(tree)), records, model)

    def refit_without(case: int) -> Float[np.ndarray, "chains draws"]:
        others = records.factors.of_record != case
        posterior = _refitted(records, others, refit or SamplerSettings(), model)
        of_case = densities_of_cases(posterior, records.only(~others, model), model)
        return np.asarray(of_case.log_density)[:, case].reshape(posterior.sizes["chain"], -1)

    refitting = None if refit is None else refit_without
    by_chain, effective = _by_chain(densities, tree)
    return left_out(by_chain, labels, effective, refitting, on_refit, attempt)


def _by_chain(densities: RecordDensity, tree: xr.DataTree) -> tuple[np.ndarray, np.ndarray]:
    """Return log densities by chain, and the typical number of points that the integral of each unit rests on."""
    log_density = np.asarray(densities.log_density)
    by_chain = log_density.reshape(tree["posterior"].sizes["chain"], -1, log_density.shape[1])
    return by_chain, np.median(np.asarray(densities.effective_points), axis=0)


def thinned(tree: xr.DataTree) -> xr.Dataset:
    """Return about `DRAWS` of a posterior's draws, evenly spaced."""
    posterior = tree["posterior"].to_dataset()
    every = max(1, posterior.sizes["chain"] * posterior.sizes["draw"] // DRAWS)
    return posterior.isel(draw=slice(None, None, every))


def with_noise_of_records(posterior: xr.Dataset, priors: Priors, seed: int) -> xr.Dataset:
    """Return the posterior of a single record with what another record's noise is drawn from; any other as it is.

    The model of one record has its noise alone, not that of records in general. How much these differ is then as the
    prior has it, and their typical value follows from the record's own, by a normal prior and a normal likelihood.

    Parameters
    ----------
    posterior:
        Dims chain, draw, ...
    priors:
        That it was fitted with.
    seed:
        Of what is drawn.
    """
    random, added = np.random.default_rng(seed), {}
    for typical, sd_name, log, exp in _NOISE:
        if typical in posterior and sd_name not in posterior:
            of_one, (centre, width) = posterior[typical], priors[typical].parameters
            own, sd = log(of_one.to_numpy()), priors[sd_name].scipy().rvs(of_one.shape, random_state=random)
            share = width**2 / (width**2 + sd**2)
            drawn = centre + share * (own - centre) + sd * np.sqrt(share) * random.standard_normal(own.shape)
            added |= {typical: of_one.copy(data=exp(drawn)), sd_name: of_one.copy(data=sd)}
    return posterior.assign(added)


def densities_of_records(posterior: xr.Dataset, records: PreparedRecords, model: ModelSettings) -> RecordDensity:
    """Return the density of records under a posterior's hyperparameters; shape (draws, records)."""
    estimates = estimate_records(records.batch, model.correlation, records.whitening, law=model.law)
    draws = hyperparameters(posterior, records.factors)
    z = standard_points(unknowns(model.correlation), seed=0)
    return record_density(records.likelihood, records.data, estimates, draws, z, model.priors.discordant_widening)


def _refit_without(
    record: int, records: PreparedRecords, settings: SamplerSettings, model: ModelSettings
) -> Float[np.ndarray, "chains draws"]:
    """Return the log density of a record at draws of a fit without it; its case stays, if only by its factors."""
    others = np.arange(len(records.batch.records)) != record
    posterior = _refitted(records, others, settings, model)
    densities = densities_of_records(posterior, records.only(~others, model), model)
    return np.asarray(densities.log_density)[:, 0].reshape(posterior.sizes["chain"], -1)


def _refitted(
    records: PreparedRecords, others: Bool[np.ndarray, " records"], settings: SamplerSettings, model: ModelSettings
) -> xr.Dataset:
    """Return draws of a fit of the same model to some of the records."""
    posterior = thinned(fit_prepared(records.only(others, model), settings, model))
    return with_noise_of_records(posterior, model.priors, settings.seed)
