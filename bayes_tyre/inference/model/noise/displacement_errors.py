"""Errors of the displacement: what they do to the force near the start of a record.

An error of displacement moves a point along its curve: by k times as much in force all along a record, by J / beta
times near its start, where the curve is also bent and the force is off on average. What is added beyond k is taken
from the curve of a weighted least-squares fit (regression calibration; Carroll et al., Measurement Error in Nonlinear
Models, 2006, chapter 4); the noise away from the start is the sampled sigma, whatever it is made of. The first
displacement, from which all others are counted, has an error too, which the points of a record share. A displacement
smoothed over several readings is off by less than each of them, and so is its force on average; but its neighbours are
off together with it, so that it weighs no more than one reading.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, Bool, Float, Int

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import SharedError, UnequalNoise, shared_error
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.record_data import force_curve, force_curves, record_data

#: Fits, each with the weights of the one before: these then change by less than their own uncertainty.
_FITS = 4
#: Displacements tried behind each measured one: so many, up to so many standard deviations from it.
_NODES, _REACH = 65, 4.0
#: How much less likely a displacement becomes by each standard deviation that it lies before the start.
_CUT = 50.0
#: A displacement just beyond the start, mm: the law has a slope there.
_BEYOND_START_MM = 1e-9
#: Median of the absolute value of a standard normal number.
_NORMAL_MEDIAN = 0.6745


class DisplacementErrors(NamedTuple):
    """Standard deviations of the errors of displacements.

    Attributes
    ----------
    sd_mm:
        Shape (records, points): of the error that each displacement has for itself.
    start_mm:
        Shape (records, points): of the error that it has because that at the start, from which it is counted, is off.
    averaged:
        Shape (records, points): how many readings of that error each displacement is the mean of, in effect.
    shared:
        Whether points near to each other share much of their errors: residuals of a curve through them then show less.
    """

    sd_mm: Float[np.ndarray, "records points"]
    start_mm: Float[np.ndarray, "records points"]
    averaged: Float[np.ndarray, "records points"]
    shared: bool = False

    @staticmethod
    def alike(batch: Batch, sd_mm: Float[np.ndarray, " records"]) -> "DisplacementErrors":
        """Return errors that are alike in all points of a record, the start's among them."""
        errors = np.tile(sd_mm[:, None], batch.displacement_mm.shape[1])
        return DisplacementErrors(errors, errors.copy(), np.ones(errors.shape))


def displacement_errors(
    batch: Batch, of_record: Int[np.ndarray, " records"], errors: DisplacementErrors, law: str
) -> tuple[Batch, SharedError]:
    """Return records without the mean effect of errors of their displacements, and their whitening.

    Parameters
    ----------
    batch:
        The records.
    of_record:
        The case of each, by number: repeats share the curve that weighs their points, for weights by a record's own
        errors would favour them.
    errors:
        Their standard deviations.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    """
    u, present = record_data(batch).u, jnp.asarray(batch.present)
    of_errors = tuple(jnp.asarray(values) for values in (errors.sd_mm, errors.start_mm, errors.averaged))
    estimates, measured = estimate_records(batch, law=law), batch
    # Residuals near the start would make sigma too large, and themselves too heavy.
    residual = np.where(batch.present, np.abs(batch.force_kN - force_curves(u, estimates.centre, law)), np.nan)
    least = 1e-6 * np.ptp(batch.force_kN, axis=1)
    log_sigma = np.log(np.maximum(np.nanmedian(residual, axis=1) / _NORMAL_MEDIAN, least))
    for _ in range(_FITS):
        curves = _medians(np.column_stack([estimates.centre, log_sigma]), of_record)
        bias, whitening = _of_curves(u, present, jnp.asarray(curves), *of_errors, law)
        batch = replace(measured, force_kN=measured.force_kN - np.asarray(bias))
        estimates = estimate_records(batch, whitening=whitening, law=law)
        log_sigma = np.asarray(estimates.log_sigma)
    return batch, whitening


def _medians(
    curves: Float[np.ndarray, "records values"], of_record: Int[np.ndarray, " records"]
) -> Float[np.ndarray, "records values"]:
    """Return the medians among the repeats of each record's case."""
    return pd.DataFrame(curves).groupby(of_record).transform("median").to_numpy()


@partial(jax.jit, static_argnames="law")
def _of_curves(
    u: Float[Array, "records points"],
    present: Bool[Array, "records points"],
    curves: Float[Array, "records 5"],
    sd_mm: Float[Array, "records points"],
    start_mm: Float[Array, "records points"],
    averaged: Float[Array, "records points"],
    law: str,
) -> tuple[Float[Array, "records points"], SharedError]:
    """Return the mean error of force (kN) and the whitening, about F_i, J (kN), log k, log beta and log sigma."""
    theta, sigma = curves[:, :4], jnp.exp(curves[:, 4])[:, None]
    forward = jnp.sign(jnp.sum(u, axis=1))
    # One record at a time: each of its points is tried at `_NODES` displacements.
    of_record = forward[:, None] * u, forward, theta, sd_mm / jnp.sqrt(averaged)
    bias, sd, slope = jax.lax.map(lambda record: _force_errors(*record, law=law), of_record)
    # The first point is where its record starts by definition; records without errors are as they are.
    exact = ~present | (jnp.arange(u.shape[1]) == 0) | ((sd_mm == 0) & (start_mm == 0))
    bias, sd, shared = (jnp.where(exact, 0.0, values) for values in (bias, jnp.sqrt(averaged) * sd, slope * start_mm))
    of_line = jnp.exp(curves[:, 2:3]) * sd_mm
    weight = 1.0 / jnp.sqrt(1.0 + jnp.maximum(sd**2 - of_line**2, 0.0) / sigma**2)
    return bias, shared_error(UnequalNoise(weight), shared / sigma, present)


def _force_errors(
    ahead: Float[Array, " points"],
    forward: Float[Array, ""],
    theta: Float[Array, "4"],
    sd_mm: Float[Array, " points"],
    law: str,
) -> tuple[Float[Array, " points"], Float[Array, " points"], Float[Array, " points"]]:
    """Return mean (kN), standard deviation (kN) and slope (kN/mm) of what the errors of one record do to its forces.

    Over the displacements that may lie behind each measured one (mm, `ahead` of the start): a normal distribution
    about it, cut off where the record starts.
    """
    z = jnp.linspace(-_REACH, _REACH, _NODES)
    sd_mm = sd_mm[:, None]
    true = ahead[:, None] + sd_mm * z
    behind = jnp.maximum(-true, 0.0) / jnp.where(sd_mm > 0, sd_mm, 1.0)
    weight = jax.nn.softmax(-0.5 * z**2 - _CUT * behind, axis=1)
    u = forward * jnp.maximum(true, _BEYOND_START_MM).ravel()
    force, slope = jax.jvp(lambda u: force_curve(u, theta, law), (u,), (jnp.ones_like(u),))
    force, slope = force.reshape(true.shape), slope.reshape(true.shape)
    mean = jnp.sum(weight * force, axis=1)
    variance = jnp.sum(weight * (force - mean[:, None]) ** 2, axis=1)
    bias = mean - force_curve(forward * ahead, theta, law)
    return bias, jnp.sqrt(variance), jnp.sum(weight * slope, axis=1)
