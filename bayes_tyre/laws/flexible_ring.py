"""A flexible ring on an elastic foundation: the belt of a tyre between its sidewalls, and its natural frequencies.

The ring is thin and inextensible, with displacements w (radial) and v (tangential), w = -v'. For ``v = cos(n theta)``
and one unit of mass and length, twice the energies over pi R are

- kinetic ``rho A (n^2 + 1)``, and of the foundation ``n^2 k_w + k_v``;
- of bending ``EI (w'' + w)^2 / R^4 = EI n^2 (n^2 - 1)^2 / R^4``;
- of tension and the pressure that it carries, T = p b R, which stays normal to the belt: p b times the area lost,
  ``T ((v - w')^2 + w^2 - v^2) / R^2 = T n^2 (n^2 - 1) / R^2``.

Their ratio is the square of the natural frequency, which mass per length rho A and radius R enter as ratios alone. In a
ring that turns, belt and sidewalls together, the centrifugal tension rho A R^2 Omega^2 and the Coriolis force act
besides. Seen from the ground a mode is then two waves, ``(n^2 + 1) s^2 +- 2 n (n^2 - 1) Omega s`` equal to the same
right-hand side; centrifugal terms cancel in it. Source: Bryan (1890, On the beats in the vibrations of a revolving
cylinder or bell) for the turning ring; Geng et al. (2007) for the tyre.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike

Modes = Float[np.ndarray | Array, " modes"]


class FlexibleRing(eqx.Module):
    """A ring by what its natural frequencies depend on: each field per mass and length of the belt, 1/s^2, >= 0.

    Attributes
    ----------
    bending:
        EI / (rho A R^4), EI the bending stiffness.
    tension:
        T / (rho A R^2), T the tension of the belt at rest, that pressure keeps: p b R.
    radial, tangential:
        k_w / (rho A) and k_v / (rho A), stiffness of the sidewalls per length of the belt.
    """

    bending: ScalarLike | Modes
    tension: ScalarLike | Modes
    radial: ScalarLike
    tangential: ScalarLike

    def frequencies(self, mode: Modes, spin: Modes | float = 0.0, wave: Modes | float = 0.0) -> Float[Array, " modes"]:
        """Return natural frequencies as seen from the ground, Hz.

        Parameters
        ----------
        mode:
            Waves around the ring, n: 0 turns it about the rim, 1 moves it as a whole, as the rigid ring.
        spin:
            Angular speed of the wheel, 1/s.
        wave:
            1 for the wave that travels with the rotation, -1 against it; at rest both are one standing wave.
        """
        square = jnp.square(jnp.asarray(mode))
        stiffness = (
            self.bending * square * (square - 1) ** 2
            + self.tension * square * (square - 1)
            + self.radial * square
            + self.tangential
        )
        coriolis = mode * (square - 1) * jnp.asarray(spin)
        root = jnp.sqrt(coriolis**2 + (square + 1) * stiffness)
        return (jnp.asarray(wave) * coriolis + root) / (square + 1) / (2 * np.pi)
