"""Noise that differs near the start of a step, as where the axle still swings: by one factor for all records.

Factor and reach are estimated from the residuals of a weighted fit. The factor is shrunk to 1 by as much as it is
uncertain; the fit of the model then takes it as known.
"""

from collections.abc import Iterator
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import UnequalNoise, Whitening, reweighted, whiten
from bayes_tyre.inference.lack_of_fit import curve_tangents
from bayes_tyre.inference.model.coordinates.laplace import RecordEstimates, estimate_records
from bayes_tyre.inference.noise_along_path import LogRatio, freedom, near_start, variance_ratio
from bayes_tyre.inference.record_data import force_curves, record_data

#: Prior standard deviation of the logarithm of the variance near the start over that elsewhere: 0.14 to 7 times.
_SD_LOG_RATIO = 1.0
#: How far the noise of the start may reach: so many beta of the case, or such parts of the record's travel.
_BETAS, _TRAVELS = (1.5, 3.0, 6.0), (0.02, 0.05, 0.1, 0.2)
#: Fits, each with the weights of the one before.
_FITS = 3


def uneven_noise(
    batch: Batch, of_record: Int[np.ndarray, " records"], whitening: Whitening | None, law: str, least: float = 0.0
) -> tuple[Whitening, float]:
    """Return the whitening of records whose noise differs near their start, and how many times as large it is there.

    Parameters
    ----------
    batch:
        The records.
    of_record:
        The case of each, by number: the noise of the start reaches as far in repeats.
    whitening:
        Of what else is known of the noise; None: nothing is.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    least:
        How many times as large it is near the start at least: 1 where points share errors, which residuals hide.
    """
    given_whitening = whitening or UnequalNoise(jnp.ones(batch.present.shape))
    whitening, log_ratio = given_whitening, np.zeros(batch.present.shape)
    for _ in range(_FITS):
        estimates = estimate_records(batch, whitening=whitening, law=law)
        near, log_variance_ratio = _most_uneven(batch, of_record, estimates, log_ratio, given_whitening, law)
        # Autocorrelated noise has less information on its own variance.
        rho = float(np.median(np.asarray(estimates.rho)))
        variance = log_variance_ratio.error**2 * (1.0 + rho**2) / (1.0 - rho**2)
        shrunk = log_variance_ratio.value / (1.0 + variance / _SD_LOG_RATIO**2)
        shrunk = max(shrunk, 2.0 * np.log(least)) if least > 0 else shrunk
        log_ratio = np.where(near, shrunk, 0.0)
        whitening = reweighted(given_whitening, jnp.asarray(np.exp(-0.5 * log_ratio)), jnp.asarray(batch.present))
    return whitening, float(np.exp(0.5 * shrunk))


def _most_uneven(
    batch: Batch,
    of_record: Int[np.ndarray, " records"],
    estimates: RecordEstimates,
    log_ratio: Float[np.ndarray, "records points"],
    given_whitening: Whitening,
    law: str,
) -> tuple[Bool[np.ndarray, "records points"], LogRatio]:
    """Return the points near the start whose variance sets them apart most, and by how much it does."""
    residual, tangents = residuals_and_tangents(batch, estimates, law)
    *slopes, white = (
        whiten(column, batch.present, whitening=given_whitening) for column in (*np.moveaxis(tangents, 2, 0), residual)
    )
    weight = np.exp(-0.5 * log_ratio)[:, :, None]
    left = freedom(weight * np.stack(slopes, axis=2), batch.present)
    square = white**2 / np.exp(2.0 * np.asarray(estimates.log_sigma))[:, None]
    u = np.asarray(record_data(batch).u)
    tried = [(near, variance_ratio(square, left, near)) for near in _near(u, estimates, of_record, batch.present)]
    return max(tried, key=lambda each: each[1].gain)


def _near(
    u: Float[np.ndarray, "records points"],
    estimates: RecordEstimates,
    of_record: Int[np.ndarray, " records"],
    present: Bool[np.ndarray, "records points"],
) -> Iterator[Bool[np.ndarray, "records points"]]:
    """Yield which points may be near the start."""
    beta = np.exp(pd.Series(np.asarray(estimates.log_beta)).groupby(of_record).transform("median").to_numpy())
    travel = np.max(np.where(present, np.abs(u), 0.0), axis=1)
    for factors, length in ((_BETAS, beta), (_TRAVELS, travel)):
        yield from (near_start(u, factor * length, present) for factor in factors)


def residuals_and_tangents(
    batch: Batch, estimates: RecordEstimates, law: str
) -> tuple[Float[np.ndarray, "records points"], Float[np.ndarray, "records points 4"]]:
    """Return measured less curve (kN), and the derivatives of each curve by its parameters; 0 on padding."""
    _, J, log_k, log_beta = np.asarray(estimates.centre).T
    u, k, beta = record_data(batch).u, np.exp(log_k), np.exp(log_beta)
    tangents = jax.vmap(partial(curve_tangents, law=law))(u, *map(jnp.asarray, (k, J, beta)))
    residual = batch.force_kN - np.asarray(force_curves(u, estimates.centre, law))
    return np.where(batch.present, residual, 0.0), np.where(batch.present[:, :, None], np.asarray(tangents), 0.0)
