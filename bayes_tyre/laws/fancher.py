"""Fancher's law of the tyre: the recursion (Eq. 1), one step of it (Eq. 2), and its limit for small steps.

Equation numbers are those of the thesis this package identifies: *Characterising the stiffness and hysteresis
of single and dual truck tyres* (University of the Witwatersrand, 2019). Forces in kN, displacements in mm.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.laws.base import Law, Path, ScalarLike, StatefulLaw


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


def _rise_and_fall(
    u: Float[Array, "*#shape"], beta: Float[ArrayLike, "*#shape"]
) -> tuple[Float[Array, "*shape"], Float[Array, "*shape"]]:
    """Return the fractions of the way to the loading and to the unloading curve that a move u, mm, goes.

    One of them is 0. Max and min share their derivative evenly at u = 0, so that forces get the mean of their
    loading and unloading slopes there; with jnp.abs, whose derivative at 0 is 1, every start would be a loading.
    """
    return -jnp.expm1(-jnp.maximum(u, 0.0) / beta), -jnp.expm1(jnp.minimum(u, 0.0) / beta)


Point = tuple[ScalarLike, ScalarLike]
"""State of Fancher's law: displacement, mm, and force, kN."""


class Recursion(StatefulLaw):
    """Eq. 1 step by step, ``F = F_lim + (F_prev - F_lim) exp(-|d - d_prev| / beta)``.

    F_lim is the upper envelope at d when d grows, the lower when it falls. The force depends on the points at
    which the path is sampled: use `Fancher` unless the sampling itself is the question.

    Attributes
    ----------
    upper, lower:
        The envelopes: functions from displacement, mm, to force, kN, such as the methods of
        `bayes_tyre.laws.envelopes.LinearEnvelope` or `TableEnvelope`.
    beta:
        Displacement over which the force approaches the envelope, mm, > 0.
    """

    upper: Callable[[ScalarLike], ScalarLike]
    lower: Callable[[ScalarLike], ScalarLike]
    beta: ScalarLike

    def init(self, d: ScalarLike, F: ScalarLike) -> Point:
        """Return the state at displacement `d`, mm, under force `F`, kN."""
        return d, F

    def step(self, state: Point, d: ScalarLike) -> tuple[Point, Float[Array, ""]]:
        """Return the state and the force, kN, after one step of Eq. 1 to displacement `d`, mm."""
        d_prev, F_prev = state
        rise, fall = _rise_and_fall(jnp.subtract(d, d_prev), self.beta)
        F = rise * jnp.subtract(self.upper(d), F_prev) + fall * jnp.subtract(self.lower(d), F_prev) + F_prev
        return (d, F), F


class OneStep(Law):
    """Eq. 2: the recursion taken in one step from the first point of a path straight to each of the others.

    Attributes
    ----------
    k:
        Slope of the envelope, kN/mm.
    C:
        Force of the envelope at zero displacement, kN.
    beta:
        Displacement over which the force approaches the envelope, mm, > 0.
    """

    k: ScalarLike
    C: ScalarLike
    beta: ScalarLike

    def force(self, path: Path, F_start: ScalarLike) -> Float[Array, " points"]:
        """Return the force, kN, at every point of the path, mm, by Eq. 2 from ``path[0]`` and `F_start`, kN."""
        path = jnp.asarray(path)
        return equation_2(path, k=self.k, C=self.C, beta=self.beta, d_i=path[0], F_i=F_start)


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

    def init(self, d: ScalarLike, F: ScalarLike) -> Point:
        """Return the state at displacement `d`, mm, under force `F`, kN."""
        return d, F

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
    """Return the energy that `Fancher`'s law dissipates in a cycle once its loop repeats itself.

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
