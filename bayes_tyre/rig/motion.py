"""The axle's mass moving on a tyre: from the force applied at the wheel centre to displacement and acceleration.

``m d'' = F_applied(t) - F_tyre(d, history) - c d'``, down positive, at the wheel centre. A tyre's law holds on flat
ground, so F_tyre is its force at Eq. 7's displacement, taken back to the wheel centre through Eq. 8.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.laws.base import ScalarLike, StatefulLaw
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion_step import Leg, Point, step, wheel_centre_per_flat
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

#: Longest step of the integration unless told otherwise; `move` says what error it leaves.
MAX_STEP_S = 2e-4


class Body(eqx.Module):
    """What moves: a mass on a tyre, with viscous damping.

    Attributes
    ----------
    law:
        The tyre's force on flat ground, kN over mm: any law with state.
    m_kg:
        Effective mass at the wheel centre, kg.
    c_kN_s_per_mm:
        Viscous damping at the wheel centre, kN s/mm.
    """

    law: StatefulLaw
    m_kg: ScalarLike
    c_kN_s_per_mm: ScalarLike


class Drive(eqx.Module):
    """What drives it, at the nodes of the integration (`node_times`), shape (nodes,).

    Attributes
    ----------
    time_s:
        Times of the nodes, s.
    applied_kN:
        Force applied at the wheel centre, kN: `geometry.tyre_load` of the cylinder's force.
    runout_mm:
        Displacement of the ground under the tyre, mm, positive where it compresses the tyre.
    """

    time_s: Float[ArrayLike, " nodes"]
    applied_kN: Float[ArrayLike, " nodes"]
    runout_mm: Float[ArrayLike, " nodes"]


class Start(eqx.Module):
    """Where the motion starts, at the wheel centre.

    Attributes
    ----------
    displacement_mm:
        Displacement since first touch, mm (`rest_displacement`).
    velocity_mm_per_s:
        Velocity, mm/s, down positive.
    tyre_force_kN:
        Force of the tyre, kN; None: what is applied at that moment, so that a body at rest stays at rest.
    """

    displacement_mm: ScalarLike
    velocity_mm_per_s: ScalarLike = 0.0
    tyre_force_kN: ScalarLike | None = None


class Motion(eqx.Module):
    """The motion of the wheel centre, down positive, at the nodes, shape (nodes,)."""

    displacement_mm: Float[Array, " nodes"]
    velocity_mm_per_s: Float[Array, " nodes"]
    acceleration_m_per_s2: Float[Array, " nodes"]
    tyre_force_kN: Float[Array, " nodes"]

    def at_samples(self, substeps: int) -> "Motion":
        """Return the motion at the sampling times that `node_times` was given."""
        return jax.tree.map(lambda values: values[:: 2 * substeps], self)


def substeps_for(dt_s: float, max_step_s: float = MAX_STEP_S) -> int:
    """Return into how many steps a sampling interval `dt_s` is cut, so that none is longer than `max_step_s` (s)."""
    return max(1, int(np.ceil(dt_s / max_step_s - 1e-9)))


def node_times(time_s: Float[np.ndarray, " samples"], substeps: int) -> Float[np.ndarray, " nodes"]:
    """Return the times, s, at which the drive is needed: the ends and the middle of every step.

    Parameters
    ----------
    time_s:
        Sampling times, s, shape (samples,).
    substeps:
        Steps between two samples (`substeps_for`).

    Returns
    -------
    Shape (nodes,), nodes = 2 substeps (samples - 1) + 1.
    """
    parts = 2 * substeps
    within = time_s[:-1, None] + np.diff(time_s)[:, None] * (np.arange(parts) / parts)
    return np.append(within.ravel(), time_s[-1:])


def rest_displacement(rig: Rig, force_kN: ScalarLike, *, k: ScalarLike, offset_kN: ScalarLike = 0.0) -> Array:
    """Return the displacement (mm) at which a tyre on the flat-ground line ``k d + offset`` carries a force at rest.

    Parameters
    ----------
    rig:
        Radii and half spacing.
    force_kN:
        Force at the wheel centre, kN.
    k, offset_kN:
        Slope, kN/mm, and force at zero displacement, kN, of the line; for `Fancher` at rest the offset is C plus a
        friction between -(x - k beta) and x - k beta.

    Returns
    -------
    Displacement at the wheel centre, mm; NaN or far off where no displacement between the rollers carries the force.
    """

    def surplus(d: Array) -> Array:
        flat_kN = jnp.multiply(k, geometry.flat_ground_displacement(rig, d)) + offset_kN
        return jnp.subtract(flat_kN * wheel_centre_per_flat(rig, d), force_kN)

    def newton(_: object, d: Array) -> Array:
        value, slope = jax.jvp(surplus, (d,), (jnp.ones_like(d),))
        return d - value / slope

    # The line alone is a first guess to some 20 %; the error is squared each time. A fixed number can be traced.
    guess = jnp.asarray(jnp.subtract(force_kN, offset_kN) / jnp.multiply(k, geometry.curvature_factor(rig)), float)
    return jax.lax.fori_loop(0, 12, newton, guess)


def move(rig: Rig, body: Body, drive: Drive, start: Start) -> Motion:
    """Return the motion of a body under a drive.

    Lobatto's three-point collocation (fourth order) on the ends and the middle of each step; the law itself is exact
    along the path, and where a path turns inside a step the law goes to the turning point first. On 10 kN steps, still
    and rolling, with beta from 0.01 mm: sampled at 1, 5 and 10 kHz (steps of 0.2, 0.2 and 0.1 ms) the motion is the
    same to 2e-6 mm and 3e-5 m/s^2, and energies close to 3e-9 of the work applied. Can be jitted (the rig held
    fixed), vmapped, and differentiated forward.

    Parameters
    ----------
    rig:
        Radii and half spacing.
    body:
        Law, mass and damping.
    drive:
        Applied force and runout at the nodes.
    start:
        Displacement, velocity and force at the first node.

    Returns
    -------
    The motion at the nodes. A law that pulls (negative force) is not stopped: look for a tyre that lifts off.

    Raises
    ------
    ValueError
        If the law makes energy (`StatefulLaw.check`). Under jit its parameters are not known: there a
        parametrisation has to see to it.
    RuntimeError
        If JAX is not set to float64.
    """
    if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(body)):
        body.law.check()
    F, r = jnp.asarray(drive.applied_kN, float), jnp.asarray(drive.runout_mm, float)
    if F.dtype != jnp.float64:
        raise RuntimeError("the motion needs float64: call bayes_tyre.runtime.prepare_jax first")
    mass, c = jnp.asarray(body.m_kg, float) * KN_PER_KG_MM_PER_S2, jnp.asarray(body.c_kN_s_per_mm, float)
    d, v = jnp.asarray(start.displacement_mm, float), jnp.asarray(start.velocity_mm_per_s, float)
    F_tyre = jnp.asarray(F[0] if start.tyre_force_kN is None else start.tyre_force_kN, float)
    compression = d + r[0]
    flat = geometry.flat_ground_displacement(rig, compression)
    state = body.law.init(flat, F_tyre / wheel_centre_per_flat(rig, compression))
    state = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), state)
    a = (F[0] - F_tyre - c * v) / mass
    legs = Leg(jnp.diff(jnp.asarray(drive.time_s, float)[::2]), F[1::2], F[2::2], r[1::2], r[2::2])
    point = Point(d, v, a, compression, state, a_before=a)
    _, nodes = jax.lax.scan(lambda point, leg: step(rig, body.law, mass, c, point, leg), point, legs)
    first = jnp.stack([d, v, a, F_tyre])
    d, v, a, F_tyre = jnp.concatenate([first[None], nodes.reshape(-1, 4)]).T
    return Motion(d, v, a * 1e-3, F_tyre)
