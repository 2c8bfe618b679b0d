"""Fancher's law of the tyre: one step (Eq. 2) of its recursion (Eq. 1), and the limit of that for small steps.

Equation numbers are those of the thesis this package identifies: *Characterising the stiffness and hysteresis
of single and dual truck tyres* (University of the Witwatersrand, 2019). Forces in kN, displacements in mm.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.laws.base import Point, ScalarLike, StatefulLaw


def equation_2(
    d: Float[ArrayLike, "*#shape"],
    *,
    k: Float[ArrayLike, "*#shape"],
    C: Float[ArrayLike, "*#shape"],
    beta: Float[ArrayLike, "*#shape"],
    d_i: Float[ArrayLike, "*#shape"],
    F_i: Float[ArrayLike, "*#shape"],
) -> Float[Array, "*shape"]:
    """Return the force by Eq. 2: one step of the recursion from (d_i, F_i) towards the line k d + C.

    ``F = F_i + ((k d + C) - F_i) (1 - exp(-|d - d_i| / beta))``. All arguments broadcast together.

    Parameters
    ----------
    d:
        Displacement, mm; above `d_i` when loading, below it when unloading.
    k:
        Slope of the envelope, kN/mm.
    C:
        Force of the envelope at zero displacement, kN.
    beta:
        Displacement over which the force approaches the envelope, mm, > 0.
    d_i, F_i:
        Displacement, mm, and force, kN, at the start of the step.

    Returns
    -------
    Force, kN, in the common shape. Its derivative with respect to d and d_i jumps at d = d_i; there the
    mean of the two sides is returned, which is 0.
    """
    J = jnp.multiply(k, d_i) + C - F_i
    return equation_2_offset(jnp.subtract(d, d_i), k=k, J=J, beta=beta) + F_i


def equation_2_offset(
    u: Float[ArrayLike, "*#shape"],
    *,
    k: Float[ArrayLike, "*#shape"],
    J: Float[ArrayLike, "*#shape"],
    beta: Float[ArrayLike, "*#shape"],
) -> Float[Array, "*shape"]:
    """Return the change of force by Eq. 2, ``F - F_i = (J + k u) (1 - exp(-|u| / beta))``.

    J and k are far less correlated in a fit than C and k. All arguments broadcast together.

    Parameters
    ----------
    u:
        Displacement from the start of the step, d - d_i, mm.
    k:
        Slope of the envelope, kN/mm.
    J:
        Envelope less force at the start, k d_i + C - F_i, kN.
    beta:
        Displacement over which the force approaches the envelope, mm, > 0.

    Returns
    -------
    F - F_i, kN, in the common shape.
    """
    rise, fall = _rise_and_fall(jnp.asarray(u), beta)
    return (rise + fall) * (J + k * u)


def small_step_limit(
    d: Float[ArrayLike, "*#shape"],
    *,
    k: Float[ArrayLike, "*#shape"],
    C: Float[ArrayLike, "*#shape"],
    x: Float[ArrayLike, "*#shape"],
    beta: Float[ArrayLike, "*#shape"],
    d_i: Float[ArrayLike, "*#shape"],
    F_i: Float[ArrayLike, "*#shape"],
) -> Float[Array, "*shape"]:
    """Return the force after a monotone move from (d_i, F_i) to d, by the limit of Eq. 1 for small steps.

    The exact solution of ``dF/dd = s (k d + C + s x - F) / beta``, s = +1 loading, -1 unloading. It does not
    depend on how the move is sampled, as Eq. 1 does. The force settles on ``k d + C + s (x - k beta)``.
    All arguments broadcast together; a path with reversals is run through by `Fancher`.

    Parameters
    ----------
    d:
        Displacement at the end of the move, mm.
    k:
        Slope of the envelopes, kN/mm.
    C:
        Force half-way between the envelopes at zero displacement, kN.
    x:
        Coulomb friction: half the distance between the envelopes, kN, >= 0.
    beta:
        Displacement over which the force settles, mm, > 0.
    d_i, F_i:
        Displacement, mm, and force, kN, at the start of the move.

    Returns
    -------
    Force, kN, in the common shape. At d = d_i its derivatives are the mean of the two sides.
    """
    u = jnp.subtract(d, d_i)
    above = jnp.multiply(k, d_i) + C - F_i
    settled = x - jnp.multiply(k, beta)
    rise, fall = _rise_and_fall(u, beta)
    return rise * (above + settled) + fall * (above - settled) + k * u + F_i


def small_step_limit_offset(
    u: Float[ArrayLike, "*#shape"],
    *,
    k: Float[ArrayLike, "*#shape"],
    J: Float[ArrayLike, "*#shape"],
    beta: Float[ArrayLike, "*#shape"],
) -> Float[Array, "*shape"]:
    """Return the change of force by the limit for small steps, ``F - F_i = J (1 - exp(-|u| / beta)) + k u``.

    Parameters
    ----------
    u:
        Displacement from the start of the step, d - d_i, mm.
    k:
        Slope of the envelope, kN/mm.
    J:
        Settled force less force at the start, both at the start's displacement: k d_i + C + s (x - k beta) - F_i, kN.
        As in `equation_2_offset` the force settles on F_i + J + k u.
    beta:
        Displacement over which the force settles, mm, > 0.

    Returns
    -------
    F - F_i, kN, in the common shape.
    """
    rise, fall = _rise_and_fall(jnp.asarray(u), beta)
    return (rise + fall) * J + jnp.multiply(k, u)


def _rise_and_fall(
    u: Float[Array, "*#shape"], beta: Float[ArrayLike, "*#shape"]
) -> tuple[Float[Array, "*shape"], Float[Array, "*shape"]]:
    """Return the fractions of the way to the loading and to the unloading curve that a move u, mm, goes.

    One of them is 0. Max and min share their derivative evenly at u = 0, so that forces get the mean of their
    loading and unloading slopes there; with jnp.abs, whose derivative at 0 is 1, every start would be a loading.
    """
    return -jnp.expm1(-jnp.maximum(u, 0.0) / beta), -jnp.expm1(jnp.minimum(u, 0.0) / beta)


def approach(u: ScalarLike, beta: ScalarLike, before: ScalarLike, settled: ScalarLike) -> Array:
    """Return a friction, kN, after a move: towards `settled` where the move loads, towards ``-settled`` where not.

    Parameters
    ----------
    u:
        The move, mm, monotone.
    beta:
        Displacement over which it settles, mm, > 0.
    before:
        Friction before the move, kN.
    settled:
        Size of the friction on which it settles, kN, of either sign.
    """
    rise, fall = _rise_and_fall(jnp.asarray(u), beta)
    start = jnp.asarray(before)
    return start + rise * (settled - start) - fall * (settled + start)


class Fancher(StatefulLaw):
    """Fancher's law: the limit of Eq. 1 for small steps between the lines ``k d + C + x`` and ``k d + C - x``.

    After a reversal the force settles on ``k d + C + s (x - k beta)``: a closed loop loses energy only if
    ``x > k beta``, and makes energy below.

    Attributes
    ----------
    k:
        Slope of the envelopes, kN/mm.
    C:
        Force half-way between the envelopes at zero displacement, kN.
    x:
        Coulomb friction: half the distance between the envelopes, kN, >= 0.
    beta:
        Displacement over which the force settles, mm, > 0.
    """

    k: ScalarLike
    C: ScalarLike
    x: ScalarLike
    beta: ScalarLike

    def step(self, state: Point, d: ScalarLike) -> tuple[Point, Float[Array, ""]]:
        """Return the state and the force, kN, after a monotone move to displacement `d`, mm, however long."""
        d_i, F_i = state
        F = small_step_limit(d, k=self.k, C=self.C, x=self.x, beta=self.beta, d_i=d_i, F_i=F_i)
        return (d, F), F

    def check(self) -> None:
        """Refuse x < k beta and beta <= 0 (concrete numbers): closed loops would make energy.

        Raises
        ------
        ValueError
            If any of the parameters, single or stacked, is so.
        """
        # In numpy: under a trace jax.numpy returns traced arrays even for concrete numbers.
        k, x, beta = np.asarray(self.k), np.asarray(self.x), np.asarray(self.beta)
        if not (np.all(beta > 0) and np.all(x >= k * beta)):
            raise ValueError(f"needs beta > 0 and x >= k beta, or the law makes energy; got k {k}, x {x}, beta {beta}")
