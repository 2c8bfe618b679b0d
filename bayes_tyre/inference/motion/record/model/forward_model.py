"""The forward model: from a motion's parameters to the readings of accelerometer, laser and load cell."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.model.load_ringing import ringing_share
from bayes_tyre.inference.motion.record.model.load_step import load_share
from bayes_tyre.inference.motion.record.model.parameters import MotionParameters
from bayes_tyre.inference.motion.record.model.second_mode import shown_with
from bayes_tyre.inference.motion.record.model.window import UNDISTURBED, Disturbance, Window
from bayes_tyre.laws.base import ScalarLike, StatefulLaw
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import Body, Drive, Motion, Start, move, rest_displacement
from bayes_tyre.rig.motion_step import wheel_centre_per_flat


def simulated(
    rig: Rig, parameters: MotionParameters, window: Window, disturbance: Disturbance = UNDISTURBED
) -> tuple[Drive, Motion, Array]:
    """Return drive and motion through a window, and the displacement, mm, at which the laser reads its level.

    Parameters
    ----------
    rig:
        Geometry; static.
    parameters:
        In physical units.
    window:
        Of the record, with which time starts.
    disturbance:
        In addition to load and runout.
    """
    time_s = node_times(window)
    F = jnp.asarray(geometry.tyre_load(rig, cylinder_load(parameters, time_s) + disturbance.load_kN))
    ground = parameters.ground
    runout = jnp.zeros_like(time_s) if ground is None else ground.displacement_mm(time_s)
    drive = Drive(time_s, F + disturbance.force_kN, runout + disturbance.road_mm)
    law = parameters.law
    if ground is None or window.rolling is None:
        level = rest_displacement(rig, F[0], k=law.k, offset_kN=jnp.add(law.C, parameters.rest_friction_kN))
        start = Start(level)
    else:
        level = rest_displacement(rig, F[0], k=law.k, offset_kN=law.C)
        read = (window.rolling.start_laser_mm - parameters.laser_mm) / lever(rig)
        late = parameters.laser_delay_s * jnp.asarray(ground.start_velocity_mm_per_s)
        d = level + read + late + ground.start_offset_mm
        compression = d + jnp.asarray(drive.runout_mm)[0]
        flat = law.k * geometry.flat_ground_displacement(rig, compression) + law.C + parameters.rest_friction_kN
        start = Start(d, ground.start_velocity_mm_per_s, flat * wheel_centre_per_flat(rig, compression))
    return (
        drive,
        move(rig, Body(law, axle_kg(rig, law, parameters.m_kg), parameters.c_kN_s_per_mm), drive, start),
        level,
    )


def axle_kg(rig: Rig, law: StatefulLaw, m_kg: ScalarLike) -> Array:
    """Return the mass at the wheel centre, kg, beside what a law carries along itself.

    In every law m is all that moves slowly: so it means the same, and a record tells it as well. Where the law's own
    mass were nearly all of that, a twentieth is left.
    """
    # Some 10 mm down: what rollers make of flat ground differs little about it.
    at_wheel_centre = geometry.curvature_factor(rig) * float(geometry.sin_theta(rig, 10.0)) ** 2
    return jnp.maximum(jnp.subtract(m_kg, at_wheel_centre * jnp.asarray(law.carried_kg)), 0.05 * jnp.asarray(m_kg))


def lever(rig: Rig) -> float:
    """Return the movement at the measurement point for one at the wheel centre."""
    return 1.0 / float(geometry.wheel_centre_displacement(rig, 1.0))


def node_times(window: Window) -> Float[Array, " nodes"]:
    """Return the times of the integration's nodes, s from the window's start."""
    per_block = window.node_weights.shape[-1] - 1
    return jnp.arange(per_block * window.readings.shape[-1] + 1) * (window.block_s / per_block)


def cylinder_load(parameters: MotionParameters, time_s: Float[Array, " times"]) -> Float[Array, " times"]:
    """Return the cylinder's force, kN, at evenly spaced times from the start of the window, s, before its step on."""
    before, after = parameters.load_kN
    share = load_share(time_s, parameters.start_s, parameters.rise_s, parameters.shape)
    if parameters.ringing is not None:
        share = share + ringing_share(parameters.ringing, share, time_s[1] - time_s[0])
    return before + (after - before) * share


def predicted(
    rig: Rig, parameters: MotionParameters, window: Window, disturbance: Disturbance = UNDISTURBED
) -> Float[Array, "3 blocks"]:
    """Return the block means that the sensors would read without noise: m/s^2 (up), mm, kN of the cylinder."""
    drive, motion, level = simulated(rig, parameters, window, disturbance)
    time_s = jnp.asarray(drive.time_s)
    if parameters.mode is not None:
        motion = shown_with(parameters.mode, motion, time_s[1])
    readings = jnp.stack(
        [
            parameters.acceleration_m_per_s2 - lever(rig) * motion.acceleration_m_per_s2,
            parameters.laser_mm + lever(rig) * (_shown_late(motion, parameters.laser_delay_s) - level),
            _load_shown_late(parameters, time_s, jnp.asarray(disturbance.load_kN)),
        ]
    )
    return block_means(readings, jnp.asarray(window.node_weights))


def _load_shown_late(
    parameters: MotionParameters, time_s: Float[Array, " nodes"], departure_kN: Float[Array, "*nodes"]
) -> Float[Array, " nodes"]:
    """Return the load, kN, that a load cell shows which is late: its step exactly, the departure to first order."""
    step = cylinder_load(parameters, time_s - parameters.load_delay_s)
    if not departure_kN.ndim:
        return step + departure_kN
    return step + departure_kN - parameters.load_delay_s * jnp.asarray(jnp.gradient(departure_kN)) / time_s[1]


def _shown_late(motion: Motion, delay_s: ScalarLike) -> Float[Array, " nodes"]:
    """Return the displacement, mm, that a laser shows which is late by less than a tenth of the ringing's period.

    To second order in the delay T: what is only late shows T^2 / 2 of the acceleration, a first-order lag T^2; what
    averages and filters lies between.
    """
    acceleration_mm_per_s2 = 1e3 * motion.acceleration_m_per_s2
    return motion.displacement_mm - delay_s * motion.velocity_mm_per_s + 0.75 * delay_s**2 * acceleration_mm_per_s2


def block_means(nodes: Float[Array, "channels nodes"], weights: Float[Array, " per_block"]) -> Array:
    """Return means of blocks, shape (channels, blocks), by `window.block_weights` of their nodes."""
    per_block = weights.shape[0] - 1
    inner = nodes[:, :-1].reshape(nodes.shape[0], -1, per_block)
    return inner @ weights[:-1] + nodes[:, per_block::per_block] * weights[-1]


def residuals(rig: Rig, standard: Float[Array, " parameters"], window: Window) -> Float[Array, " residuals"]:
    """Return the residuals of the readings, in standard deviations, followed by the standardised parameters.

    Half their sum of squares is the negative log posterior density but for a constant.
    """
    random = window.disturbance
    if random is None:
        return jnp.concatenate([misfit(rig, standard, window).ravel(), standard])
    difference = (misfit(rig, standard, window, random.mean) - random.response).ravel()
    # The directions that the disturbance explains are scaled to unit variance: noise and it together are white.
    difference = difference - random.directions @ (random.shrink * (difference @ random.directions))
    return jnp.concatenate([difference, standard])


def misfit(
    rig: Rig, standard: Float[Array, " parameters"], window: Window, disturbance: Disturbance = UNDISTURBED
) -> Float[Array, "3 blocks"]:
    """Return predictions less readings, in standard deviations of their noise; the accelerometer's are whitened."""
    parameters = window.in_units(rig, standard)
    difference = (predicted(rig, parameters, window, disturbance) - window.readings) * window.weight
    if window.disturbance is None or window.disturbance.whitening is None:
        return difference
    return difference.at[0].set(window.disturbance.whitening @ difference[0])
