"""The load's departure from the shape of its step (`load_step`), by the load cell's own readings.

A step in two stages has no place in the family of shapes, and the motion would take it up. The departure is a normal
process (`matern_process`) beside the shape, its size estimated from the load cell alone, before anything else is
fitted. Where the readings ask for one, the first fit of the motion takes the cell's estimate of it; later ones
integrate it out, together with road and force (`window_fit`). What moves with the accelerometer is the inertia of a
mass on the cell, and no departure.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.disturbance.matern_process import (
    LEAST_ODDS,
    correlation_factors,
    knots_from,
    log_prior_of_size,
    sizes_and_penalties,
)
from bayes_tyre.inference.motion.record.disturbance.response import (
    Columns,
    conditional,
    fixed,
    log_evidence,
    most_probable,
)
from bayes_tyre.inference.motion.record.model.forward_model import block_means, cylinder_load, node_times
from bayes_tyre.inference.motion.record.model.load_ringing import ringing_priors
from bayes_tyre.inference.motion.record.model.parameters import parameter_names
from bayes_tyre.inference.motion.record.model.window import Disturbance, Window
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.rig.axle import Rig

#: The parameters that the load cell reads.
LOAD_PARAMETERS = (
    *("load_before_kN", "load_after_kN", "ramp_start_s", "log_rise"),
    *("shape_bend_onset", "shape_bend_end", "shape_even", "shape_odd"),
)
#: Frequencies, Hz, from which that of a load that rings is looked for.
START_RINGING_HZ = (7.0, 12.0, 20.0, 35.0)
#: Standard deviation of the mass between load cell and axle, kg: the cell reads its inertia, which is no load.
CELL_KG = 10.0
#: The departure's standard deviation falls by a factor of e in one of these after the step's end, s: a load settles.
SETTLES_S = (0.01, 0.03, 0.1)
_STEPS, _TOLERANCE = 100, 1e-6
# The response to nothing at all is not a number.
_SIZE_OF_NONE = 1e-9


class LoadDeparture(NamedTuple):
    """What the load cell says of the load's shape.

    Attributes
    ----------
    size:
        Standard deviation of the departure, as a share of the load's step; 0: the readings do not ask for one.
    standard:
        Standardised parameters, those of the load as the cell says and the others 0, shape (parameters,).
    columns:
        Of the departure's disturbance, with weights of standard deviation 1, shape (knots, nodes).
    weights:
        Their estimate, shape (knots,).
    log_evidence:
        Log density of the load cell's readings, shape and departure integrated out, but for constants of their noise.
    """

    size: Float[Array, ""]
    standard: Float[Array, " parameters"]
    columns: Disturbance
    weights: Float[Array, " knots"]
    log_evidence: Float[Array, ""]


@functools.partial(jax.jit, static_argnums=0)
def load_departure(rig: Rig, window: Window, odds: ScalarLike = LEAST_ODDS) -> LoadDeparture:
    """Return the load's departure from the shape of its step, by restricted maximum likelihood from the load cell.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    odds:
        How many times as probable as none a departure has to be.
    """
    residual, values, parameters = _fitted_shape(rig, window)
    weight, node_weights = window.weight[2], jnp.asarray(window.node_weights)
    shape = window.in_units(rig, parameters(values))
    knots = knots_from(window, shape.start_s)
    after_s = jnp.maximum(knots.time_s - shape.start_s - shape.rise_s, 0.0)
    step_kN = jnp.abs(shape.load_kN[1] - shape.load_kN[0])
    sds = step_kN * jnp.exp(-after_s / jnp.array(SETTLES_S)[:, None])
    factors = (sds[:, None, :, None] * correlation_factors(knots)).reshape(-1, len(after_s), len(after_s))
    none = jnp.zeros_like(knots.functions)
    among = Columns(Disturbance(none, none, knots.functions), factors, *sizes_and_penalties(odds))
    responses = weight[:, None] * block_means(knots.functions, node_weights).T
    jacobian = jax.jacfwd(residual)(values)
    _, needed = most_probable(among, responses, residual(values), jacobian)
    # The mass only keeps what it explains from asking for a departure; where there is one, it takes up all.
    left, jacobian = residual(values.at[-1].set(0.0)), jacobian[:, :-1]
    factor, size = most_probable(among, responses, left, jacobian)
    size = jnp.where(needed > 0, size, 0.0)
    unit = Disturbance(none, none, size * factor.T @ knots.functions)
    moved = responses @ (jnp.maximum(size, _SIZE_OF_NONE) * factor)
    evidence = log_evidence(moved, left, jacobian) + log_prior_of_size(size, odds)
    together = conditional(moved, left, jacobian)
    moved_values = values.at[:-1].add(together.step)
    return LoadDeparture(size, parameters(moved_values), unit, together.weights, evidence)


def _fitted_shape(rig: Rig, window: Window) -> tuple[Callable[[Array], Array], Array, Callable[[Array], Array]]:
    """Return the load cell's residuals as a function, their least-squares values, and what makes parameters of values.

    The values are `LOAD_PARAMETERS` and those of a load that rings, standardised, and the mass on the cell in units of
    `CELL_KG`.
    """
    names, time_s = parameter_names(window.law), node_times(window)
    at = jnp.array([*(names.index(name) for name in LOAD_PARAMETERS), *window.ringing_at])

    def parameters(values: Array) -> Array:
        return jnp.zeros(window.prior.shape[-1]).at[at].set(values[:-1])

    def residual(values: Array) -> Array:
        load = cylinder_load(window.in_units(rig, parameters(values)), time_s)
        inertia_kN = values[-1] * CELL_KG * 1e-3 * window.readings[0]
        read = block_means(load[None], jnp.asarray(window.node_weights))[0] + inertia_kN
        return jnp.concatenate([(read - window.readings[2]) * window.weight[2], values])

    solver = optx.LevenbergMarquardt(_TOLERANCE, _TOLERANCE, linear_solver=lx.Normal(lx.Cholesky()))

    def fitted(start: Array) -> tuple[Array, Array]:
        values = optx.least_squares(lambda y, _: residual(y), solver, start, max_steps=_STEPS, throw=False).value
        return values, jnp.sum(residual(values) ** 2)

    starts = jnp.zeros((len(START_RINGING_HZ) if window.ringing_at else 1, len(at) + 1))
    if window.ringing_at:
        mean, sd = ringing_priors()[:, 0]
        starts = starts.at[:, len(LOAD_PARAMETERS)].set((np.log(START_RINGING_HZ) - mean) / sd)
    ends, objectives = jax.vmap(fitted)(starts)
    values = ends[jnp.argmin(jnp.where(jnp.isfinite(objectives), objectives, jnp.inf))]
    return residual, values, parameters


def with_load_departure(window: Window, departure: LoadDeparture) -> Window:
    """Return the window with the load cell's estimate of the departure as a known disturbance."""
    mean = jax.tree.map(lambda columns: departure.weights @ columns, departure.columns)
    return window._replace(disturbance=fixed(window, mean, departure.weights, departure.size))
