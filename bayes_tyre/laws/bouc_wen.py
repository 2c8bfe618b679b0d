"""Bouc-Wen's law: a linear spring and a hysteretic force that settles, the sharper the larger an exponent.

``F = k d + C + h``, ``dh/dd = (settled / beta) (1 - s sgn(h) |h / settled|^n)``, s = +1 loading, -1 unloading: Wen's
form (1976) with the term in dd |h|^n left out, for then n = 1 is a Dahl element, and with it Fancher's law for small
steps, ``settled = x - k beta``. Larger n keep the initial slope longer and settle more suddenly.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.laws.base import Point, ScalarLike, StatefulLaw


class BoucWen(StatefulLaw):
    """Bouc-Wen's law between the settled branches ``k d + C + settled`` and ``k d + C - settled``.

    A move is exact for n = 1, however long. For other n it is integrated in `substeps` steps, in a form whose error
    dies with the friction's own way to its branch. One move instead of a thousand is off by so much of `settled` at
    most: for n from 1 to 3 by 4e-4, and by 3e-5 for moves up to beta / 2 from n = 2; for n = 0.5, whose rate has a kink
    where the friction is 0, by 1.2e-2.

    Attributes
    ----------
    k:
        Slope of the branches, kN/mm.
    C:
        Force half-way between the branches at zero displacement, kN.
    settled:
        Friction: half the distance between the branches, kN, > 0.
    beta:
        Displacement over which the force settles, mm, > 0: the friction's slope where it is 0 is ``settled / beta``.
    n:
        Exponent, > 0.
    substeps:
        Runge-Kutta steps of a move.
    """

    k: ScalarLike
    C: ScalarLike
    settled: ScalarLike
    beta: ScalarLike
    n: ScalarLike
    substeps: int = eqx.field(static=True, default=4)

    def step(self, state: Point, d: ScalarLike) -> tuple[Point, Float[Array, ""]]:
        """Return the state and the force, kN, after a monotone move to displacement `d`, mm."""
        d_i, F_i = state
        u = jnp.subtract(d, d_i)
        h = jnp.subtract(F_i, jnp.multiply(self.k, d_i) + self.C)
        s = jnp.where(u < 0, -1.0, 1.0).astype(h.dtype)
        left = s * self.settled - h
        F = left * _relaxed(s * left / self.settled, s * u / self.beta, self.n, self.substeps) + self.k * u + F_i
        return (d, F), F

    def check(self) -> None:
        """Refuse settled <= 0, beta <= 0 and n <= 0 (concrete numbers).

        Raises
        ------
        ValueError
            If any of the parameters, single or stacked, is so.
        """
        settled, beta, n = np.asarray(self.settled), np.asarray(self.beta), np.asarray(self.n)
        if not (np.all(settled > 0) and np.all(beta > 0) and np.all(n > 0)):
            raise ValueError(f"needs settled > 0, beta > 0 and n > 0; got settled {settled}, beta {beta}, n {n}")


def _relaxed(left: Float[Array, ""], way: Float[Array, ""], n: ScalarLike, substeps: int) -> Float[Array, ""]:
    """Return the share of the way to its branch that the friction goes.

    With y the friction towards the branch in units of `settled`, and e = 1 - y what is left, ``e = e_0 exp(-G)`` and
    ``dG/du = (1 - sgn(y) |y|^n) / (1 - y)``. That rate lies between 1 and n above y = 0, near 1 below it, and is 1 for
    n = 1: a few Runge-Kutta steps follow it, and their error is multiplied by what is left.

    Parameters
    ----------
    left:
        e_0.
    way:
        u, in units of beta, >= 0.
    n, substeps:
        Exponent; Runge-Kutta steps.
    """
    step = way / substeps

    def advanced(_: object, G: Array) -> Array:
        one = _rate(left * jnp.exp(-G), n)
        two = _rate(left * jnp.exp(-(G + step / 2 * one)), n)
        three = _rate(left * jnp.exp(-(G + step / 2 * two)), n)
        four = _rate(left * jnp.exp(-(G + step * three)), n)
        return G + step / 6 * (one + 2 * two + 2 * three + four)

    start = jnp.zeros_like(way)
    # A loop for one step would be one more for the compiler to look into.
    G = advanced(0, start) if substeps == 1 else jax.lax.fori_loop(0, substeps, advanced, start)
    return -jnp.expm1(-G)


def _rate(e: Float[Array, ""], n: ScalarLike) -> Float[Array, ""]:
    """Return (1 - sgn(y) |y|^n) / (1 - y) at y = 1 - e, with all digits where e is small."""
    y = 1 - e
    above, settled = y > 0, e == 0
    # The branch that is not taken still has a derivative: it is kept finite.
    log_above = jnp.log1p(-jnp.where(above, e, 0.5))
    log_below = jnp.log(jnp.where(y < 0, -y, 1.0))
    towards = -jnp.expm1(n * log_above) / jnp.where(settled, 1.0, e)
    away = (1 + jnp.where(y < 0, jnp.exp(n * log_below), 0.0)) / (1 - jnp.minimum(y, 0.0))
    return jnp.where(above, jnp.where(settled, n, towards), away)
