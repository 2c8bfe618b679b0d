"""Coordinates in which NUTS finds every record, case and noise level close to a standard normal.

Where the data below a level are strong, sampling it centred is right; where they are weak, non-centred; in between,
or where the scales decide, neither. Here each unknown is centred on its conditional mean and scaled by its conditional
standard deviation, both under a Gaussian approximation of its data (the least-squares estimate and Fisher
information) and given the scales above it, which are being sampled too: strong and weak are the two ends of one
formula. The change of variables is exact, with its volume accounted for; the approximation shapes the coordinates
only, never the posterior.

Source: the idea of Papaspiliopoulos, Roberts & Skold (2007), "A general framework for the parametrization of
hierarchical models", Statistical Science 22, taken from one partial centring to one that follows the scales.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.model.normal_posterior import NormalPosterior, QuadraticApproximation


class Gaussian(NamedTuple):
    """Likelihood of some unknowns given the level below, as independent normal estimates; leading axes batch them."""

    value: Float[Array, "*batch units"]
    precision: Float[Array, "*batch units"]


class Reparameterised(NamedTuple):
    """Unknowns as functions of standard coordinates.

    Attributes
    ----------
    value:
        The unknowns.
    deviation:
        The unknowns less the level above, free of cancellation: a scale may go to zero.
    log_volume:
        Logarithm of the volume that the map makes of a unit of z.
    """

    value: Float[Array, "..."]
    deviation: Float[Array, "..."]
    log_volume: Float[Array, "..."]


def reparameterise(
    z: Float[Array, "*units"], estimate: Gaussian, above: Float[Array, "*#units"], scale: Float[Array, "*#units"]
) -> Reparameterised:
    """Return scalar unknowns at z, given a Gaussian estimate below and a normal level above.

    If the data were as Gaussian as `estimate` says and the level above is Normal(above, scale), the posterior of z
    is exactly standard normal, whatever the scale.
    """
    value, precision = estimate
    # Precision of the unknown in units of the level above: what the data add to 1.
    gain = 1.0 + precision * scale**2
    deviation = scale * (scale * precision * (value - above) / gain + z / jnp.sqrt(gain))
    return Reparameterised(above + deviation, deviation, jnp.log(scale) - 0.5 * jnp.log(gain))


def reparameterise_whitened(
    z: Float[Array, "units n"],
    rows: Float[Array, "units n n"],
    target: Float[Array, "units n"],
    above: Float[Array, "units n"],
    scale: Float[Array, "units n"],
) -> Reparameterised:
    """Return a few unknowns of each unit at z, as `reparameterise_by_slope`, for whitened estimates: rows @ unknowns.

    Their standard deviations are 1; a row of zeros says nothing.
    """
    off = target - jnp.einsum("uij,uj->ui", rows, above)
    slope, precision = jnp.einsum("uij,ui->uj", rows, off), jnp.einsum("uij,uik->ujk", rows, rows)
    return reparameterise_by_slope(z, slope, precision, above, scale)


def reparameterise_by_slope(
    z: Float[Array, "units n"],
    slope: Float[Array, "units n"],
    precision: Float[Array, "units n n"],
    above: Float[Array, "units n"],
    scale: Float[Array, "units n"],
) -> Reparameterised:
    """Return a few unknowns of each unit at z, as `reparameterise` does for scalars.

    Parameters
    ----------
    z:
        Standard coordinates.
    slope, precision:
        What the data say: slope of their log density at the level above, and minus its curvature.
    above, scale:
        The level above: Normal(above, scale), each by itself.
    """
    posterior = NormalPosterior(slope.T, jnp.moveaxis(precision, 0, -1), scale.T)
    deviation = posterior.draw(z.T).T
    return Reparameterised(above + deviation, deviation, posterior.log_volume)


def reparameterise_jointly(
    z: Float[Array, "*batch terms"],
    estimate: QuadraticApproximation,
    above: Float[ArrayLike, "*batch terms"],
    scale: Float[Array, "*batch terms"],
) -> Reparameterised:
    """Return the many terms of a regression at z: `estimate` is of all of them, and each is Normal(above, scale).

    If the data were as Gaussian as `estimate` says, the posterior of z is exactly standard normal, whatever the scales
    and however the columns of the design overlap. A term without information in the data stays at its level above.
    """
    above = jnp.asarray(above)
    # Slope and precision of the terms in units of their scales: what the data add to 1.
    slope = scale * estimate.slope_at(above)
    gain = jnp.eye(z.shape[-1]) + scale[..., :, None] * estimate.precision * scale[..., None, :]
    root = inverse_root(gain)
    half = jnp.einsum("...ts,...t->...s", root, slope)
    deviation = scale * jnp.einsum("...ts,...s->...t", root, half + z)
    log_volume = jnp.sum(jnp.log(scale), axis=-1) + jnp.sum(jnp.log(jnp.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
    return Reparameterised(above + deviation, deviation, log_volume)


@jax.custom_jvp
def inverse_root(matrix: Float[Array, "*batch n n"]) -> Float[Array, "*batch n n"]:
    """Return the upper triangle that, times its transpose, is the inverse of a matrix with no eigenvalue below 1.

    The transpose of Cholesky's factor, inverted. The factor of [[matrix, 1], [1, 2]] holds it below the matrix's own,
    so that one call of LAPACK gives it, and its derivative is products alone: triangular solves on a CPU are slow, the
    more so where the processor has other work.
    """
    identity = jnp.broadcast_to(jnp.eye(matrix.shape[-1]), matrix.shape)
    whole = jnp.block([[matrix, identity], [identity, 2.0 * identity]])
    return jnp.linalg.cholesky(whole, symmetrize_input=False)[..., matrix.shape[-1] :, : matrix.shape[-1]]


@inverse_root.defjvp
def _inverse_root_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """Source: Murray (2016), "Differentiation of the Cholesky decomposition", arXiv:1602.07527."""
    root = inverse_root(*primals)
    within = root.mT @ tangents[0] @ root
    lower = jnp.tril(within, -1) + 0.5 * jnp.diagonal(within, axis1=-2, axis2=-1)[..., None] * jnp.eye(root.shape[-1])
    return root, -root @ lower.mT
