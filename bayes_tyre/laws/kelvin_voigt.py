"""A linear spring under a tyre: with the damper of the axle's motion beside it, the Kelvin-Voigt element.

The model of Lines and Young, and of Taylor and others, for tyres of agricultural vehicles: ``F = k d + c d'``.
Its damper is not a field here. A law follows displacement alone, whatever the time it takes, and the motion of the axle
has a damper c at the wheel centre already: a second one beside it would only ever be seen in their sum.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.laws.base import Point, ScalarLike, StatefulLaw


class KelvinVoigt(StatefulLaw):
    """The spring ``k d + C``: no friction, so a closed loop loses nothing.

    A spring has nothing that would bring it back to its line: a start off the line goes on in parallel to it.

    Attributes
    ----------
    k:
        Stiffness, kN/mm, >= 0.
    C:
        Force at zero displacement, kN: where a motion's rest lies on the line.
    """

    k: ScalarLike
    C: ScalarLike

    def step(self, state: Point, d: ScalarLike) -> tuple[Point, Float[Array, ""]]:
        """Return the state and the force, kN, after a move to displacement `d`, mm."""
        d_i, F_i = state
        F = jnp.multiply(self.k, jnp.subtract(d, d_i)) + F_i
        return (d, F), F

    def check(self) -> None:
        """Refuse k < 0 (concrete numbers): a body would fly off.

        Raises
        ------
        ValueError
            If any k, single or stacked, is so.
        """
        k = np.asarray(self.k)
        if not np.all(k >= 0):
            raise ValueError(f"needs k >= 0; got k {k}")
