"""Energy that a closed loop of force over displacement dissipates: of any loop, and of Fancher's law exactly."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.laws.base import Path


def loop_energy(d: Path, F: Float[ArrayLike, " points"]) -> Float[Array, ""]:
    """Return the energy that a closed loop dissipates, kN mm = J: positive when energy is lost.

    Parameters
    ----------
    d:
        Displacement around the loop, mm, shape (points,); the last point is joined to the first.
    F:
        Force, kN, shape (points,).

    Returns
    -------
    The integral of F over d by the trapezoid rule, J.
    """
    d, F = jnp.asarray(d), jnp.asarray(F)
    return jnp.sum((F + jnp.roll(F, -1)) * (jnp.roll(d, -1) - d)) / 2


def dissipated_energy_per_cycle(
    *,
    k: Float[ArrayLike, "*#shape"],
    x: Float[ArrayLike, "*#shape"],
    beta: Float[ArrayLike, "*#shape"],
    amplitude: Float[ArrayLike, "*#shape"],
) -> Float[Array, "*shape"]:
    """Return the energy that Fancher's law dissipates in a cycle once its loop repeats itself.

    ``4 (x - k beta) (a - beta tanh(a / beta))``, a the amplitude: between the ends of the stroke the force less
    k d + C relaxes towards +-(x - k beta), and it turns at +-(x - k beta) tanh(a / beta). Exact, and precise
    to rounding for any beta / a. It depends neither on C nor on the displacement the cycle is centred on.

    Parameters
    ----------
    k:
        Slope of the envelopes, kN/mm.
    x:
        Coulomb friction: half the distance between the envelopes, kN, >= 0.
    beta:
        Displacement over which the force settles, mm, > 0.
    amplitude:
        Half the stroke from peak to peak, mm, >= 0.

    Returns
    -------
    Energy, kN mm = J, in the common shape; negative (energy made) when x < k beta.
    """
    return 4 * jnp.subtract(x, jnp.multiply(k, beta)) * beta * _less_tanh(jnp.divide(amplitude, beta))


def _less_tanh(y: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Return y - tanh(y) for y >= 0 without the cancellation of the plain difference at small y."""
    small = jnp.minimum(y, 1.0)
    # Lambert's continued fraction tanh(y) = y / (1 + c), c = y^2 / (3 + y^2 / (5 + ...)): all terms are positive.
    c = jnp.zeros_like(small)
    for odd in range(19, 1, -2):
        c = small**2 / (odd + c)
    return jnp.where(y < 1, small * c / (1 + c), y - jnp.tanh(y))
