"""Summaries of records: those nearest to their marginal log likelihood, where their posterior is.

A quadratic is made here from any density of records: the one that is nearest to it on average over an approximate
posterior. About the maximum instead, a normal in k would miss one in log k by z^3 s / 2.

Source: the fixed point of Opper & Archambeau (2009), "The variational Gaussian approximation revisited", Neural
Computation 21, with Stein's identities in place of derivatives; means by Gauss-Hermite quadrature.
"""

from itertools import product

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from bayes_tyre.inference.model.collapsed.nearest_quadratics import Moments, project, project_values
from bayes_tyre.inference.model.collapsed.record_summaries import (
    VALUES,
    NoiseSummaries,
    OffsetSummaries,
    RecordSummaries,
    record_log_density,
    third_hermite,
)
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation, RecordEstimates
from bayes_tyre.inference.model.factors import Factors
from bayes_tyre.inference.model.likelihood.direct import Likelihood
from bayes_tyre.inference.model.normal_posterior import NormalPosterior, QuadraticApproximation
from bayes_tyre.inference.record_data import RecordData

#: Points of the quadrature along log k and log beta, and along each parameter of the noise.
_POINTS, _POINTS_OF_NOISE = 5, 4
#: Rounds in which approximate posterior and approximation follow each other.
_ROUNDS = 3
#: Share of the variance of the noise's estimates that is at least put down to the noise: records may agree by chance.
_LEAST_NOISE_SHARE = 0.1
#: Least information of a record on its J, as a share of its prior's.
_LEAST_J_INFORMATION = 1e-6
#: Square root of the share of a record's information on its values, along the gradient of J, that J's prior may give.
_MOST_OF_J = 0.99

#: Means of J of the records, and its standard deviation about them, kN.
_OfJ = tuple[Float[Array, " records"], Float[Array, ""]]


def summarise_records(
    data: RecordData,
    likelihood: Likelihood,
    approximation: LaplaceApproximation,
    factors: Factors,
    noise: str,
    widening: float,
) -> RecordSummaries:
    """Return summaries of the records.

    Parameters
    ----------
    data, likelihood:
        The records, and any density of them.
    approximation:
        Their Laplace approximation, to begin with.
    factors:
        Their cases.
    noise:
        ``iid`` or ``ar1``.
    widening:
        How many times wider than usual ones discordant repeats scatter.
    """
    levels = jnp.asarray(factors.of_record), jnp.asarray(factors.speed.of_case[factors.of_record])
    of_J = approximation.records.typical_J(factors)
    return _summarise(data, likelihood, approximation, *levels, of_J, noise, widening)


@eqx.filter_jit
def _summarise(
    data: RecordData,
    likelihood: Likelihood,
    approximation: LaplaceApproximation,
    of_record: Int[Array, " records"],
    speed: Int[Array, " records"],
    of_J: _OfJ,
    noise: str,
    widening: float,
) -> RecordSummaries:
    records, cases = approximation
    case = cases.middle.T[of_record]
    sd_repeat = jnp.where(cases.discordant[:, None], widening, 1.0) * jnp.exp(cases.log_sd_repeat.value).T[speed]
    noises = _noise_estimates(records, noise)
    variance = jnp.var(noises.centre, axis=0)
    own = jnp.mean(1.0 / jnp.diagonal(noises.precision, axis1=1, axis2=2), axis=0)
    typical = jnp.broadcast_to(jnp.mean(noises.centre, axis=0), noises.centre.shape)
    sd_among_records = jnp.sqrt(jnp.maximum(variance - own, _LEAST_NOISE_SHARE * variance)) + jnp.zeros_like(typical)
    moments = _moments(records.of_log_values(*of_J), case, sd_repeat), _moments(noises, typical, sd_among_records)
    for _ in range(_ROUNDS - 1):
        values, of_noise, _ = _nearest(data, likelihood, of_J, *moments)
        moments = (
            _moments(values.given(values.noise)[0], case, sd_repeat),
            _moments(of_noise.quadratic, typical, sd_among_records),
        )
    return _nearest(data, likelihood, of_J, *moments)


def _noise_estimates(records: RecordEstimates, noise: str) -> QuadraticApproximation:
    """Return what the estimates of each record's noise say of log sigma and, where it is autoregressive, atanh rho."""
    of_noise = [(records.log_sigma, 2.0 * records.points)]
    if noise == "ar1":
        of_noise.append((jnp.arctanh(records.rho), records.points * (1.0 - records.rho**2)))
    centre, precision = (jnp.stack(each, axis=1) for each in zip(*of_noise, strict=True))
    return QuadraticApproximation(centre, jnp.zeros_like(centre), precision[..., None] * jnp.eye(centre.shape[1]))


@eqx.filter_jit
def refine_summaries(
    data: RecordData,
    likelihood: Likelihood,
    log_values: Float[Array, "draws records 2"],
    noise: Float[Array, "draws records q"],
    mean_J: Float[Array, " records"],
    sd_J: Float[Array, ""],
) -> RecordSummaries:
    """Return summaries of the records about draws of their posterior.

    Parameters
    ----------
    data, likelihood:
        The records, and their density.
    log_values, noise:
        Draws of (log k, log beta) and of (log sigma[, atanh rho]).
    mean_J, sd_J:
        Means of J, and its standard deviation about them (kN).
    """
    return _nearest(data, likelihood, (mean_J, sd_J), _moments_of(log_values), _moments_of(noise))


def _moments_of(draws: Float[Array, "draws records n"]) -> Moments:
    """Return the moments of draws."""
    mean = jnp.mean(draws, axis=0)
    off = draws - mean
    return Moments(mean, jnp.linalg.cholesky(jnp.einsum("dri,drj->rij", off, off) / len(draws)))


def _moments(
    quadratic: QuadraticApproximation, above: Float[Array, "records n"], scale: Float[Array, "records n"]
) -> Moments:
    """Return the posterior of unknowns that are Normal(above, scale)."""
    posterior = NormalPosterior(quadratic.slope_at(above).T, jnp.moveaxis(quadratic.precision, 0, -1), scale.T)
    return Moments(above + posterior.draw(jnp.zeros_like(scale.T)).T, jnp.moveaxis(posterior.root(), -1, 0))


def _nearest(data: RecordData, likelihood: Likelihood, of_J: _OfJ, values: Moments, noise: Moments) -> RecordSummaries:
    """Return the summaries nearest to the log density, on average over independent posteriors of values and noise."""
    nodes, weights = _quadrature((_POINTS,) * VALUES + (_POINTS_OF_NOISE,) * noise.mean.shape[1])
    of_values, of_noise = nodes[:, :VALUES], nodes[:, VALUES:]
    mean_J, sd_J = of_J

    def at(node: Float[Array, " n"]) -> Float[Array, "3 records"]:
        """Return the log density at a node, and its slopes in mean_J and in sd_J^2."""
        log_values, noises = values.mean + values.root @ node[:VALUES], noise.mean + noise.root @ node[VALUES:]

        def density(mean_J: Float[Array, " records"], variance_J: Float[Array, ""]) -> Float[Array, " records"]:
            return record_log_density(data, likelihood, log_values, noises, mean_J, jnp.sqrt(variance_J))

        here, along = (mean_J, sd_J**2), jnp.ones_like(mean_J)
        value, in_mean = jax.jvp(density, here, (along, jnp.zeros(())))
        return jnp.stack([value, in_mean, jax.jvp(density, here, (0.0 * along, jnp.ones(())))[1]])

    # One node at a time: memory is that of one value of each record, however many nodes there are.
    density, in_mean, in_variance = jnp.moveaxis(jax.lax.map(at, jnp.asarray(nodes)), 1, 0)
    weighted = jnp.asarray(weights)[:, None] * density
    third = jnp.einsum("mr,mijk->rijk", weighted, third_hermite(of_noise))
    interaction = 0.5 * _slope_variance(weighted, of_noise, weights)
    noises = NoiseSummaries(project(weighted, of_noise, noise), jnp.linalg.inv(noise.root), third, interaction)
    of_values_given_J = project_values(weighted, of_values, of_noise, values, noise)
    precision = of_values_given_J.given(noise.mean)[0].precision
    offsets = _of_offsets(of_J, in_mean, in_variance, of_values, jnp.asarray(weights), values, precision)
    return RecordSummaries(of_values_given_J, noises, offsets)


def _of_offsets(
    of_J: _OfJ,
    in_mean: Float[Array, "nodes records"],
    in_variance: Float[Array, "nodes records"],
    z: Float[np.ndarray, "nodes 2"],
    weights: Float[Array, " nodes"],
    values: Moments,
    precision: Float[Array, "records 2 2"],
) -> OffsetSummaries:
    """Return the likelihood of J, from slopes in mean_J and in sd_J^2 at nodes z of the values.

    At each node the density is Normal(J; mean_J, sd_J^2 + variance): the slope in mean_J is J - mean_J over the total
    variance, and the slope in sd_J^2 half the square of that less half the inverse of the total. Means of products with
    the nodes are gradients (Stein's identity).
    """
    mean_J, sd_J = of_J
    mean, square = weights @ in_mean, weights @ in_mean**2
    # A record may have no information on J, but not less.
    inverse = jnp.clip(square - 2.0 * weights @ in_variance, _LEAST_J_INFORMATION / sd_J**2, sd_J**-2.0)
    by_node = jnp.einsum("m,mr,mi->ri", weights, in_mean, z) / inverse[:, None]
    along = jnp.einsum("ri,rik->rk", by_node, jnp.linalg.inv(values.root))
    # With J unknown a record's information on its values is still 0 or more.
    information = jnp.einsum("ri,rij,rj->r", along, jnp.linalg.inv(precision), along) * inverse
    share = jnp.minimum(1.0, _MOST_OF_J / jnp.sqrt(information))
    rest = (square - mean**2) / inverse**2 - share**2 * jnp.sum(by_node**2, axis=1)
    J, variance = mean_J + mean / inverse, 1.0 / inverse - sd_J**2
    return OffsetSummaries(J, along * share[:, None], variance, rest, mean_J, sd_J**2)


def _slope_variance(
    weighted: Float[Array, "nodes records"], z: Float[np.ndarray, "nodes q"], weights: Float[np.ndarray, " nodes"]
) -> Float[Array, "records q"]:
    """Return the variance over the values of the mean slope along the noise's coordinates z."""
    of_each = _POINTS**VALUES  # the noise's nodes follow each other at each of these
    weight = weights.reshape(of_each, -1).sum(axis=1)
    by_values = weighted.reshape(of_each, -1, weighted.shape[1]) / weight[:, None, None]
    slope = jnp.einsum("vmr,mi->vri", by_values, jnp.asarray(z[: by_values.shape[1]]))
    return jnp.average((slope - jnp.average(slope, axis=0, weights=weight)) ** 2, axis=0, weights=weight)


def _quadrature(points: tuple[int, ...]) -> tuple[Float[np.ndarray, "nodes n"], Float[np.ndarray, " nodes"]]:
    """Return nodes and weights of means over independent standard normals, so many points along each."""
    rules = [np.polynomial.hermite_e.hermegauss(count) for count in points]
    nodes = np.array(list(product(*(rule[0] for rule in rules))))
    weights = np.array([np.prod(each) for each in product(*(rule[1] for rule in rules))])
    return nodes, weights / weights.sum()
