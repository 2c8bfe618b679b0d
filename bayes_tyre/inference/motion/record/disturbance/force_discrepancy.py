"""The force that load and law leave out of a record, as a random disturbance.

Rubber that relaxes, friction that falls with speed, stiffness that grows: each is a small force that the model has not,
and where it is left out, k, x and beta take it up and their intervals do not show it. Here it is a normal process
(`matern_process`), larger while the tyre moves, integrated out (`response`). Its size is estimated with a prior that
shrinks it: to exactly zero where the readings do not ask for it. A force slower than the ringing is the same as k or x;
correlation times end before.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.disturbance.matern_process import (
    correlation_factors,
    knots_from,
    sizes_and_penalties,
)
from bayes_tyre.inference.motion.record.disturbance.response import Columns
from bayes_tyre.inference.motion.record.model.forward_model import node_times, simulated
from bayes_tyre.inference.motion.record.model.parameters import MotionParameters
from bayes_tyre.inference.motion.record.model.window import Disturbance, Window
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig

#: Standard deviation of the force at rest as a share of that while the tyre moves fastest; width over which the speed
#: is averaged, s.
AT_REST, SPEED_WIDTH_S = 0.15, 0.01


@functools.partial(jax.jit, static_argnums=0)
def force_columns(rig: Rig, window: Window, standard: Float[Array, " parameters"]) -> Columns:
    """Return the columns of the force, a knot each; sizes are shares of the load's step while the tyre moves fastest.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    standard:
        Standardised parameters near the MAP estimate.
    """
    parameters = window.in_units(rig, standard)
    knots = knots_from(window, parameters.start_s)
    _, motion, _ = simulated(rig, parameters, window, window.mean_disturbance)
    near = jnp.exp(-0.5 * ((knots.time_s[:, None] - node_times(window)) / SPEED_WIDTH_S) ** 2)
    speed = jnp.sqrt(near @ motion.velocity_mm_per_s**2 / jnp.sum(near, axis=1))
    sd = load_step_kN(rig, parameters) * jnp.sqrt(AT_REST**2 + (speed / jnp.max(speed)) ** 2)
    none = jnp.zeros_like(knots.functions)
    return Columns(
        Disturbance(none, knots.functions, none), sd[:, None] * correlation_factors(knots), *sizes_and_penalties()
    )


def load_step_kN(rig: Rig, parameters: MotionParameters) -> Array:
    """Return the size of a load's step at the wheel centre, kN."""
    before, after = geometry.tyre_load(rig, parameters.load_kN)
    return jnp.abs(after - before)
