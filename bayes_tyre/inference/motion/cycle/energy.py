"""Energy, loss factor and equivalent damping of a cycle at the wheel centre."""

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.laws import MotionLaw
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.laws.loop_energy import dissipated_energy_per_cycle, loop_energy
from bayes_tyre.laws.rigid_ring import RigidRing
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion_step import wheel_centre_per_flat
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

#: Strokes from the middle line before a numerical cycle is steady, and points of half a cycle.
WARM_UP_STROKES, HALF_CYCLE = 16, 96


class Losses(NamedTuple):
    """Losses of a cycle about a displacement, at the wheel centre, by the tyre's law.

    Attributes
    ----------
    energy_J:
        Dissipated a cycle, J = kN mm.
    loss_factor:
        Energy over 2 pi times k a^2 / 2, k the slope of the middle line at the wheel centre, a the amplitude.
    damping_kN_s_per_mm:
        Viscous damping with the same loss at that amplitude, at the mass's natural frequency on k.
    separation_kN:
        Distance of the settled branches on flat ground, 2 (x - k beta) of Fancher's law; 0 without friction.
    """

    energy_J: Float[Array, "*draws"]
    loss_factor: Float[Array, "*draws"]
    damping_kN_s_per_mm: Float[Array, "*draws"]
    separation_kN: Float[Array, "*draws"]


def losses(
    rig: Rig,
    law: Any,
    m_kg: ScalarLike,
    displacement_mm: ScalarLike,
    amplitude_mm: ScalarLike,
    c_kN_s_per_mm: ScalarLike = 0.0,
) -> Losses:
    """Return the losses of a cycle.

    Parameters
    ----------
    rig:
        Geometry.
    law:
        On flat ground, with a middle line k d + C.
    m_kg:
        Mass at the wheel centre, kg.
    displacement_mm:
        The cycle's middle at the wheel centre, mm.
    amplitude_mm:
        Half the stroke at the wheel centre, mm.
    c_kN_s_per_mm:
        Damping at the wheel centre that counts as a loss, at the mass's natural frequency on k.
    """
    d, a = jnp.asarray(displacement_mm, float), jnp.asarray(amplitude_mm, float)
    to_flat = partial(_to_flat, rig)
    # A force that depends on the displacement alone loses nothing. The factor from flat ground to the wheel centre is
    # taken at the middle of the stroke: its error is odd about it, to second order in the stroke.
    weight = wheel_centre_per_flat(rig, d) / jax.jvp(to_flat, (d,), (jnp.ones_like(d),))[1]
    slope = _slope(rig, law, d)
    omega = free_omega(rig, law, m_kg, d)
    energy = weight * _loss_on_flat(law, to_flat(d), stroke_on_flat(rig, d, a), omega)
    energy = energy + jnp.pi * jnp.asarray(c_kN_s_per_mm) * omega * a**2
    viscous = energy / (jnp.pi * omega * a**2)
    settled = jnp.subtract(law.x, jnp.multiply(law.k, law.beta)) if isinstance(law, Fancher) else _settled(law)
    return Losses(energy, energy / (jnp.pi * slope * a**2), viscous, 2 * settled)


def _to_flat(rig: Rig, d: Array) -> Array:
    return jnp.asarray(geometry.flat_ground_displacement(rig, d))


def _slope(rig: Rig, law: Any, d: Array) -> Array:
    """Return the slope of the middle line at the wheel centre, kN/mm."""

    def middle_line(d: Array) -> Array:
        return jnp.asarray(law.k * _to_flat(rig, d) + law.C) * wheel_centre_per_flat(rig, d)

    return jax.jvp(middle_line, (d,), (jnp.ones_like(d),))[1]


def stroke_on_flat(rig: Rig, d: Array, amplitude_mm: Array) -> Array:
    """Return half the stroke on flat ground, mm, of a cycle about a displacement at the wheel centre."""
    return (_to_flat(rig, d + amplitude_mm) - _to_flat(rig, d - amplitude_mm)) / 2


def free_omega(rig: Rig, law: Any, m_kg: ScalarLike, d: Array) -> Array:
    """Return the angular frequency, 1/s, at which the mass swings freely on k about a displacement, mm."""
    return jnp.sqrt(_slope(rig, law, d) / (jnp.asarray(m_kg) * KN_PER_KG_MM_PER_S2))


def _settled(law: Any) -> Array:
    return jnp.asarray(getattr(law, "settled", 0.0), float)


def _loss_on_flat(law: Any, middle_mm: Array, stroke_mm: Array, omega: Array) -> Array:
    """Return the loss of a cycle on flat ground, J, by the law alone, at an angular frequency."""
    if isinstance(law, Fancher):
        return dissipated_energy_per_cycle(k=law.k, x=law.x, beta=law.beta, amplitude=stroke_mm)
    if isinstance(law, KelvinVoigt):
        return jnp.zeros(())
    if isinstance(law, RigidRing):
        return jnp.pi * stroke_mm**2 * jnp.imag(law.dynamic_stiffness(omega))
    return steady_loss(law, middle_mm, stroke_mm)


def steady_loss(law: Any, middle_mm: Array, stroke_mm: Array) -> Array:
    """Return the steady loss of a cycle of any rate-independent law on flat ground, J.

    It agrees with the closed form of `Fancher` to 4e-4 for amplitudes from beta / 2. Arguments as in `steady_cycle`.
    """
    return loop_energy(*steady_cycle(law, middle_mm, stroke_mm))


def steady_cycle(
    law: Any, middle_mm: Array, stroke_mm: Array
) -> tuple[Float[Array, " points"], Float[Array, " points"]]:
    """Return displacement, mm, and force off the middle line, kN, of a steady cycle of a rate-independent law.

    Some strokes from the middle line remove the influence of the start; then a cycle with points close together where
    it turns.

    Parameters
    ----------
    law:
        With a middle line k d + C, which loses nothing and is omitted from the force.
    middle_mm, stroke_mm:
        Middle of the cycle and half its stroke, mm, on flat ground.
    """
    bare = replace(law, k=0.0, C=0.0)
    ends = middle_mm + stroke_mm * jnp.where(jnp.arange(WARM_UP_STROKES) % 2 == 0, 1.0, -1.0)
    start = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), bare.init(middle_mm - stroke_mm, jnp.zeros(())))
    state, _ = jax.lax.scan(lambda state, d: (bare.step(state, d)[0], None), start, ends)
    cycle = middle_mm - stroke_mm * jnp.cos(jnp.linspace(0.0, 2 * jnp.pi, 2 * HALF_CYCLE + 1))
    return cycle, jax.lax.scan(lambda state, d: bare.step(state, d), state, cycle)[1]


def losses_from_reported(
    rig: Rig, law: MotionLaw, values: Float[Array, " p"], displacement_mm: ScalarLike, amplitude_mm: ScalarLike
) -> Losses:
    """Return the losses of a cycle from a law's `reported_parameters`, with C = 0; other arguments as in `losses`.

    For a law with friction only the friction counts. For one without (Kelvin-Voigt, rigid ring) the damper belongs to
    the tyre and is included, at the mass's natural frequency on k.
    """
    m, c = values[-2], values[-1]
    return losses(rig, law.from_reported(values), m, displacement_mm, amplitude_mm, 0.0 if law.has_friction else c)
