"""What the records are off their curves at the posterior means, whitened by the model's own noise."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr
from jaxtyping import Float, Int

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import Whitening, whiten
from bayes_tyre.inference.lack_of_fit import curve_tangents
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.noise.heavy_tails import heavy_tails
from bayes_tyre.inference.model.prepared_records import record_batch, with_noise
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import force_curves
from bayes_tyre.inference.sampling.common_scales import as_measured
from bayes_tyre.inference.sampling.datatree import model_of
from bayes_tyre.inference.sampling.record_draws import with_records
from bayes_tyre.record_table import record_factors

#: What a law takes of a record.
OF_CURVE = ("F_i", "J", "k", "beta")


class Residuals(NamedTuple):
    """What the records are off their law at the posterior means of its parameters.

    Attributes
    ----------
    batch:
        The records, without the mean effect of errors of their displacements.
    means:
        By name, shape (records,): posterior means of `OF_CURVE`, for displacement as it was measured, and of sigma.
    residual_kN, white_kN:
        Shape (records, points), measured less curve; 0 on padding. White: what the model says is independent, all of
        one standard deviation; the same where it says so of the residuals themselves.
    rho, whitening:
        Lag-1 autocorrelation of each record's noise (None: it has none), after what makes it alike from point to point
        (None: it is).
    measured:
        The records as they were measured.
    of_record:
        Shape (records,): the case of each, by number.
    displacement_sd_mm:
        Shape (records,): standard deviation of the error of a displacement; 0 where the model has none.
    model:
        What the posterior is of.
    noise_near_start:
        How many times as large as elsewhere the model takes the noise near the start.
    noise_nu:
        Posterior mean of the degrees of freedom of Student-t noise (None: it is normal). White residuals are then
        weighted: points far off count less.
    shared_errors:
        Whether displacements near to each other share much of their errors: residuals then show less of the noise.
    """

    batch: Batch
    means: dict[str, Float[np.ndarray, " records"]]
    residual_kN: Float[np.ndarray, "records points"]
    white_kN: Float[np.ndarray, "records points"]
    rho: Float[np.ndarray, " records"] | None
    whitening: Whitening | None
    measured: Batch
    of_record: Int[np.ndarray, " records"]
    displacement_sd_mm: Float[np.ndarray, " records"]
    model: ModelSettings
    noise_near_start: float = 1.0
    noise_nu: float | None = None
    shared_errors: bool = False

    @property
    def sigma_kN(self) -> Float[np.ndarray, " records"]:
        """The posterior mean of the noise."""
        return self.means["sigma"]

    @property
    def u(self) -> Float[np.ndarray, "records points"]:
        """Displacement from the start of each record, mm."""
        return self.batch.displacement_mm - self.batch.displacement_mm[:, :1]

    @property
    def span(self) -> Float[np.ndarray, " records"]:
        """The difference of the largest and the smallest force of each record, kN."""
        force = np.where(self.batch.present, self.batch.force_kN, self.batch.force_kN[:, :1])
        return np.ptp(force, axis=1)

    def whitened(
        self, columns: Float[np.ndarray, "records points columns"]
    ) -> Float[np.ndarray, "records points columns"]:
        """Return functions of the points as `white_kN` has the residuals."""
        each = np.moveaxis(np.where(self.batch.present[:, :, None], columns, 0.0), 2, 0)
        return np.stack([whiten(column, self.batch.present, self.rho, self.whitening) for column in each], axis=2)

    def tangents(self) -> Float[np.ndarray, "records points 4"]:
        """Return the derivatives of each curve with respect to F_i, J, k and log beta; 0 on padding."""
        k, J, beta = (jnp.asarray(self.means[name]) for name in ("k", "J", "beta"))
        of_law = jax.vmap(partial(curve_tangents, law=self.model.law))
        tangents = np.asarray(of_law(jnp.asarray(self.u), k, J, beta))
        return np.where(self.batch.present[:, :, None], tangents, 0.0)


def residuals(tree: xr.DataTree, table: pd.DataFrame) -> Residuals:
    """Return the residuals (kN) of every record of a table at the posterior mean."""
    measured = record_batch(table)
    posterior = as_measured(with_records(tree))
    names = [name for name in (*OF_CURVE, "sigma", "rho", "noise_nu") if name in posterior]
    mean = posterior[names].sel(record=list(measured.records)).mean(("chain", "draw"))
    means = {name: mean[name].to_numpy() for name in (*OF_CURVE, "sigma")}
    theta = [means["F_i"], means["J"], np.log(means["k"]), np.log(means["beta"])]
    model, rho = model_of(tree), mean["rho"].to_numpy() if "rho" in mean else None
    nu = float(mean["noise_nu"]) if "noise_nu" in mean else None
    of_record = find_factors(record_factors(table)).of_record
    batch, whitening, sd_mm, factor, shared = with_noise(measured, of_record, model)
    u = batch.displacement_mm - batch.displacement_mm[:, :1]
    curve = force_curves(jnp.asarray(u), jnp.asarray(np.stack(theta, axis=1)), model.law)
    residual = np.where(batch.present, batch.force_kN - np.asarray(curve), 0.0)
    if nu is not None:
        whitening = heavy_tails(residual, batch.present, means["sigma"], nu)
    white = whiten(residual, batch.present, rho, whitening)
    return Residuals(
        batch, means, residual, white, rho, whitening, measured, of_record, sd_mm, model, factor, nu, shared
    )


def autocorrelations(of_records: Residuals) -> Float[np.ndarray, " records"]:
    """Return the lag-1 autocorrelation of each record's residuals, about their mean: of what the model calls white."""
    batch, residual = of_records.batch, of_records.white_kN
    centred = residual - np.where(batch.present, (residual.sum(axis=1) / batch.points)[:, None], 0.0)
    return np.sum(centred[:, 1:] * centred[:, :-1], axis=1) / np.sum(centred**2, axis=1)
