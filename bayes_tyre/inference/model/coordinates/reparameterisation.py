"""Coordinates in which NUTS finds every record, case and noise level close to a standard normal.

Where the data below a level are strong, sampling it centred is right; where they are weak, non-centred; in between,
or where the scales decide, neither. Here each unknown is placed at its conditional mean and scaled by its conditional
standard deviation, both under a Gaussian approximation of its data (the least-squares estimate and Fisher
information) and given the scales above it, which are being sampled too: strong and weak are the two ends of one
formula. The change of variables is exact, with its volume accounted for; the approximation shapes the coordinates
only, never the posterior.

Source: the idea of Papaspiliopoulos, Roberts & Skold (2007), "A general framework for the parametrization of
hierarchical models", Statistical Science 22, taken from one partial centring to one that follows the scales.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.model.normal_posterior import NormalPosterior


class Gaussian(NamedTuple):
    """What the data below say of some unknowns, as independent normal estimates; leading axes batch them."""

    value: Float[Array, "*batch units"]
    precision: Float[Array, "*batch units"]


class Reparameterised(NamedTuple):
    """Unknowns placed from standard coordinates.

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
    design: Float[ArrayLike, "*batch units terms"],
    estimate: Gaussian,
    above: Float[ArrayLike, "*batch terms"],
    scale: Float[Array, "*batch terms"],
) -> Reparameterised:
    """Return the terms of a regression at z: `estimate` is of design @ terms, and each term is Normal(above, scale).

    If the data were as Gaussian as `estimate` says, the posterior of z is exactly standard normal, whatever the scales
    and however the columns of the design overlap. A term without weight in the design stays at its level above.
    """
    design, above = jnp.asarray(design), jnp.asarray(above)
    weighted = design * scale[..., None, :]
    off = estimate.value - jnp.einsum("...ut,...t->...u", design, above)
    slope = jnp.einsum("...ut,...u->...t", weighted, estimate.precision * off)
    # Precision of the terms in units of their scales: what the data add to 1.
    gain = jnp.eye(z.shape[-1]) + weighted.mT @ (weighted * estimate.precision[..., None])
    root = jnp.linalg.cholesky(gain)
    half = solve_triangular(root, slope[..., None], lower=True)
    deviation = scale * solve_triangular(root, half + z[..., None], lower=True, trans=1)[..., 0]
    log_volume = jnp.sum(jnp.log(scale), axis=-1) - jnp.sum(jnp.log(jnp.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
    return Reparameterised(above + deviation, deviation, log_volume)
