"""What a tyre loses when it is moved up and down, at the wheel centre: energy, loss factor, equivalent damping."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

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

    energy_J: Float[Array, "*draws"]
    loss_factor: Float[Array, "*draws"]
    damping_kN_s_per_mm: Float[Array, "*draws"]
    separation_kN: Float[Array, "*draws"]


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


def losses_of_logs(
    rig: Rig, logs: Float[ArrayLike, "*draws 5"], displacement_mm: ScalarLike, amplitude_mm: ScalarLike
) -> Losses:
    """Return what a cycle loses by the logarithms of k, x, beta, m and c, such as a motion's estimate or its draws.

    Of the line through first touch (C) a motion says next to nothing, and it moves the geometry by tenths of a mm: it
    is taken as 0. c is not in what the tyre's law loses.

    Parameters
    ----------
    rig:
        Geometry.
    logs:
        Natural logarithms in the order of `motion_estimate.MOTION_PARAMETERS`, shape (..., 5).
    displacement_mm, amplitude_mm:
        The cycle's middle and half its stroke at the wheel centre, mm.

    Returns
    -------
    Shape (...) each.
    """
    logs = jnp.asarray(logs, float)

    def one(logs: Array) -> Losses:
        k, x, beta, m, _ = jnp.exp(logs)
        return losses(rig, Fancher(k=k, C=0.0, x=x, beta=beta), m, displacement_mm, amplitude_mm)

    flat = jax.vmap(one)(logs.reshape(-1, logs.shape[-1]))
    return Losses(*(values.reshape(logs.shape[:-1]) for values in flat))


def losses_moments(
    rig: Rig,
    log_mean: Float[ArrayLike, "5"],
    log_covariance: Float[ArrayLike, "5 5"],
    displacement_mm: ScalarLike,
    amplitude_mm: ScalarLike,
) -> tuple[Float[np.ndarray, "4"], Float[np.ndarray, "4 4"]]:
    """Return `Losses` at a mean of the logarithms, in its order, and their covariance to first order, in its units."""

    def stacked(logs: Array) -> Array:
        return jnp.stack(losses_of_logs(rig, logs, displacement_mm, amplitude_mm))

    mean = jnp.asarray(log_mean, float)
    jacobian = jax.jacfwd(stacked)(mean)
    return np.asarray(stacked(mean)), np.asarray(jacobian @ jnp.asarray(log_covariance) @ jacobian.T)
