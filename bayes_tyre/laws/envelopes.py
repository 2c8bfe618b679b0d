"""The pairs of curves between which a tyre's force moves: loading approaches the upper, unloading the lower."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.laws.base import ScalarLike


class LinearEnvelope(eqx.Module):
    """Two parallel lines, ``k d + C + x`` and ``k d + C - x``.

    Attributes
    ----------
    k:
        Slope, kN/mm.
    C:
        Force half-way between the lines at zero displacement, kN.
    x:
        Coulomb friction: half the distance between the lines, kN, >= 0.
    """

    k: ScalarLike
    C: ScalarLike
    x: ScalarLike

    def upper(self, d: Float[ArrayLike, "*shape"]) -> Float[Array, "*shape"]:
        """Return the force, kN, that loading approaches at displacement `d`, mm."""
        return jnp.multiply(self.k, d) + self.C + self.x

    def lower(self, d: Float[ArrayLike, "*shape"]) -> Float[Array, "*shape"]:
        """Return the force, kN, that unloading approaches at displacement `d`, mm."""
        return jnp.multiply(self.k, d) + self.C - self.x


class TableEnvelope(eqx.Module):
    """Two measured curves: straight between the points of a table, and beyond its ends as in its end segments.

    Attributes
    ----------
    d:
        Displacement, mm, rising, shape (rows,), two rows at least.
    F_upper, F_lower:
        Force that loading and unloading approach, kN, shape (rows,).
    """

    d: Float[ArrayLike, " rows"]
    F_upper: Float[ArrayLike, " rows"]
    F_lower: Float[ArrayLike, " rows"]

    def upper(self, d: Float[ArrayLike, "*shape"]) -> Float[Array, "*shape"]:
        """Return the force, kN, that loading approaches at displacement `d`, mm."""
        return jnp.interp(d, self.d, self.F_upper, left="extrapolate", right="extrapolate")

    def lower(self, d: Float[ArrayLike, "*shape"]) -> Float[Array, "*shape"]:
        """Return the force, kN, that unloading approaches at displacement `d`, mm."""
        return jnp.interp(d, self.d, self.F_lower, left="extrapolate", right="extrapolate")
