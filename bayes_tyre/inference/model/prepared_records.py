"""From a checked record table to what the model of records takes, made once for all that needs it."""

from dataclasses import replace
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from bayes_tyre.batch import Batch, pad
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import (
    SharedError,
    UnequalNoise,
    Whitening,
    shared_error,
    smoothed_noise,
    whitening_of,
)
from bayes_tyre.inference.least_squares.status import LARGEST
from bayes_tyre.inference.least_squares.table import THESIS_SHARE
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, estimate_records, laplace_approximation
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.likelihood.compressed import compress
from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood, Likelihood
from bayes_tyre.inference.model.likelihood.student import StudentLikelihood
from bayes_tyre.inference.model.noise.converter_steps import between_steps, converter_step_mm
from bayes_tyre.inference.model.noise.displacement_errors import DisplacementErrors, displacement_errors
from bayes_tyre.inference.model.noise.displacement_noise import displacement_noise_mm
from bayes_tyre.inference.model.noise.heavy_tails import check_independent, estimated_heavy_tails
from bayes_tyre.inference.model.noise.rest import at_rest
from bayes_tyre.inference.model.noise.uneven_noise import uneven_noise
from bayes_tyre.inference.model.record_levels import find_levels
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import RecordData, record_data
from bayes_tyre.record import FORCE_PER_KG, MASS_SD
from bayes_tyre.record_table import record_factors

#: F_i, J, k, beta and sigma of a record, and one point to spare.
LEAST_POINTS = 6
_ERROR = "force_error_kN"
#: Largest standard deviation of rounding to steps of 1, as somebody may have put it, and no other noise beside it.
_ROUNDED = 0.3


class RecordNoise(NamedTuple):
    """Records whose noise has mean zero, and what that noise is like.

    Attributes
    ----------
    batch:
        The records.
    whitening:
        What makes their noise independent or autoregressive; None: it is.
    displacement_sd_mm:
        Shape (records,): standard deviation of the error of a displacement that is in it.
    near_start:
        How many times as large as elsewhere it is near the start of each record.
    shared_errors:
        Whether displacements near to each other share much of their errors: residuals then show less of the noise.
    """

    batch: Batch
    whitening: Whitening | None
    displacement_sd_mm: Float[np.ndarray, " records"]
    near_start: float = 1.0
    shared_errors: bool = False


class PreparedRecords(NamedTuple):
    """The records that a model uses of a table.

    Attributes
    ----------
    measured:
        The records, padded to one length.
    batch, data:
        The same less the mean effect of errors of their displacements; and as arrays for the model.
    factor_table, factors:
        Their factors, a row a record, and as index arrays.
    whitening:
        Of the records' noise, as `with_noise` returns it.
    likelihood:
        Of the records' forces.
    """

    measured: Batch
    batch: Batch
    data: RecordData
    factor_table: pd.DataFrame
    factors: Factors
    whitening: Whitening | None
    likelihood: Likelihood | StudentLikelihood

    @property
    def normal_likelihood(self) -> Likelihood:
        """The likelihood of normal noise: `likelihood`, or of a heavy-tailed one that of its coordinates."""
        return self.likelihood.weighted if isinstance(self.likelihood, StudentLikelihood) else self.likelihood

    def arguments(self, model: ModelSettings) -> dict[str, Any]:
        """Return the arguments of `bayes_tyre.inference.model.models.records_model`."""
        records = {"data": self.data, "factors": self.factors, "likelihood": self.likelihood}
        options = {name: getattr(model, name) for name in ("repeats", "law", "priors")}
        return {**records, **options, "noise": model.correlation}

    def approximation(self, model: ModelSettings) -> LaplaceApproximation:
        """Return the Laplace approximation of the records and their cases."""
        options = model.correlation, self.whitening, model.priors, model.law
        return laplace_approximation(self.batch, self.factors, *options)

    def only(self, mask: Bool[np.ndarray, " records"], model: ModelSettings) -> "PreparedRecords":
        """Return some of the records; their factors keep all cases, and their noise is what all records show of it."""
        factors = self.factors.only(mask)
        factor_table = self.factor_table[mask].reset_index(drop=True)
        whitening = None if self.whitening is None else whitening_of(self.whitening, mask)
        return prepare_with_noise(
            self.measured.only(mask), self.batch.only(mask), factor_table, factors, whitening, model
        )


def prepare_records(table: pd.DataFrame, model: ModelSettings) -> PreparedRecords:
    """Return the records that a model uses of a checked table.

    Raises
    ------
    BadInput
        For a record with too few points or no travel.
    """
    batch = record_batch(used_points(table, model.region))
    travel = np.abs(batch.displacement_mm - batch.displacement_mm[:, :1]).max(axis=1)
    factor_table = record_factors(table).assign(travel_mm=travel)
    factors = find_factors(factor_table, batch.force_kN[:, 0] if model.initial_load == "actual" else None)
    configurations = [factors.cases[case].configuration for case in factors.of_record]
    groupings = {"specimen": model.specimen, "day": model.day}
    factors = replace(factors, levels=find_levels(table, configurations, groupings, model.covariates))
    return prepare_batch(batch, factor_table, factors, model)


def prepare_batch(batch: Batch, factor_table: pd.DataFrame, factors: Factors, model: ModelSettings) -> PreparedRecords:
    """Return a batch of records as a model takes them; `factors` may hold cases without a record."""
    noise = with_noise(batch, factors.of_record, model)
    return prepare_with_noise(batch, noise.batch, factor_table, factors, noise.whitening, model)


def prepare_with_noise(
    measured: Batch,
    batch: Batch,
    factor_table: pd.DataFrame,
    factors: Factors,
    whitening: Whitening | None,
    model: ModelSettings,
) -> PreparedRecords:
    """Return records whose noise is known, with their likelihood."""
    data = record_data(batch)
    if model.likelihood == "direct":
        likelihood = DirectLikelihood(data, whitening, model.law)
    else:
        likelihood = compress(data, neighbours=model.correlation == "ar1", whitening=whitening, law=model.law)
    if model.noise == "student":
        likelihood = StudentLikelihood(data, likelihood, model.law)
    return PreparedRecords(measured, batch, data, factor_table, factors, whitening, likelihood)


def with_noise(batch: Batch, of_record: Int[np.ndarray, " records"], model: ModelSettings) -> RecordNoise:
    """Return records without the mean effect of errors of their displacements, and their noise.

    Parameters
    ----------
    batch, of_record:
        The records as they were measured, and the number of the case of each.
    model:
        What of it concerns the noise, and the law.

    Raises
    ------
    BadInput
        For errors of the records that heavy-tailed noise is not modelled with.
    """
    law = model.law
    if model.noise_window > 1:
        smoothed = smoothed_noise(batch.displacement_mm.shape[1], model.noise_window)
        return RecordNoise(batch, smoothed, np.zeros(len(batch.records)))
    batch, errors = _errors_of_displacement(batch, of_record, model)
    whitening, factor = None, 1.0
    if model.noise == "student":
        check_independent(batch, errors)
        return RecordNoise(batch, estimated_heavy_tails(batch, law), errors.sd_mm.max(axis=1))
    if errors.sd_mm.any():
        batch, whitening = displacement_errors(batch, of_record, errors, law)
    if batch.force_error_kN is not None and batch.force_error_kN.any():
        whitening = _with_force_error(batch, batch.force_error_kN, whitening, law)
    if model.uneven:
        whitening, factor = uneven_noise(batch, of_record, whitening, law, least=float(errors.shared))
    return RecordNoise(batch, whitening, errors.sd_mm.max(axis=1), factor, errors.shared)


def _with_force_error(
    batch: Batch, error_kN: Float[np.ndarray, "records points"], noise: Whitening | None, law: str
) -> SharedError:
    """Return the whitening of noise and of an error that the forces of each record share."""
    noise = noise or UnequalNoise(jnp.ones(batch.present.shape))
    sigma = jnp.exp(estimate_records(batch, whitening=noise, law=law).log_sigma)
    return shared_error(noise, jnp.asarray(error_kN) / sigma[:, None], jnp.asarray(batch.present))


def _errors_of_displacement(
    batch: Batch, of_record: Int[np.ndarray, " records"], model: ModelSettings
) -> tuple[Batch, DisplacementErrors]:
    """Return records with the displacements that their readings stand for, and the errors of these by the options.

    Errors that are stated and no larger than what the converter's steps leave are those of its steps.
    """
    steps, stated = converter_step_mm(batch), model.displacement_sd
    of_steps = steps.any() if stated is None else np.all((stated > 0) & (stated < _ROUNDED * steps))
    if of_steps:
        path, errors = between_steps(batch, steps)
    else:
        noise = stated
        if noise is None:
            noise = displacement_noise_mm(batch, of_record, model.law) if model.uneven else 0.0
        path, errors = at_rest(batch, np.full(len(batch.records), noise))
    return replace(batch, displacement_mm=path), errors


def used_points(table: pd.DataFrame, region: str) -> pd.DataFrame:
    """Return the rows of a checked table that a region uses: all, or the first 70 % of each record (appendix B5)."""
    if region == "all":
        return table
    by_record = table.groupby("record", sort=False)["record"]
    in_region = by_record.cumcount() < np.ceil(THESIS_SHARE * by_record.transform("size"))
    return table[in_region].reset_index(drop=True)


def record_batch(table: pd.DataFrame) -> Batch:
    """Return every record of a checked table as one batch.

    Where the table says how well a mass is known that was taken off (`force_per_kg_kN`, `mass_sd_kg`), that is an error
    which the points of a record share.

    Raises
    ------
    BadInput
        For a record with too few points or no travel: a hierarchical fit drops no record.
    """
    names, displacement, force, error = [], [], [], []
    table = table.assign(**{_ERROR: _force_error_kN(table)})
    for name, rows in table.groupby("record", sort=False):
        names.append(str(name))
        displacement.append(rows["displacement_mm"].to_numpy(dtype=float))
        force.append(rows["force_kN"].to_numpy(dtype=float))
        error.append(rows[_ERROR].to_numpy(dtype=float))
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
    batch = pad(tuple(names), displacement, force)
    padded = np.zeros(batch.present.shape)
    padded[batch.present] = np.concatenate(error)
    return replace(batch, force_error_kN=padded if padded.any() else None)


def _force_error_kN(table: pd.DataFrame) -> Float[np.ndarray, " rows"]:
    """Return what one standard deviation of the mass's error does to each force; 0 where nothing is known of it."""
    names = FORCE_PER_KG, MASS_SD
    if not set(names) <= set(table.columns):
        return np.zeros(len(table))
    try:
        per_kg, sd_kg = (pd.to_numeric(table[name]).fillna(0.0).to_numpy(dtype=float) for name in names)
    except ValueError as error:
        raise BadInput(f"columns {' and '.join(names)}: {error}; mend the cell or remove the columns") from None
    return per_kg * sd_kg
