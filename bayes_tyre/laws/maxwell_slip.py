"""Maxwell-slip: springs that each stick before they slide, in parallel with a linear spring.

Elements in parallel, each elastic up to its own yield displacement and sliding under its own Coulomb friction beyond,
are how FTire describes the hysteresis of a tyre's radial stiffness, and are Iwan's (1966) parallel-series model. Unlike
Fancher's law it remembers where the path has turned: a small cycle within a larger move closes and wipes itself out.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import gammaincinv

from bayes_tyre.laws.base import ScalarLike, StatefulLaw

ELEMENTS = 5

#: State of the law: displacement, mm, force, kN, and the friction of each element, kN, shape (elements,).
type Slips = tuple[ScalarLike, ScalarLike, Float[Array, " elements"]]


def yields(elements: int = ELEMENTS) -> tuple[float, ...]:
    """Return the displacements at which elements of equal friction yield, in units of beta.

    The means of equal shares' ranks, as quantiles of the gamma distribution of shape 2. With ever more elements a first
    loading then follows ``settled (1 - exp(-u / beta))``, the way of Fancher's law from the middle line: a friction
    that yields with density w at displacement y gives a curve f with ``f'' = -w(y) / y``.
    """
    return tuple(float(q) for q in gammaincinv(2.0, (np.arange(elements) + 0.5) / elements))


_YIELDS = yields()


class MaxwellSlip(StatefulLaw):
    """A line ``k d + C`` and `ELEMENTS` elements of equal friction, their yield displacements spread by `yields`.

    Two parameters define all elements, so that a motion identifies them. Each move is exact, however long.

    Attributes
    ----------
    k:
        Slope where all elements slide, kN/mm.
    C:
        Force half-way between the settled branches at zero displacement, kN.
    settled:
        Friction of all elements: half the distance between the settled branches, kN, >= 0.
    beta:
        Unit of the yield displacements, mm, > 0; comparable to that of Fancher's law. They go from 0.53 to 3.9 beta.
    """

    k: ScalarLike
    C: ScalarLike
    settled: ScalarLike
    beta: ScalarLike

    def init(self, d: ScalarLike, F: ScalarLike) -> Slips:
        """Return the state at displacement `d`, mm, under force `F`, kN: each element bears an equal share."""
        share = (F - jnp.multiply(self.k, d) - self.C) / ELEMENTS
        return d, F, jnp.broadcast_to(share, (ELEMENTS,))

    def step(self, state: Slips, d: ScalarLike) -> tuple[Slips, Float[Array, ""]]:
        """Return the state and the force, kN, after a monotone move to displacement `d`, mm."""
        d_i, F_i, before = state
        u, most = jnp.subtract(d, d_i), jnp.divide(self.settled, ELEMENTS)
        stuck = before + most * u / jnp.stack([jnp.multiply(self.beta, at) for at in _YIELDS])
        # An element that starts beyond its friction stays there until the path turns: no move, no change.
        after = jnp.clip(stuck, jnp.minimum(before, -most), jnp.maximum(before, most))
        F = jnp.sum(after - before) + self.k * u + F_i
        return (d, F, after), F

    def check(self) -> None:
        """Refuse settled < 0 and beta <= 0 (concrete numbers): closed loops would make energy.

        Raises
        ------
        ValueError
            If any of the parameters, single or stacked, is so.
        """
        settled, beta = np.asarray(self.settled), np.asarray(self.beta)
        if not (np.all(settled >= 0) and np.all(beta > 0)):
            raise ValueError(f"needs settled >= 0 and beta > 0; got settled {settled}, beta {beta}")
