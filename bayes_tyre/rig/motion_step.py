"""One step of the axle's motion: three-point collocation, along a tyre law that is exact between points."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike, State, StatefulLaw
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig

# Fixed-point iterations of a step's accelerations and displacements. Each time their error
# shrinks by dt^2 / 12 times slope over mass, some thousandfold; what the second leaves is below the step's own error.
SWEEPS = 2


class Point(NamedTuple):
    """One end of a step.

    Attributes
    ----------
    d, v, a:
        Displacement (mm), velocity (mm/s) and acceleration (mm/s^2) of the wheel centre.
    compression:
        Of the tyre at the wheel centre, mm: displacement and runout.
    state:
        State of the law.
    a_before:
        Acceleration half a step before, mm/s^2, from which the next step's are first guessed.
    """

    d: Array
    v: Array
    a: Array
    compression: Array
    state: State
    a_before: Array


class Leg(NamedTuple):
    """What drives one step: its length (s), applied force (kN) and runout (mm) at its middle and its end."""

    dt: Array
    F_mid: Array
    F_end: Array
    r_mid: Array
    r_end: Array


def wheel_centre_per_flat(rig: Rig, compression_mm: ScalarLike) -> Array:
    """Return the force at the wheel centre for 1 kN on flat ground: Eq. 8 turned round."""
    return geometry.curvature_factor(rig) * jnp.asarray(geometry.sin_theta(rig, compression_mm))


def tyre_force(
    rig: Rig, law: StatefulLaw, state: State, compression_mm: Array, dt_s: Array, rate_mm_per_s: Array
) -> tuple[State, Array]:
    """Return the law's state and the force at the wheel centre, kN, after a monotone move to a compression, mm.

    The move takes the time `dt_s`, s; at its end the compression grows at the rate `rate_mm_per_s`.
    """

    def flat(compression: Array) -> Array:
        return jnp.asarray(geometry.flat_ground_displacement(rig, compression))

    d, rate = jax.jvp(flat, (compression_mm,), (rate_mm_per_s,))
    state, flat_kN = law.step_in(state, d, dt_s, rate)
    return state, flat_kN * wheel_centre_per_flat(rig, compression_mm)


def step(
    rig: Rig, law: StatefulLaw, mass: Array, c: Array, start: Point, leg: Leg
) -> tuple[Point, Float[Array, "2 4"]]:
    """Return the end of a step, and what the motion was at its middle and its end.

    Parameters
    ----------
    rig, law:
        Geometry and the tyre's law on flat ground.
    mass, c:
        kN s^2/mm and kN s/mm.
    start, leg:
        Where the step starts and what drives it.

    Returns
    -------
    The end point, and displacement (mm), velocity (mm/s), acceleration (mm/s^2) and tyre force (kN) at both nodes.
    """
    d, v, a, before, state, a_before = start
    dt = leg.dt
    a_mid, a_end = 2 * a - a_before, 3 * a - 2 * a_before
    for _ in range(SWEEPS):
        # The acceleration is the parabola through its three nodes; velocity and displacement are its integrals.
        v_mid = v + dt / 24 * (5 * a + 8 * a_mid - a_end)
        v_end = v + dt / 6 * (a + 4 * a_mid + a_end)
        d_mid = d + dt / 2 * v + dt**2 / 96 * (7 * a + 6 * a_mid - a_end)
        d_end = d + dt * v + dt**2 / 6 * (a + 2 * a_mid)
        middle, end = d_mid + leg.r_mid, d_end + leg.r_end
        state_end, F_mid, F_end = _through(rig, law, state, (before, middle, end), dt)
        a_mid = (leg.F_mid - F_mid - c * v_mid) / mass
        a_end = (leg.F_end - F_end - c * v_end) / mass
    nodes = jnp.stack([jnp.stack([d_mid, v_mid, a_mid, F_mid]), jnp.stack([d_end, v_end, a_end, F_end])])
    return Point(d_end, v_end, a_end, end, state_end, a_mid), nodes


def _through(
    rig: Rig, law: StatefulLaw, state: State, compressions: tuple[Array, Array, Array], dt: Array
) -> tuple[State, Array, Array]:
    """Return the state at the end, and the forces at the middle and the end, of a path that may turn on its way.

    Parameters
    ----------
    rig, law, state:
        Geometry, the tyre's law, and its state at the start.
    compressions:
        At start, middle and end, mm.
    dt:
        Time from start to end, s.
    """
    # The parabola through the three compressions turns at s steps; a law may only be taken along monotone moves.
    before, middle, end = compressions
    rise, bend = 4 * middle - 3 * before - end, 2 * (before - 2 * middle + end)
    safe_bend = jnp.where(bend == 0, 1.0, bend)
    s = jnp.where(bend == 0, -1.0, -rise / (2 * safe_bend))
    turn = before - rise**2 / (4 * safe_bend)
    early, late = (s > 0) & (s < 0.5), (s > 0.5) & (s < 1)

    def at(where: Array) -> tuple[Array, Array, Array]:
        """Return compression, steps gone and rate at the turn if it is there, else at the middle."""
        return jnp.where(where, turn, middle), jnp.where(where, s, 0.5), jnp.where(where, 0.0, (end - before) / dt)

    (e, first, rate), (e_second, second, rate_second) = at(early), at(late)
    state, F_first = tyre_force(rig, law, state, e, first * dt, rate)
    state, F_second = tyre_force(rig, law, state, e_second, (second - first) * dt, rate_second)
    state, F_end = tyre_force(rig, law, state, end, (1 - second) * dt, (rise + 2 * bend) / dt)
    return state, jnp.where(early, F_second, F_first), F_end
