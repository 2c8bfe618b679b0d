"""What a motion's unknowns predict: the readings of accelerometer, laser and load cell in a window."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion_load import load_share
from bayes_tyre.inference.motion_unknowns import Unknowns, in_units
from bayes_tyre.inference.motion_window import Window
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import Body, Drive, Motion, Start, move, rest_displacement


def simulated(rig: Rig, unknowns: Unknowns, block_s: Array, blocks: int, substeps: int) -> tuple[Drive, Motion]:
    """Return drive and motion from rest through a window; time starts with it.

    Parameters
    ----------
    rig:
        Geometry; static.
    unknowns:
        In units.
    block_s:
        Time of a block, s.
    blocks, substeps:
        Blocks in the window, and steps of the integration in a block.
    """
    time_s = jnp.arange(2 * substeps * blocks + 1) * (block_s / (2 * substeps))
    load_kN = cylinder_load(unknowns, time_s)
    drive = Drive(time_s, geometry.tyre_load(rig, load_kN), jnp.zeros_like(time_s))
    law = unknowns.law
    at_rest = rest_displacement(
        rig, jnp.asarray(drive.applied_kN)[0], k=law.k, offset_kN=jnp.add(law.C, unknowns.rest_friction_kN)
    )
    motion = move(rig, Body(law, unknowns.m_kg, unknowns.c_kN_s_per_mm), drive, Start(at_rest))
    return drive, motion


def cylinder_load(unknowns: Unknowns, time_s: Float[Array, " times"]) -> Float[Array, " times"]:
    """Return the cylinder's force, kN, at times from the start of the window, s."""
    before, after = unknowns.load_kN
    return before + (after - before) * load_share(time_s, unknowns.start_s, unknowns.rise_s, unknowns.shape)


def predicted(rig: Rig, unknowns: Unknowns, window: Window) -> Float[Array, "3 blocks"]:
    """Return the block means that the sensors would read without noise: m/s^2 (up), mm, kN of the cylinder."""
    blocks = window.readings.shape[-1]
    substeps = (window.node_weights.shape[-1] - 1) // 2
    _, motion = simulated(rig, unknowns, jnp.asarray(window.block_s), blocks, substeps)
    time_s = jnp.arange(2 * substeps * blocks + 1) * (window.block_s / (2 * substeps))
    lever = 1.0 / float(geometry.wheel_centre_displacement(rig, 1.0))
    d = motion.displacement_mm
    readings = jnp.stack(
        [
            unknowns.acceleration_m_per_s2 - lever * motion.acceleration_m_per_s2,
            unknowns.laser_mm + lever * (d - d[0]),
            cylinder_load(unknowns, time_s),
        ]
    )
    return block_means(readings, jnp.asarray(window.node_weights))


def block_means(nodes: Float[Array, "channels nodes"], weights: Float[Array, " per_block"]) -> Array:
    """Return means of blocks, shape (channels, blocks), by `motion_window.block_weights` of their nodes."""
    per_block = weights.shape[0] - 1
    inner = nodes[:, :-1].reshape(nodes.shape[0], -1, per_block)
    return inner @ weights[:-1] + nodes[:, per_block::per_block] * weights[-1]


def residuals(rig: Rig, standard: Float[Array, " unknowns"], window: Window) -> Float[Array, " residuals"]:
    """Return what the readings differ by, in standard deviations, and then the unknowns, whose prior is normal(0, 1).

    Half their sum of squares is the negative log posterior density but for a constant.
    """
    unknowns = in_units(rig, standard, jnp.asarray(window.prior))
    off = (predicted(rig, unknowns, window) - window.readings) * window.weight
    return jnp.concatenate([off.ravel(), standard])
