"""From a table to a posterior: the two hierarchical fits, put together from their parts."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from bayes_tyre.batch import Batch, pad
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import Whitening, smoothed_noise
from bayes_tyre.inference.least_squares.table import LARGEST, REGIONS, THESIS_SHARE
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import hyperparameter_starts, prior_sites, published_sites
from bayes_tyre.inference.model.coordinates.laplace import (
    LaplaceApproximation,
    RecordEstimates,
    empty_approximation,
    laplace_approximation,
)
from bayes_tyre.inference.model.likelihood import DirectLikelihood, Likelihood, compress
from bayes_tyre.inference.model.models import NOISE, published_model, records_model
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.model.repeat_distribution import REPEATS
from bayes_tyre.inference.record_data import RecordData, record_data
from bayes_tyre.inference.sampling.datatree import scale_displacement, to_datatree
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.run import SamplerSettings, run, sample
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.record_table import origin_of, record_factors

#: F_i, J, k, beta and sigma of a record, and one point to spare.
LEAST_POINTS = 6
INITIAL_LOADS = ("nominal", "actual")
LIKELIHOODS = ("compressed", "direct")


@dataclass(frozen=True)
class ModelSettings:
    """Options of the hierarchical model of records.

    Attributes
    ----------
    region:
        ``all`` points of each record, or ``thesis``: the source's first 70 %.
    initial_load:
        What k and beta may change with: ``nominal``, an effect of each `initial_load_kN`, or ``actual``, a slope
        over the mean force that a case's records really started from.
    displacement_scale_sd:
        Relative standard deviation of a common factor on displacement, carried into k and beta; 0: none.
    likelihood:
        ``compressed``: independent of the number of points; or ``direct``, point by point: the reference.
    repeats:
        How repeats scatter about their case: a ``mixture`` of usual and discordant ones, ``student`` or ``normal``.
    noise:
        ``iid``: independent from point to point; or ``ar1``: each point's follows the one before.
    noise_window:
        Samples of the moving average that went over the noise, such as 801; 1: none. Not with ``ar1``.
    priors:
        Of the hyperparameters, and the widening of discordant repeats.

    Raises
    ------
    BadInput
        For unknown names, and a standard deviation that is negative or not finite.
    """

    region: str = "all"
    initial_load: str = "nominal"
    displacement_scale_sd: float = 0.0
    likelihood: str = "compressed"
    repeats: str = "mixture"
    noise: str = "iid"
    noise_window: int = 1
    priors: Priors = PRIORS

    def __post_init__(self) -> None:
        for name, allowed in (
            *(("region", REGIONS), ("initial_load", INITIAL_LOADS), ("likelihood", LIKELIHOODS)),
            *(("repeats", REPEATS), ("noise", NOISE)),
        ):
            if getattr(self, name) not in allowed:
                raise BadInput(f"{name} {getattr(self, name)!r} is unknown; use {' or '.join(allowed)}")
        if not 0 <= self.displacement_scale_sd < np.inf:
            raise BadInput(
                f"displacement_scale_sd is {self.displacement_scale_sd}; give 0 or a relative sd such as 0.05"
            )
        if self.noise_window < 1:
            raise BadInput(f"noise_window is {self.noise_window}; give the samples averaged, or 1 for none")
        if self.noise_window > 1 and self.noise != "iid":
            raise BadInput(
                f"noise_window {self.noise_window} says all of the noise; give it without noise {self.noise}"
            )


def used_points(table: pd.DataFrame, region: str) -> pd.DataFrame:
    """Return the rows of a checked table that a region uses: all, or the first 70 % of each record (appendix B5)."""
    if region == "all":
        return table
    by_record = table.groupby("record", sort=False)["record"]
    kept = by_record.cumcount() < np.ceil(THESIS_SHARE * by_record.transform("size"))
    return table[kept].reset_index(drop=True)


def record_batch(table: pd.DataFrame) -> Batch:
    """Return every record of a checked table as one batch.

    Raises
    ------
    BadInput
        For a record with too few points or no travel: a hierarchical fit drops no record.
    """
    names, displacement, force = [], [], []
    for name, rows in table.groupby("record", sort=False):
        names.append(str(name))
        displacement.append(rows["displacement_mm"].to_numpy(dtype=float))
        force.append(rows["force_kN"].to_numpy(dtype=float))
        for column, values in (("displacement_mm", displacement[-1]), ("force_kN", force[-1])):
            if np.abs(values).max() > LARGEST:
                raise BadInput(
                    f"record {name!r}, column {column}: {np.abs(values).max():g} is above {LARGEST:g}, too large to be "
                    "squared; check the cells"
                )
        if len(rows) < LEAST_POINTS:
            raise BadInput(f"record {name!r}: {len(rows)} points, a fit needs {LEAST_POINTS}; remove the record")
        if np.ptp(displacement[-1]) == 0 or np.ptp(force[-1]) == 0:
            still = "displacement_mm" if np.ptp(displacement[-1]) == 0 else "force_kN"
            raise BadInput(f"record {name!r}: {still} is constant, nothing to fit; remove the record")
    return pad(tuple(names), displacement, force)


def fit_hierarchical(
    table: pd.DataFrame, settings: SamplerSettings | None = None, model: ModelSettings | None = None
) -> xr.DataTree:
    """Return the posterior of k, beta, J, C and sigma of every record, their cases and populations.

    Parameters
    ----------
    table:
        A checked record table (`bayes_tyre.record.check_record_table`).
    settings:
        How much to sample.
    model:
        Options of the model.

    Returns
    -------
    xarray.DataTree
        Groups `posterior`, `sample_stats`; dims `record`, `case`, `cell`, ...;
        units in `attrs["units"]`.

    Raises
    ------
    BadInput
        For a record with too few points or no travel.
    """
    settings, model = settings or SamplerSettings(), model or ModelSettings()
    batch, factor_table, factors = batch_and_factors(table, model)
    tree = fit_batch(batch, factor_table, factors, settings, model)
    tree.attrs["origin"] = origin_of(table)
    if model.displacement_scale_sd > 0:
        tree = scale_displacement(tree, model.displacement_scale_sd, settings.seed)
    return tree


def batch_and_factors(table: pd.DataFrame, model: ModelSettings) -> tuple[Batch, pd.DataFrame, Factors]:
    """Return the records that a model uses of a checked table, and their factors as a table and as index arrays.

    Raises
    ------
    BadInput
        For a record with too few points or no travel.
    """
    batch = record_batch(used_points(table, model.region))
    travel = np.abs(batch.displacement_mm - batch.displacement_mm[:, :1]).max(axis=1)
    factor_table = record_factors(table).assign(travel_mm=travel)
    return (
        batch,
        factor_table,
        find_factors(factor_table, batch.force_kN[:, 0] if model.initial_load == "actual" else None),
    )


def fit_batch(
    batch: Batch, factor_table: pd.DataFrame, factors: Factors, settings: SamplerSettings, model: ModelSettings
) -> xr.DataTree:
    """Return the posterior of a batch of records as `fit_hierarchical` does, for displacement as it was measured.

    Parameters
    ----------
    batch, factor_table, factors:
        As `batch_and_factors` gives them; levels may hold cases without a record.
    settings, model:
        How much to sample, and of what.
    """
    whitening, data = whitening_for(batch, model), record_data(batch)
    likelihood, sites = likelihood_of(data, model, whitening), prior_sites(factors, model.repeats, model.noise)

    def arguments(approximation: LaplaceApproximation) -> dict[str, Any]:
        of_records = {"likelihood": likelihood, "data": data, "approximation": approximation}
        return {
            **of_records,
            "factors": factors,
            "repeats": model.repeats,
            "noise": model.noise,
            "priors": model.priors,
        }

    # Least squares and the chains are compiled side by side: these need to know the shapes of the picture alone.
    with ThreadPoolExecutor(1) as beside:
        drawing = beside.submit(laplace_approximation, batch, factors, model.noise, whitening, model.priors)
        blank, medians = (
            arguments(empty_approximation(len(batch.records), factors)),
            hyperparameter_starts(sites, model.priors.medians(), model.priors),
        )
        chains = Chains(records_model, blank, settings.chains, settings.warmup, medians)
        approximation = drawing.result()
    draws = run(
        chains.given(
            arguments(approximation),
            hyperparameter_starts(sites, _starts(approximation.records, model.priors), model.priors),
        ),
        settings,
    )
    attributes = {name: str(getattr(model, name)) for name in ("repeats", "noise", "noise_window")}
    attributes |= {"model": "records", "priors": model.priors.to_json()}
    return to_datatree(draws.sites, draws.statistics, factors, factor_table, attributes)


def whitening_for(batch: Batch, model: ModelSettings) -> Whitening | None:
    """Return the whitening of noise that was smoothed, for records as long as the longest of a batch."""
    return smoothed_noise(int(batch.points.max()), model.noise_window) if model.noise_window > 1 else None


def likelihood_of(data: RecordData, model: ModelSettings, whitening: Whitening | None) -> Likelihood:
    """Return the likelihood of the records that a model uses."""
    if model.likelihood == "direct":
        return DirectLikelihood(data, whitening)
    return compress(data, neighbours=model.noise == "ar1", whitening=whitening)


def _starts(records: RecordEstimates, priors: Priors) -> dict[str, np.ndarray]:
    """Return where each population starts: its median, and where the records' own estimates say more, these."""
    starts = priors.medians()
    starts["sd_J"] = np.asarray(np.sqrt(np.mean(np.asarray(records.centre[:, 1]) ** 2)) + 1e-3)
    return starts


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
    draws = sample(published_model, arguments, settings or SamplerSettings(), starts)
    attributes = {"origin": "published", "model": "published", "priors": priors.to_json()}
    return to_datatree(draws.sites, draws.statistics, factors, pd.DataFrame({"record": []}), attributes)
