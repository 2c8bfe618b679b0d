"""The quadratics nearest to a log density of records, from its values at the nodes of a quadrature.

Over normal nodes z, Stein's identities give the mean slope of a density f as the mean of f z, its mean curvature as
that of f (z z' - 1), and so on for mixed derivatives.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.model.collapsed.record_summaries import ValueSummaries
from bayes_tyre.inference.model.normal_posterior import QuadraticApproximation

#: Standard deviations at most between the posterior mean and the maximum of a record's likelihood, and the least
#: curvature of its logarithm, in units of the approximate posterior's.
_FARTHEST, _LEAST_CURVATURE = 4.0, 1e-6
#: Largest change of a log precision and of a score, a unit of log sigma or atanh rho. A precision falls by 2 a unit of
#: log sigma, and by about as much a unit of atanh rho: an estimate far beyond that is rounding error.
_LARGEST_RATE = 4.0


class Moments(NamedTuple):
    """An approximate posterior of the records: means, and a square root of each covariance."""

    mean: Float[Array, "records n"]
    root: Float[Array, "records n n"]


def project(
    weighted: Float[Array, "nodes records"], z: Float[np.ndarray, "nodes n"], moments: Moments
) -> QuadraticApproximation:
    """Return the quadratic in some unknowns nearest to a log density, given times its weight at nodes z."""
    slope, curvature = _derivatives(weighted, z)
    # Where a record says nothing, or the density is hollow: no information rather than a negative one.
    size, along = jnp.linalg.eigh(-curvature)
    whiten = jnp.linalg.inv(moments.root)
    across = jnp.einsum("rji,rjk->rik", along, whiten)
    precision = jnp.einsum("rji,rj,rjk->rik", across, jnp.maximum(size, 0.0), across)
    return QuadraticApproximation(moments.mean, jnp.einsum("rji,rj->ri", whiten, slope), precision)


def project_values(
    weighted: Float[Array, "nodes records"],
    z: Float[np.ndarray, "nodes 2"],
    of_noise: Float[np.ndarray, "nodes q"],
    values: Moments,
    noise: Moments,
) -> ValueSummaries:
    """Return the quadratic in the values whose slope, and whose curvature's logarithm, are linear in the noise.

    The log density is given times its weight at nodes z of the values and `of_noise` of the noise.
    """
    slope, curvature = _derivatives(weighted, z)
    size, axes = jnp.linalg.eigh(-curvature)
    # Where the density is flat or hollow, a slope would reach without end.
    size = jnp.maximum(size, jnp.maximum((jnp.einsum("rid,ri->rd", axes, slope) / _FARTHEST) ** 2, _LEAST_CURVATURE))
    # A unit along each axis is now one standard deviation of what the record says.
    unit, scaled = axes.mT / jnp.sqrt(size)[..., None], axes.mT * jnp.sqrt(size)[..., None]
    # Mixed derivatives: of slope and curvature with respect to each of the noise's parameters.
    mixed = [_derivatives(weighted * jnp.asarray(along)[:, None], z) for along in of_noise.T]
    by_noise = jnp.linalg.inv(noise.root)
    slope_rate, curvature_rate = (
        jnp.einsum("rq...,rqp->rp...", jnp.stack(each, axis=1), by_noise) for each in zip(*mixed, strict=True)
    )
    relative = -jnp.einsum("rdi,rpij,rej->rpde", unit, curvature_rate, unit)
    # Turned so that the last parameter of the noise scales each direction's precision; sigma scales all alike.
    _, turn = jnp.linalg.eigh(relative[:, -1])
    unit, scaled = turn.mT @ unit, turn.mT @ scaled
    log_rate = jnp.clip(jnp.einsum("rde,rpdf,rfe->rep", turn, relative, turn), -_LARGEST_RATE, _LARGEST_RATE)
    score = jnp.einsum("rei,ri->re", unit, slope)
    score_rate = jnp.einsum("rei,rpi->rep", unit, slope_rate) - log_rate * score[..., None]
    return ValueSummaries(
        centre=values.mean,
        root=scaled @ jnp.linalg.inv(values.root),
        score=score,
        log_rate=log_rate,
        score_rate=jnp.clip(score_rate, -_LARGEST_RATE, _LARGEST_RATE),
        variance=jnp.sum(scaled**2, axis=-1),
        noise=noise.mean,
    )


def _derivatives(
    weighted: Float[Array, "nodes records"], z: Float[np.ndarray, "nodes n"]
) -> tuple[Float[Array, "records n"], Float[Array, "records n n"]]:
    """Return the mean slope and curvature of a log density, given times its weight at nodes z (Stein's identities)."""
    second = z[:, :, None] * z[:, None, :] - np.eye(z.shape[1])
    return jnp.einsum("mr,mi->ri", weighted, jnp.asarray(z)), jnp.einsum("mr,mij->rij", weighted, jnp.asarray(second))
