"""From a checked record table to what the model of records takes, made once for all that needs it."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Bool

from bayes_tyre.batch import Batch, pad
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.correlated_noise import Whitening, smoothed_noise
from bayes_tyre.inference.least_squares.table import LARGEST, THESIS_SHARE
from bayes_tyre.inference.model.compressed_likelihood import compress
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, laplace_approximation
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.likelihood import DirectLikelihood, Likelihood
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import RecordData, record_data
from bayes_tyre.record_table import record_factors

#: F_i, J, k, beta and sigma of a record, and one point to spare.
LEAST_POINTS = 6


class PreparedRecords(NamedTuple):
    """The records that a model uses of a table.

    Attributes
    ----------
    batch, data:
        The records, padded to one length, and as arrays for the model.
    factor_table, factors:
        Their factors, a row a record, and as index arrays.
    whitening:
        Of noise that was smoothed, for records as long as the longest; None: it was not.
    likelihood:
        Of the records' forces.
    """

    batch: Batch
    data: RecordData
    factor_table: pd.DataFrame
    factors: Factors
    whitening: Whitening | None
    likelihood: Likelihood

    def arguments(self, model: ModelSettings) -> dict[str, Any]:
        """Return the arguments of `bayes_tyre.inference.model.models.records_model`."""
        records = {"data": self.data, "factors": self.factors, "likelihood": self.likelihood}
        options = {name: getattr(model, name) for name in ("repeats", "noise", "law", "priors")}
        return {**records, **options}

    def approximation(self, model: ModelSettings) -> LaplaceApproximation:
        """Return the Laplace approximation of the records and their cases."""
        return laplace_approximation(self.batch, self.factors, model.noise, self.whitening, model.priors, model.law)

    def only(self, mask: Bool[np.ndarray, " records"], model: ModelSettings) -> "PreparedRecords":
        """Return some of the records; their factors keep all cases."""
        names = tuple(name for name, chosen in zip(self.batch.records, mask, strict=True) if chosen)
        whole = self.batch
        batch = Batch(names, whole.displacement_mm[mask], whole.force_kN[mask], whole.present[mask])
        factors = replace(self.factors, of_record=self.factors.of_record[mask])
        return prepare_batch(batch, self.factor_table[mask].reset_index(drop=True), factors, model)


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
    return prepare_batch(batch, factor_table, factors, model)


def prepare_batch(batch: Batch, factor_table: pd.DataFrame, factors: Factors, model: ModelSettings) -> PreparedRecords:
    """Return a batch of records as a model takes them; `factors` may hold cases without a record."""
    data, window = record_data(batch), model.noise_window
    whitening = smoothed_noise(int(batch.points.max()), window) if window > 1 else None
    if model.likelihood == "direct":
        likelihood = DirectLikelihood(data, whitening, model.law)
    else:
        likelihood = compress(data, neighbours=model.noise == "ar1", whitening=whitening, law=model.law)
    return PreparedRecords(batch, data, factor_table, factors, whitening, likelihood)


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
