"""Summaries of records: the marginal log likelihood of log k, log beta, noise and J of each, in a few numbers.

A record reaches the hierarchy through log k and log beta alone, and its noise through what all records share of it.
`bayes_tyre.inference.model.collapsed.nearest_summaries` makes these numbers.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.model.likelihood.direct import Likelihood
from bayes_tyre.inference.model.likelihood.force_distribution import RecordForces
from bayes_tyre.inference.model.normal_posterior import NormalPosterior, QuadraticApproximation
from bayes_tyre.inference.record_data import RecordData

#: Parameters of a record that have a case.
VALUES = 2


class NoiseSummaries(NamedTuple):
    """Marginal likelihood of each record's noise: log sigma, and atanh rho where noise is autoregressive.

    Attributes
    ----------
    quadratic:
        Its log density, all else integrated out.
    whiten:
        Shape (records, q, q): times the noise about the centre, standard normals under the approximate posterior.
    third:
        Shape (records, q, q, q): third derivatives of the log density along these. Those of several parameters count:
        how wide one is moves the other, by as much in every record.
    interaction:
        Shape (records, q): half the variance of the slope along each, which differs with log k and log beta.
    """

    quadratic: QuadraticApproximation
    whiten: Float[Array, "records q q"]
    third: Float[Array, "records q q q"]
    interaction: Float[Array, "records q"]

    def at(self, noise: Float[Array, "*draws records q"]) -> Float[Array, "*draws records"]:
        """Return the log density at values of the noise, less that at the centre."""
        z = jnp.einsum("rij,...rj->...ri", self.whiten, noise - self.quadratic.centre)
        return self.quadratic.at(noise) + jnp.sum(self.third * third_hermite(z), axis=(-3, -2, -1)) / 6.0

    def log_marginal(
        self, above: Float[Array, "records q"], sd: Float[Array, "records q"]
    ) -> tuple[Float[Array, " records"], Float[Array, " records"], NormalPosterior]:
        """Return the log density with noise that is Normal(above, sd) integrated out; and the noise's posterior.

        What is beyond the quadratic counts by its cumulants: the third derivative's mean, and the variance of the
        slope. How much the latter adds is returned between the two.
        """
        quadratic = self.quadratic
        posterior = NormalPosterior(quadratic.slope_at(above).T, jnp.moveaxis(quadratic.precision, 0, -1), sd.T)
        mean = above + posterior.draw(jnp.zeros_like(above.T)).T
        z = jnp.einsum("rij,rj->ri", self.whiten, mean - quadratic.centre)
        root = jnp.einsum("rij,jkr->rik", self.whiten, posterior.root())
        covariance = jnp.sum(root[:, :, None] * root[:, None], axis=-1)
        third = jnp.sum(self.third * third_hermite(z, covariance), axis=(-3, -2, -1)) / 6.0
        interaction = jnp.sum(self.interaction * jnp.diagonal(covariance, axis1=1, axis2=2), axis=-1)
        return quadratic.at(above) + posterior.log_marginal + third + interaction, interaction, posterior


def third_hermite(
    z: Float[ArrayLike, "*batch q"], covariance: Float[Array, "*#batch q q"] | None = None
) -> Float[Array, "*batch q q q"]:
    """Return the means of Hermite's polynomials of degree three in variables about z; None: at z itself.

    They are orthogonal to every quadratic over standard normals.
    """
    z = jnp.asarray(z)
    beyond = (0.0 if covariance is None else covariance) - jnp.eye(z.shape[-1])
    pairs = z[..., :, None] * z[..., None, :]
    return (
        (pairs + beyond)[..., None] * z[..., None, None, :]
        + beyond[..., :, None, :] * z[..., None, :, None]
        + beyond[..., None, :, :] * z[..., :, None, None]
    )


class ValueSummaries(NamedTuple):
    """Likelihood of (log k, log beta) of each record at a value of its noise, F_i and J integrated out.

    A record's information on its values scales with its noise, and where its likelihood is largest may move. Taken at
    one noise, the density would be off by its slope in the typical noise, which adds up over records.

    Attributes
    ----------
    centre:
        Shape (records, 2): approximate posterior mean of the values.
    root:
        Shape (records, directions, 2): times the values about the centre, coordinates in which the log likelihood is
        that of as many independent normals of variance 1; at the noise `noise`.
    score:
        Shape (records, directions): where these have their mean.
    log_rate, score_rate:
        Shape (records, directions, q): derivatives of the logarithm of their precision, and of `score`, with respect to
        the noise.
    variance:
        Shape (records, directions): of these coordinates under the approximate posterior.
    noise:
        Shape (records, q): the noise about which this is.
    """

    centre: Float[Array, "records 2"]
    root: Float[Array, "records directions 2"]
    score: Float[Array, "records directions"]
    log_rate: Float[Array, "records directions q"]
    score_rate: Float[Array, "records directions q"]
    variance: Float[Array, "records directions"]
    noise: Float[Array, "records q"]

    def given(self, noise: Float[Array, "records q"]) -> tuple[QuadraticApproximation, Float[Array, " records"]]:
        """Return the log density of the values at this noise, less a constant; and that constant.

        With it the mean over the approximate posterior of the values is the same at every noise: how that mean follows
        the noise is in `NoiseSummaries`.
        """
        off = noise - self.noise
        precision = jnp.exp(jnp.einsum("rdq,rq->rd", self.log_rate, off))
        score = self.score + jnp.einsum("rdq,rq->rd", self.score_rate, off)
        slope = jnp.einsum("rd,rdi->ri", precision * score, self.root)
        constant = 0.5 * jnp.sum((precision - 1.0) * self.variance, axis=-1)
        of_values = jnp.einsum("rdi,rd,rdj->rij", self.root, precision, self.root)
        return QuadraticApproximation(self.centre, slope, of_values), constant


class OffsetSummaries(NamedTuple):
    """Likelihood of each record's J, for the mean and the standard deviation of J.

    Given its values, a record amounts to an estimate of its J with a normal error, linear in the values.

    Attributes
    ----------
    J, along_values:
        Shapes (records,) and (records, 2): the estimate at the centre of `ValueSummaries` (kN), and its gradient.
    variance:
        Shape (records,): of its error (kN^2).
    rest:
        Shape (records,): what its variance over the approximate posterior has beyond that of `along_values` (kN^2).
    mean_J, variance_J:
        Shapes (records,) and (): mean of J, and its variance, at which `ValueSummaries` are taken.
    """

    J: Float[Array, " records"]
    along_values: Float[Array, "records 2"]
    variance: Float[Array, " records"]
    rest: Float[Array, " records"]
    mean_J: Float[Array, " records"]
    variance_J: Float[Array, ""]

    def at(self, mean_J: Float[Array, " records"], sd_J: Float[Array, ""]) -> Float[Array, " records"]:
        """Return the log density at means and a standard deviation of J, with the values at their centre."""
        total = sd_J**2 + self.variance
        return -0.5 * (((self.J - mean_J) ** 2 + self.rest) / total + jnp.log(total))

    def move(
        self, values: QuadraticApproximation, mean_J: Float[Array, " records"], sd_J: Float[Array, ""]
    ) -> QuadraticApproximation:
        """Return the likelihood of the values at other means and another standard deviation of J."""
        inverse, before = (1.0 / (variance + self.variance) for variance in (sd_J**2, self.variance_J))
        slope = (self.J - mean_J) * inverse - (self.J - self.mean_J) * before
        squares = self.along_values[:, :, None] * self.along_values[:, None, :]
        return values._replace(
            slope=values.slope - self.along_values * slope[:, None],
            precision=values.precision + squares * (inverse - before)[:, None, None],
        )


class RecordSummaries(NamedTuple):
    """Marginal log likelihood of each record but for a constant, as a sum of three parts.

    Attributes
    ----------
    values:
        Of (log k, log beta), F_i and J integrated out, at a value of the noise, and at what is shared of J.
    noise, offsets:
        Of the noise, and of mean and standard deviation of J.
    """

    values: ValueSummaries
    noise: NoiseSummaries
    offsets: OffsetSummaries


def record_log_density(
    data: RecordData,
    likelihood: Likelihood,
    log_values: Float[Array, "records 2"],
    noise: Float[Array, "records q"],
    mean_J: Float[Array, " records"],
    sd_J: Float[Array, ""],
) -> Float[Array, " records"]:
    """Return the log density of each record's forces at (log k, log beta) and at (log sigma[, atanh rho])."""
    rho = jnp.tanh(noise[:, 1]) if noise.shape[1] > 1 else None
    return RecordForces(data, log_values, mean_J, sd_J, jnp.exp(noise[:, 0]), rho, likelihood).log_prob(data.F)


def empty_summaries(records: int, noise: str) -> RecordSummaries:
    """Return zeros of the shapes that `summarise_records` gives, to compile for."""
    q = 2 if noise == "ar1" else 1

    def blank(*shape: int) -> Array:
        return jnp.asarray(np.zeros((records, *shape)))

    of_noise = QuadraticApproximation(blank(q), blank(q), blank(q, q))
    by_value, by_noise = blank(VALUES), blank(VALUES, q)
    values = ValueSummaries(by_value, blank(VALUES, VALUES), by_value, by_noise, by_noise, by_value, blank(q))
    noises = NoiseSummaries(of_noise, of_noise.precision, blank(q, q, q), of_noise.slope)
    offsets = OffsetSummaries(blank(), by_value, blank(), blank(), blank(), jnp.asarray(np.zeros(())))
    return RecordSummaries(values, noises, offsets)
