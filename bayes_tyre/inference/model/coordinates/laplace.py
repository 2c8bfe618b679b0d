"""Laplace approximation of the records: least-squares estimates of their parameters, with Fisher information.

It shapes the coordinates of `coordinates`, and never the posterior.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.batch import Batch
from bayes_tyre.inference.correlated_noise import Whitening, innovations, lag_1
from bayes_tyre.inference.least_squares import estimate as ls
from bayes_tyre.inference.model.coordinates.laplace_cases import CaseEstimates, case_estimates
from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.model.normal_posterior import QuadraticApproximation
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.record_data import EQUATION_2, RecordData, force_curve, record_data

#: Widest standard deviations of log k and log beta that the approximation of a record may have.
_LOG_K_SD, _LOG_BETA_SD = 0.5, 1.0
#: Largest lag-1 autocorrelation of the approximation: residuals of few points may show more than any noise has.
_LARGEST_RHO = 0.98
#: Steps from the least-squares estimate to the one under correlated noise.
_POLISHING_STEPS = 4
#: A least-squares estimate with a beta beyond this part of the travel, or a k that is so many times the secant (or as
#: much less), traded k against beta: the same points fit as well with a beta like the other records'.
_TRADED_BETA, _TRADED_K = 0.5, 3.0
#: A normal's standard deviation over its median absolute deviation.
_SD_OF_MAD = 1.4826
#: Share of the variance of the estimates of J that is at least put down to J (they may agree by chance), and the
#: least standard deviation, kN.
_LEAST_J_SHARE, _LEAST_SD_J = 0.01, 1e-3
#: Beta is held within these multiples of the travel where the record leaves it open.
_BETA_WITHIN_TRAVEL = (1e-4, 3.0)


class RecordEstimates(NamedTuple):
    """The Laplace approximation of each record: its least-squares estimate and its information.

    Attributes
    ----------
    centre:
        Shape (records, 4): F_i (kN), J (kN), log k (kN/mm), log beta (mm).
    information:
        Shape (records, 4, 4): Fisher information on these, of a weak prior too.
    J_variance:
        Shape (records,): variance (kN^2) of the estimate of J. Kept, for every gradient needs it.
    log_sigma, rho, points:
        Shape (records,); sigma in kN, lag-1 autocorrelation of the residuals, and number of points.
    """

    centre: Float[Array, "records 4"]
    information: Float[Array, "records 4 4"]
    J_variance: Float[Array, " records"]
    log_sigma: Float[Array, " records"]
    rho: Float[Array, " records"]
    points: Float[Array, " records"]

    @property
    def log_k(self) -> Float[Array, " records"]:
        """Estimates of log k, k in kN/mm."""
        return self.centre[:, 2]

    @property
    def log_beta(self) -> Float[Array, " records"]:
        """Estimates of log beta, beta in mm."""
        return self.centre[:, 3]

    def typical_J(self, factors: Factors) -> tuple[Float[Array, " records"], Float[Array, ""]]:
        """Return the median of J in each record's configuration and direction, and how J scatters about that (kN).

        Medians, for a record that leaves J open may have an estimate far from any. What the estimates scatter by
        themselves is taken off.
        """
        group, J = factors.group.of_case[factors.of_record], np.asarray(self.centre[:, 1])
        typical = np.array([np.median(J[group == one]) for one in range(len(factors.group.labels))])[group]
        variance = (_SD_OF_MAD * np.median(np.abs(J - typical))) ** 2
        of_J = max(variance - float(np.median(np.asarray(self.J_variance))), _LEAST_J_SHARE * variance)
        return jnp.asarray(typical), jnp.asarray(np.sqrt(of_J) + _LEAST_SD_J)

    @jax.jit
    def of_log_values(
        self, mean_J: Float[Array, " #records"] | None = None, sd_J: Float[Array, ""] | None = None
    ) -> QuadraticApproximation:
        """Return the approximation of the likelihood of log k and log beta, F_i and J integrated out.

        Parameters
        ----------
        mean_J, sd_J:
            Mean and standard deviation (kN) of the prior of J; None: J is free.
        """
        offsets, both, shape = self.information[:, :2, :2], self.information[:, :2, 2:], self.information[:, 2:, 2:]
        of_prior = jnp.zeros(()) if sd_J is None else sd_J**-2.0
        a, b, d = offsets[:, 0, 0], offsets[:, 0, 1], offsets[:, 1, 1] + of_prior
        # The inverse of two by two is written out: LAPACK would be called once a record.
        adjugate = jnp.stack([jnp.stack([d, -b], axis=1), jnp.stack([-b, a], axis=1)], axis=1)
        followed = jnp.einsum("rij,rik->rjk", both, adjugate / (a * d - b**2)[:, None, None])
        off = self.centre[:, 1] - (jnp.zeros(1) if mean_J is None else mean_J)
        slope = followed[:, :, 1] * (of_prior * off)[:, None]
        return QuadraticApproximation(self.centre[:, 2:], slope, shape - jnp.einsum("rij,rjk->rik", followed, both))


def estimate_records(
    batch: Batch,
    noise: str = "iid",
    whitening: Whitening | None = None,
    beta_mm: Float[np.ndarray, " records"] | None = None,
    law: str = EQUATION_2,
) -> RecordEstimates:
    """Return the Laplace approximation of each record, by least squares with F_i free over all of its points.

    Parameters
    ----------
    batch:
        The records.
    noise:
        ``iid``, or ``ar1``: autoregressive with the lag-1 autocorrelation that the residuals show.
    whitening:
        Of the records' noise; None: it needs none.
    beta_mm:
        Where to approximate in beta; None: at its estimate.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`; another than Equation 2 starts from its estimate.
    """
    data = record_data(batch)
    nan = np.full((len(batch.records), 5), np.nan)
    fixed = nan.copy()
    if beta_mm is not None:
        fixed[:, ls.BETA] = beta_mm
    problem = ls.Problem(*map(jnp.asarray, (batch.displacement_mm, data.F, data.present, fixed, nan[:, None])))
    free = (ls.K, ls.C, ls.BETA, ls.F_I) if beta_mm is None else (ls.K, ls.C, ls.F_I)
    estimate = ls.estimate_batch(problem, free)
    # A number, not a choice of code: both kinds of noise are one compilation.
    return _estimate_records(data, estimate, jnp.asarray(float(noise == "ar1")), whitening, law)


@eqx.filter_jit
def _estimate_records(
    data: RecordData, estimate: ls.Estimate, autoregressive: Float[Array, ""], whitening: Whitening | None, law: str
) -> RecordEstimates:
    def approximate(record: RecordData, of_record: ls.Estimate, whitening: Whitening | None) -> RecordEstimates:
        return _approximate(record, of_record, autoregressive, whitening, law)

    axis = None if whitening is None else whitening.axis
    return jax.vmap(approximate, in_axes=(0, 0, axis))(data, estimate, whitening)


def _approximate(
    data: RecordData, estimate: ls.Estimate, autoregressive: Float[Array, ""], whitening: Whitening | None, law: str
) -> RecordEstimates:
    """Return the Laplace approximation of a record; `autoregressive`: 1 where its noise is, else 0."""
    centre = _centre(data, estimate)
    points = jnp.sum(data.present)

    def residual(theta: Float[Array, "4"]) -> Float[Array, " points"]:
        return jnp.where(data.present, data.F - force_curve(data.u, theta, law), 0.0)

    def uncoloured(values: Float[Array, " points"]) -> Float[Array, " points"]:
        return values if whitening is None else whitening.whiten(values, data.present)

    rho = lag_1(uncoloured(residual(centre)), data.present)
    rho = jnp.clip(jnp.nan_to_num(rho), -_LARGEST_RHO, _LARGEST_RHO)

    def white(values: Float[Array, " points"]) -> Float[Array, " points"]:
        return innovations(uncoloured(values), data.present, autoregressive * rho)

    def noise(rss: Float[Array, ""]) -> Float[Array, ""]:
        # Noise-free records would make the coordinates infinitely narrow.
        return jnp.maximum(jnp.sqrt(rss / jnp.maximum(points - 4, 1)), 1e-6 * data.span)

    # A floor under the information gives a parameter that the record leaves open a finite scale.
    floor = jnp.diag(1.0 / jnp.stack([data.span, data.span, jnp.asarray(_LOG_K_SD), jnp.asarray(_LOG_BETA_SD)]) ** 2)

    def information(theta: Float[Array, "4"], sigma: Float[Array, ""]) -> tuple[Array, Float[Array, "4 4"]]:
        jacobian = jax.vmap(white, in_axes=1)(-jax.jacfwd(residual)(theta)) / sigma
        return jacobian, jacobian @ jacobian.T + floor

    sigma = noise(estimate.rss)
    polished = _polish(centre, lambda theta: white(residual(theta)) / sigma, partial(information, sigma=sigma))
    # Least squares of Equation 2 with independent noise is what `estimate` is.
    other = (autoregressive > 0) | (whitening is not None) | (law != EQUATION_2)
    centre = jnp.where(other, polished, centre)
    sigma = jnp.where(other, noise(jnp.sum(white(residual(centre)) ** 2)), sigma)
    precision = information(centre, sigma)[1]
    J_variance = jnp.linalg.inv(precision)[1, 1]
    return RecordEstimates(centre, precision, J_variance, jnp.log(sigma), rho, points.astype(rho.dtype))


def _polish(
    centre: Float[Array, "4"],
    residual: Callable[[Float[Array, "4"]], Float[Array, " points"]],
    information: Callable[[Float[Array, "4"]], tuple[Float[Array, "4 points"], Float[Array, "4 4"]]],
) -> Float[Array, "4"]:
    """Return the estimate under correlated noise, by Gauss-Newton steps that are taken where they gain."""

    def step(_: Array, theta: Float[Array, "4"]) -> Float[Array, "4"]:
        jacobian, precision = information(theta)
        tried = theta + jnp.linalg.solve(precision, jacobian @ residual(theta))
        better = jnp.sum(residual(tried) ** 2) < jnp.sum(residual(theta) ** 2)
        return jnp.where(better, tried, theta)

    return jax.lax.fori_loop(0, _POLISHING_STEPS, step, centre)


def _centre(data: RecordData, estimate: ls.Estimate) -> Float[Array, "4"]:
    """Return (F_i, J, log k, log beta) of the estimate, brought within the record where it ran out of it."""
    travel = jnp.max(jnp.where(data.present, jnp.abs(data.u), 0.0))
    fitted = jnp.where(jnp.isfinite(estimate.value), estimate.value, 0.0)
    low, high = (factor * travel for factor in _BETA_WITHIN_TRAVEL)
    secant = data.span / travel
    sound = estimate.converged & (fitted[ls.K] > 0.01 * secant)
    k = jnp.where(sound, fitted[ls.K], secant)
    F_i = jnp.where(sound, fitted[ls.F_I], data.F_0)
    # Offset and line may pull against each other: the offset is then larger than any change of force.
    most = data.span + k * travel
    J = jnp.where(sound, jnp.clip(k * data.d_0 + fitted[ls.C] - F_i, -most, most), 0.0)
    beta = jnp.clip(jnp.where(fitted[ls.BETA] > 0, fitted[ls.BETA], low), low, high)
    return jnp.stack([F_i, J, jnp.log(k), jnp.log(beta)])


class LaplaceApproximation(NamedTuple):
    """The Laplace approximation of the records, and the estimates of the cases that follow from it."""

    records: RecordEstimates
    cases: CaseEstimates


def laplace_approximation(
    batch: Batch,
    factors: Factors,
    noise: str = "iid",
    whitening: Whitening | None = None,
    priors: Priors = PRIORS,
    law: str = EQUATION_2,
) -> LaplaceApproximation:
    """Return the Laplace approximation of a batch's records and of their cases; the rest as in `estimate_records`."""
    estimates = estimate_records(batch, noise, whitening, law=law)
    records = with_traded_replaced(estimates, batch, factors, noise, whitening, law)
    return LaplaceApproximation(records, cases_of(records, factors, priors))


def empty_approximation(records: int, factors: Factors) -> LaplaceApproximation:
    """Return zeros of the shapes that `laplace_approximation` gives, to compile for."""
    shapes = (records, 4), (records, 4, 4), *[(records,)] * 4
    blank = RecordEstimates(*(jnp.asarray(np.zeros(shape)) for shape in shapes))
    cases, speeds = (
        jnp.asarray(np.zeros((len(PARAMETERS), n))) for n in (len(factors.cases), len(factors.speed.labels))
    )
    none, apart = (jnp.asarray(np.zeros(shape, dtype=bool)) for shape in ((records,), cases.shape))
    most = max(factors.design(parameter).shape[1] for parameter in PARAMETERS)
    terms = jnp.asarray(np.zeros((len(PARAMETERS), most)))
    return LaplaceApproximation(blank, CaseEstimates(cases, cases, Gaussian(speeds, speeds), none, apart, terms))


def cases_of(records: RecordEstimates, factors: Factors, priors: Priors = PRIORS) -> CaseEstimates:
    """Return estimates of the cases from the approximation of their records."""
    # Of one parameter with the other held: near enough for coordinates.
    variance = 1.0 / np.diagonal(np.asarray(records.of_log_values().precision), axis1=1, axis2=2)
    return case_estimates(np.asarray(records.centre[:, 2:]), variance, factors, priors)


def with_traded_replaced(
    records: RecordEstimates,
    batch: Batch,
    factors: Factors,
    noise: str = "iid",
    whitening: Whitening | None = None,
    law: str = EQUATION_2,
) -> RecordEstimates:
    """Return the approximation with records whose k and beta were traded redone at the beta of their case.

    Such a record's own optimum is far from where the hierarchy will put it: coordinates that start there made every
    trajectory a thousand steps long.
    """
    u = batch.displacement_mm - batch.displacement_mm[:, :1]
    travel, span = np.abs(u).max(axis=1), np.abs(batch.force_kN - batch.force_kN[:, :1]).max(axis=1)
    log_k, log_beta = np.asarray(records.log_k), np.asarray(records.log_beta)
    traded = np.abs(log_k - np.log(span / travel)) > np.log(_TRADED_K)
    traded |= log_beta > np.log(_TRADED_BETA * travel)
    if traded.all() or not traded.any():
        return records
    beta = log_beta.copy()
    for record in np.flatnonzero(traded):
        alike = ~traded & (factors.of_record == factors.of_record[record])
        beta[record] = np.median(log_beta[alike if alike.any() else ~traded])
    redone = estimate_records(batch, noise, whitening, np.exp(beta), law)

    def choose(own: Array, other: Array) -> Array:
        return jnp.where(jnp.asarray(traded).reshape(-1, *[1] * (own.ndim - 1)), other, own)

    return RecordEstimates(*(choose(own, other) for own, other in zip(records, redone, strict=True)))
