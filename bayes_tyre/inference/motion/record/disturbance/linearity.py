"""Whether the readings' response to a load's departure is as linear as integrating it out takes it to be (`response`).

Friction's is not quite, and where the load departs far from its shape k, x and beta may be off by more than their
intervals say. So departures are drawn as the linear response has them, and the exact density is held against it.
It is not asked of roads: with a linear response to these, intervals of rolling records hold (docs/validation.md).
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.model.forward_model import misfit, residuals
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.rig.axle import Rig

#: Draws that are looked at: the error of a standard deviation by so many is a tenth of it.
DRAWS = 50


def linear_response_error(
    rig: Rig,
    window: Window,
    standard: Float[np.ndarray, "draws parameters"],
    weights: Float[np.ndarray, " draws"],
) -> float:
    """Return the standard deviation, over the posterior, of the log density's error by a linear response.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record; where its load does not depart the error is 0, and infinite where a density is not a number.
    standard, weights:
        Weighted draws of the standardised parameters.
    """
    if window.disturbance is None or not np.asarray(window.disturbance.load_size) > 0:
        return 0.0
    rng = np.random.default_rng(0)
    drawn = standard[rng.choice(len(weights), DRAWS, p=weights)]
    normals = rng.standard_normal((DRAWS, window.disturbance.shrink.shape[-1]))
    errors = np.asarray(_log_density_errors(rig, window, drawn, normals))
    return float(np.std(errors)) if np.isfinite(errors).all() else float("inf")


@functools.partial(jax.jit, static_argnums=0)
def _log_density_errors(rig: Rig, window: Window, standard: Array, normals: Array) -> Float[Array, " draws"]:
    def error(standard: Array, normals: Array) -> Array:
        linear = 0.5 * jnp.sum(residuals(rig, standard, window) ** 2)
        return exact_height(rig, standard, window, normals) - linear

    return jax.vmap(error)(standard, normals)


def exact_height(
    rig: Rig, standard: Float[Array, " parameters"], window: Window, normals: Float[Array, " directions"]
) -> Float[Array, ""]:
    """Return the negative log density of parameters and a drawn disturbance, less that of the draw, but for a constant.

    Where the response is linear this is half the sum of squares of `forward_model.residuals`, whatever the draw.

    Parameters
    ----------
    rig:
        Geometry; static.
    standard:
        Standardised parameters.
    window:
        Of the record, with a random disturbance.
    normals:
        Normal(0, 1) numbers from which the disturbance is drawn, given the readings and a linear response.
    """
    random = window.disturbance
    assert random is not None
    estimate = random.along_weights
    assert estimate is not None
    sd = 1 - random.shrink  # of a weight, given the readings
    response = jnp.sqrt(jnp.maximum(sd**-2 - 1, 0.0))

    def misfits(weights: Array) -> Array:
        off = weights - estimate
        moved = jax.tree.map(lambda mean, along: mean + off @ along, random.mean, random.along)
        return misfit(rig, standard, window, moved).ravel()

    mean = estimate - sd**2 * (response * (misfits(estimate) @ random.directions) + estimate)
    weights = mean + sd * normals
    squares = (jnp.sum(each**2) for each in (misfits(weights), weights, standard))
    return 0.5 * (sum(squares) - jnp.sum(normals**2))
