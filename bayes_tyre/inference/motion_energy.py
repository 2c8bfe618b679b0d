"""What a tyre loses when it is moved up and down, at the wheel centre: energy, loss factor, equivalent damping."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.laws.fancher import Fancher, dissipated_energy_per_cycle
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import KN_PER_KG_MM_PER_S2
from bayes_tyre.rig.motion_step import wheel_centre_per_flat


class Losses(NamedTuple):
    """Of a cycle about a displacement, at the wheel centre, by the tyre's law; viscous damping is not in it.

    Attributes
    ----------
    energy_J:
        Dissipated a cycle, J = kN mm.
    loss_factor:
        Energy over 2 pi times k a^2 / 2, k the slope of the middle line at the wheel centre, a the amplitude.
    damping_kN_s_per_mm:
        Viscous damping that loses as much at that amplitude, at the mass's natural frequency on k.
    separation_kN:
        Distance of the settled branches, 2 (x - k beta), on flat ground.
    """

    energy_J: Float[Array, ""]
    loss_factor: Float[Array, ""]
    damping_kN_s_per_mm: Float[Array, ""]
    separation_kN: Float[Array, ""]


def losses(rig: Rig, law: Fancher, m_kg: ScalarLike, displacement_mm: ScalarLike, amplitude_mm: ScalarLike) -> Losses:
    """Return what a cycle loses.

    Parameters
    ----------
    rig:
        Geometry.
    law:
        On flat ground.
    m_kg:
        Mass at the wheel centre, kg.
    displacement_mm:
        The cycle's middle at the wheel centre, mm.
    amplitude_mm:
        Half the stroke at the wheel centre, mm.
    """
    d, a = jnp.asarray(displacement_mm, float), jnp.asarray(amplitude_mm, float)

    def flat(d: Array) -> Array:
        return jnp.asarray(geometry.flat_ground_displacement(rig, d))

    def middle_line(d: Array) -> Array:
        return jnp.asarray(law.k * flat(d) + law.C) * wheel_centre_per_flat(rig, d)

    # What depends on the displacement alone loses nothing. Of the friction's work the weight from flat ground to the
    # wheel centre is taken at the middle: it is odd about it, to second order in the stroke.
    stroke = (flat(d + a) - flat(d - a)) / 2
    weight = wheel_centre_per_flat(rig, d) / jax.jvp(flat, (d,), (jnp.ones_like(d),))[1]
    energy = weight * dissipated_energy_per_cycle(k=law.k, x=law.x, beta=law.beta, amplitude=stroke)
    slope = jax.jvp(middle_line, (d,), (jnp.ones_like(d),))[1]
    omega = jnp.sqrt(slope / (jnp.asarray(m_kg) * KN_PER_KG_MM_PER_S2))
    viscous = energy / (jnp.pi * omega * a**2)
    settled = jnp.subtract(law.x, jnp.multiply(law.k, law.beta))
    return Losses(energy, energy / (jnp.pi * slope * a**2), viscous, 2 * settled)
