"""Coordinates in which NUTS finds every record, case and noise level close to a standard normal.

Where the data below a level are strong, sampling it centred is right; where they are weak, non-centred; in between,
or where the scales decide, neither. Here each unknown is placed at its conditional mean and scaled by its conditional
standard deviation, both under a Gaussian picture of its data (the least-squares estimate and Fisher information) and
given the scales above it, which are being sampled too: strong and weak are the two ends of one formula. The change
of variables is exact, with its volume accounted for; the picture shapes the coordinates only, never the posterior.

Source: the idea of Papaspiliopoulos, Roberts & Skold (2007), "A general framework for the parametrization of
hierarchical models", Statistical Science 22, taken from one partial centring to one that follows the scales.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from bayes_tyre.inference import least_squares as ls
from bayes_tyre.inference.levels import Levels
from bayes_tyre.laws.fancher import equation_2_offset
from bayes_tyre.record import Batch

#: Widest standard deviations of log k and log beta that the picture of a record may have.
_LOG_K_SD, _LOG_BETA_SD = 0.5, 1.0
#: Beta is held within these multiples of the travel where the record leaves it open.
_BETA_WITHIN_TRAVEL = (1e-4, 3.0)


class RecordData(NamedTuple):
    """The measured records as the models take them: d_0 is the first displacement, u the distance from it.

    Attributes
    ----------
    u, F:
        Shape (records, points); mm, kN.
    present:
        Shape (records, points); False on padding.
    d_0, F_0, span:
        Shape (records,); first displacement (mm), first force (kN), largest change of force (kN).
    """

    u: Float[Array, "records points"]
    F: Float[Array, "records points"]
    present: Bool[Array, "records points"]
    d_0: Float[Array, " records"]
    F_0: Float[Array, " records"]
    span: Float[Array, " records"]


class RecordEstimates(NamedTuple):
    """The Gaussian picture of each record: what least squares says, and how well.

    Attributes
    ----------
    centre:
        Shape (records, 4): F_i (kN), J (kN), log k (kN/mm), log beta (mm).
    precision:
        Shape (records, 2, 2): of log k and log beta, F_i and J integrated out.
    slope, factor:
        Shape (records, 2, 2): F_i and J follow `centre + slope (log k, log beta deviations) + factor z`.
    log_sigma, log_sigma_precision:
        Shape (records,); sigma in kN.
    """

    centre: Float[Array, "records 4"]
    precision: Float[Array, "records 2 2"]
    slope: Float[Array, "records 2 2"]
    factor: Float[Array, "records 2 2"]
    log_sigma: Float[Array, " records"]
    log_sigma_precision: Float[Array, " records"]

    @property
    def log_k(self) -> Float[Array, " records"]:
        """Estimates of log k, k in kN/mm."""
        return self.centre[:, 2]

    @property
    def log_beta(self) -> Float[Array, " records"]:
        """Estimates of log beta, beta in mm."""
        return self.centre[:, 3]


class Placed(NamedTuple):
    """Unknowns placed from standard coordinates, and the logarithm of the volume that the map makes of a unit."""

    value: Float[Array, "..."]
    log_volume: Float[Array, "..."]


def place(
    z: Float[Array, " units"],
    estimate: Float[Array, " units"],
    precision: Float[Array, " units"],
    above: Float[Array, "*#units"],
    scale: Float[Array, "*#units"],
) -> Placed:
    """Return scalar unknowns at z, given a Gaussian estimate below and a normal level above, shape (units,).

    If the data were as Gaussian as `estimate` and `precision` say and the level above is Normal(above, scale),
    the posterior of z is exactly standard normal, whatever the scale.
    """
    total = precision + scale**-2
    value = (precision * estimate + above * scale**-2) / total + z / jnp.sqrt(total)
    return Placed(value, -0.5 * jnp.log(total))


def place_pair(
    z: Float[Array, "units 2"],
    estimate: Float[Array, "units 2"],
    precision: Float[Array, "units 2 2"],
    above: Float[Array, "units 2"],
    scale: Float[Array, "units 2"],
) -> Placed:
    """Return pairs of unknowns at z, as `place` does for scalars; the 2 x 2 algebra is written out.

    Batched 2 x 2 Cholesky factors would go through LAPACK one by one.
    """
    a, b, c = precision[:, 0, 0] + scale[:, 0] ** -2, precision[:, 0, 1], precision[:, 1, 1] + scale[:, 1] ** -2
    pull = jnp.einsum("uij,uj->ui", precision, estimate) + above * scale**-2
    determinant = a * c - b**2
    mean = jnp.stack([c * pull[:, 0] - b * pull[:, 1], a * pull[:, 1] - b * pull[:, 0]], axis=1) / determinant[:, None]
    # The total precision is R R^T with R = [[r, 0], [b / r, s]]; inv(R)^T z has it as its precision.
    r = jnp.sqrt(a)
    s = jnp.sqrt(determinant) / r
    second = z[:, 1] / s
    first = (z[:, 0] - b / r * second) / r
    return Placed(mean + jnp.stack([first, second], axis=1), -0.5 * jnp.log(determinant))


def record_data(batch: Batch) -> RecordData:
    """Return a batch of records as the models take it."""
    d, F = jnp.asarray(batch.displacement_mm), jnp.asarray(batch.force_kN)
    present = jnp.asarray(batch.present)
    span = jnp.max(jnp.where(present, jnp.abs(F - F[:, :1]), 0.0), axis=1)
    return RecordData(d - d[:, :1], F, present, d[:, 0], F[:, 0], jnp.where(span > 0, span, 1.0))


def force_curve(u: Float[Array, " points"], theta: Float[Array, "4"]) -> Float[Array, " points"]:
    """Return the force (kN) of Equation 2 at u (mm) for theta = (F_i, J, log k, log beta)."""
    return theta[0] + equation_2_offset(u, k=jnp.exp(theta[2]), J=theta[1], beta=jnp.exp(theta[3]))


def estimate_records(batch: Batch) -> RecordEstimates:
    """Return the Gaussian picture of each record, by least squares with F_i free over all of its points."""
    data = record_data(batch)
    nan = jnp.full((len(batch.records), 5), jnp.nan)
    problem = ls.Problem(jnp.asarray(batch.displacement_mm), data.F, data.present, nan, nan[:, None])
    estimate = ls.estimate_batch(problem, (ls.K, ls.C, ls.BETA, ls.F_I))
    return _estimate_records(data, estimate)


@eqx.filter_jit
def _estimate_records(data: RecordData, estimate: ls.Estimate) -> RecordEstimates:
    return jax.vmap(_picture)(data, estimate)


def _picture(data: RecordData, estimate: ls.Estimate) -> RecordEstimates:
    centre = _centre(data, estimate)
    points = jnp.sum(data.present)
    # Noise-free records would make the coordinates infinitely narrow.
    sigma = jnp.maximum(jnp.sqrt(estimate.rss / jnp.maximum(points - 4, 1)), 1e-6 * data.span)
    jacobian = jnp.where(data.present[:, None], jax.jacfwd(lambda theta: force_curve(data.u, theta))(centre), 0.0)
    # A floor under the information gives a parameter that the record leaves open a finite scale.
    floor = jnp.stack([data.span, data.span, jnp.asarray(_LOG_K_SD), jnp.asarray(_LOG_BETA_SD)])
    information = jacobian.T @ jacobian / sigma**2 + jnp.diag(1.0 / floor**2)
    level, both, shape = information[:2, :2], information[:2, 2:], information[2:, 2:]
    slope = -jnp.linalg.solve(level, both)
    factor = jnp.linalg.inv(jnp.linalg.cholesky(level)).T
    return RecordEstimates(centre, shape + both.T @ slope, slope, factor, jnp.log(sigma), 2.0 * points)


def _centre(data: RecordData, estimate: ls.Estimate) -> Float[Array, "4"]:
    """Return (F_i, J, log k, log beta) of the estimate, brought within the record where it ran out of it."""
    travel = jnp.max(jnp.where(data.present, jnp.abs(data.u), 0.0))
    fitted = jnp.where(jnp.isfinite(estimate.value), estimate.value, 0.0)
    low, high = (factor * travel for factor in _BETA_WITHIN_TRAVEL)
    secant = data.span / travel
    sound = estimate.converged & (fitted[ls.K] > 0.01 * secant)
    k = jnp.where(sound, fitted[ls.K], secant)
    F_i = jnp.where(sound, fitted[ls.F_I], data.F_0)
    J = jnp.where(sound, jnp.clip(k * data.d_0 + fitted[ls.C] - F_i, -data.span, data.span), 0.0)
    beta = jnp.clip(jnp.where(fitted[ls.BETA] > 0, fitted[ls.BETA], low), low, high)
    return jnp.stack([F_i, J, jnp.log(k), jnp.log(beta)])


class CaseEstimates(NamedTuple):
    """What the records of each case say of one of its parameters, shape (cases,): median, and variance of one."""

    median: Float[Array, " cases"]
    variance: Float[Array, " cases"]


def case_estimates(
    values: Float[Array, " records"], variances: Float[Array, " records"], levels: Levels
) -> CaseEstimates:
    """Return the median estimate of each case, which a discordant repeat does not move, and the mean variance."""
    cases = range(len(levels.cases))
    members = [levels.of_record == case for case in cases]
    return CaseEstimates(
        jnp.stack([jnp.median(values[member]) for member in members]),
        jnp.stack([jnp.mean(variances[member]) for member in members]),
    )
