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

import jax.numpy as jnp
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, ArrayLike, Float


class Gaussian(NamedTuple):
    """What the data below say of some unknowns, as independent normal estimates; leading axes batch them."""

    value: Float[Array, "*batch units"]
    precision: Float[Array, "*batch units"]


class Placed(NamedTuple):
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


def place(
    z: Float[Array, "*units"], estimate: Gaussian, above: Float[Array, "*#units"], scale: Float[Array, "*#units"]
) -> Placed:
    """Return scalar unknowns at z, given a Gaussian estimate below and a normal level above.

    If the data were as Gaussian as `estimate` says and the level above is Normal(above, scale), the posterior of z
    is exactly standard normal, whatever the scale.
    """
    value, precision = estimate
    # Precision of the unknown in units of the level above: what the data add to 1.
    gain = 1.0 + precision * scale**2
    deviation = scale * (scale * precision * (value - above) / gain + z / jnp.sqrt(gain))
    return Placed(above + deviation, deviation, jnp.log(scale) - 0.5 * jnp.log(gain))


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
    pull = scale * jnp.einsum("uij,uj->ui", precision, estimate - above)
    a, c = 1.0 + precision[:, 0, 0] * scale[:, 0] ** 2, 1.0 + precision[:, 1, 1] * scale[:, 1] ** 2
    b = precision[:, 0, 1] * scale[:, 0] * scale[:, 1]
    determinant = a * c - b**2
    mean = jnp.stack([c * pull[:, 0] - b * pull[:, 1], a * pull[:, 1] - b * pull[:, 0]], axis=1) / determinant[:, None]
    # [[a, b], [b, c]] is R R^T with R = [[r, 0], [b / r, s]]; inv(R)^T z has it as its precision.
    r = jnp.sqrt(a)
    s = jnp.sqrt(determinant) / r
    second = z[:, 1] / s
    first = (z[:, 0] - b / r * second) / r
    deviation = scale * (mean + jnp.stack([first, second], axis=1))
    return Placed(above + deviation, deviation, jnp.sum(jnp.log(scale), axis=1) - 0.5 * jnp.log(determinant))


def place_jointly(
    z: Float[Array, "*batch terms"],
    design: Float[ArrayLike, "*batch units terms"],
    estimate: Gaussian,
    above: Float[ArrayLike, "*batch terms"],
    scale: Float[Array, "*batch terms"],
) -> Placed:
    """Return the terms of a regression at z: `estimate` is of design @ terms, and each term is Normal(above, scale).

    If the data were as Gaussian as `estimate` says, the posterior of z is exactly standard normal, whatever the scales
    and however the columns of the design overlap. A term without weight in the design stays at its level above.
    """
    design, above = jnp.asarray(design), jnp.asarray(above)
    weighted = design * scale[..., None, :]
    off = estimate.value - jnp.einsum("...ut,...t->...u", design, above)
    pull = jnp.einsum("...ut,...u->...t", weighted, estimate.precision * off)
    # Precision of the terms in units of their scales: what the data add to 1.
    gain = jnp.eye(z.shape[-1]) + weighted.mT @ (weighted * estimate.precision[..., None])
    root = jnp.linalg.cholesky(gain)
    half = solve_triangular(root, pull[..., None], lower=True)
    deviation = scale * solve_triangular(root, half + z[..., None], lower=True, trans=1)[..., 0]
    log_volume = jnp.sum(jnp.log(scale), axis=-1) - jnp.sum(jnp.log(jnp.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
    return Placed(above + deviation, deviation, log_volume)
