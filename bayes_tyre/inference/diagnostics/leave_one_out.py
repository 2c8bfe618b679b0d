"""How well a model predicts a record that it has not seen: leave-one-record-out, a whole record at a time.

Draws of the posterior with the record are reweighted to the posterior without it, by ArviZ's leave-one-out with
Pareto-smoothed importance sampling (Vehtari et al. 2024); where k-hat says that this fails, the model is fitted again
without the record.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import arviz as az
import numpy as np
import pandas as pd
import xarray as xr
from arviz_stats import ELPDData
from jaxtyping import Float

from bayes_tyre.batch import Batch
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST
from bayes_tyre.inference.diagnostics.record_marginal import (
    RecordDensity,
    hyperparameters,
    record_density,
    standard_points,
)
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.inference.sampling.hierarchical_fit import (
    ModelSettings,
    batch_and_factors,
    fit_batch,
    likelihood_of,
    whitening_for,
)
from bayes_tyre.inference.sampling.run import SamplerSettings

#: Draws of the posterior at which each record's density is taken.
DRAWS = 500
#: Least effective number of points of the integral over a record's own parameters.
EFFECTIVE_LEAST = 20.0


@dataclass(frozen=True)
class LeaveOneOut:
    """What a model predicts of each record that it has not seen.

    Attributes
    ----------
    elpd:
        ArviZ's sum and record-wise values of the log predictive density.
    pareto_k:
        Shape (records,): of the importance weights, before any refit.
    refitted:
        Shape (records,): True where the model was fitted again without the record.
    effective_points:
        Shape (records,): effective number of points of the integral over the record's own parameters.
    """

    elpd: ELPDData
    pareto_k: Float[np.ndarray, " records"]
    refitted: np.ndarray
    effective_points: Float[np.ndarray, " records"]


def as_measured(posterior: xr.Dataset) -> xr.Dataset:
    """Return the cases of a posterior for displacement as it was measured, where it has a factor on displacement."""
    if "displacement_scale" not in posterior:
        return posterior
    factor = posterior["displacement_scale"]
    return posterior.assign(k_case=posterior["k_case"] * factor, beta_case=posterior["beta_case"] / factor)


def leave_one_record_out(
    tree: xr.DataTree,
    table: pd.DataFrame,
    model: ModelSettings,
    refit: SamplerSettings | None = None,
    on_refit: Callable[[str], None] = lambda _: None,
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

    Raises
    ------
    BadInput
        With a single record: there is nothing to predict it from.
    """
    batch, factor_table, factors = batch_and_factors(table, model)
    if len(batch.records) < 2:
        raise BadInput("one record cannot be predicted from others; models are compared on two or more")
    densities = _densities(as_measured(thinned(tree)), batch, factors, factors.of_record, model)
    chains = tree["posterior"].sizes["chain"]
    by_chain = np.asarray(densities.log_density).reshape(chains, -1, len(batch.records))
    effective = np.median(np.asarray(densities.effective_points), axis=0)

    def refit_without(record: int) -> float:
        return _refit_without(record, batch, factor_table, factors, refit or SamplerSettings(), model)

    return left_out(by_chain, batch.records, effective, refit_without if refit is not None else None, on_refit)


def left_out(
    by_chain: Float[np.ndarray, "chains draws records"],
    records: Sequence[str],
    effective: Float[np.ndarray, " records"],
    refit_without: Callable[[int], float] | None,
    on_refit: Callable[[str], None],
) -> LeaveOneOut:
    """Return the log predictive densities of records left out, from those at draws of the posterior with them.

    Parameters
    ----------
    by_chain:
        Log densities of the records, their own parameters integrated out.
    records:
        Their names.
    effective:
        Effective numbers of points of those integrals.
    refit_without:
        Gives the log predictive density of a record from a fit without it, where importance sampling fails; None:
        no refit.
    on_refit:
        Called with the record's name before each refit.
    """
    tree = az.from_dict(
        {"posterior": {"level": by_chain.mean(axis=2)}, "log_likelihood": {"record_force": by_chain}},
        coords={"record": list(records)},
        dims={"record_force": ["record"], "level": []},
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Estimated shape parameter", UserWarning)
        elpd = az.loo(tree, pointwise=True, reff=1.0)
    assert isinstance(elpd, ELPDData)
    pareto_k = elpd.pareto_k.to_numpy()
    failed, values = np.zeros(len(pareto_k), bool), elpd.elpd_i.copy()
    if refit_without is not None:
        failed = pareto_k > PARETO_K_MOST
        for record in map(int, np.flatnonzero(failed)):
            on_refit(records[record])
            values[record] = refit_without(record)
    elpd.elpd_i, elpd.elpd = values, float(values.sum())
    elpd.se = float(np.sqrt(len(values) * values.var()))
    return LeaveOneOut(elpd, pareto_k, failed, effective)


def thinned(tree: xr.DataTree) -> xr.Dataset:
    """Return about `DRAWS` of a posterior's draws, evenly spaced."""
    posterior = tree["posterior"].to_dataset()
    every = max(1, posterior.sizes["chain"] * posterior.sizes["draw"] // DRAWS)
    return posterior.isel(draw=slice(None, None, every))


def _densities(
    posterior: xr.Dataset, batch: Batch, factors: Factors, cases: np.ndarray, model: ModelSettings
) -> RecordDensity:
    """Return the density of the records of a batch, whose cases are given, under a posterior's hyperparameters."""
    data, whitening = record_data(batch), whitening_for(batch, model)
    estimates = estimate_records(batch, model.noise, whitening)
    draws = hyperparameters(posterior, factors, cases)
    z = standard_points(6 if model.noise == "ar1" else 5, seed=0)
    likelihood, widening = likelihood_of(data, model, whitening), model.priors.discordant_widening
    return record_density(likelihood, data, estimates, draws, z, widening)


def _refit_without(
    record: int,
    batch: Batch,
    factor_table: pd.DataFrame,
    factors: Factors,
    settings: SamplerSettings,
    model: ModelSettings,
) -> float:
    """Return the log predictive density of a record from a fit without it; its case stays, if only by its factors."""
    others = np.arange(len(batch.records)) != record
    without = replace(factors, of_record=factors.of_record[others])
    posterior = fit_batch(_select(batch, others), factor_table[others].reset_index(drop=True), without, settings, model)
    densities = _densities(thinned(posterior), _select(batch, ~others), factors, factors.of_record[~others], model)
    log_density = np.asarray(densities.log_density)[:, 0]
    return float(np.logaddexp.reduce(log_density) - np.log(len(log_density)))


def _select(batch: Batch, mask: np.ndarray) -> Batch:
    names = tuple(name for name, is_selected in zip(batch.records, mask, strict=True) if is_selected)
    return Batch(names, batch.displacement_mm[mask], batch.force_kN[mask], batch.present[mask])
