"""The road's roughness under a rolling tyre: what it adds to the readings, and how rough it is.

A rough road has a displacement whose spectral density falls with the square of the frequency (ISO 8608, waviness 2).
The axle answers at its own frequency above all, in accelerometer and laser alike, so the readings' errors are neither
white nor independent. To first order they are G b, b normal(0, roughness^2), G the answers to cosines and sines: what G
spans is given that much more variance (`motion_model.whitened`), without one more unknown in the fit.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion_fit import Found, value_and_jacobian
from bayes_tyre.inference.motion_model import misfit, node_times
from bayes_tyre.inference.motion_window import Road, Window
from bayes_tyre.rig.axle import Rig

#: Cosines and sines up to this frequency, Hz: what is left above widens the sensors' noise (`with_noise`). They
#: repeat after so many windows, so that its two ends are not tied together.
HIGHEST_HZ, PERIOD_WINDOWS = 40.0, 1.5
#: Standard deviations of the road between 1 and 200 Hz that are tried, mm.
ROUGHNESS_MM = (1e-4, 0.1)
_TRIED = 121


@functools.partial(jax.jit, static_argnums=(0, 3))
def road_of(rig: Rig, window: Window, standard: Float[Array, " unknowns"], waves: int) -> tuple[Road, Float[Array, ""]]:
    """Return how the road shows in a window's readings, and its roughness: standard deviation at 1 to 200 Hz, mm.

    The roughness is the most probable one of what a fit leaves, with what the unknowns could have taken of it left out
    (restricted maximum likelihood; Patterson and Thompson 1971). Friction answers to a road of some um not quite
    linearly: called again with the window that has its road, it takes the answers anew about that road's estimate.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    standard:
        Unknowns near their most probable values.
    waves:
        Number of frequencies (`wave_count`).
    """
    road = _waves(window, waves)
    mean = jnp.zeros(road.shape[1]) if window.road is None else window.road.mean_mm
    weights = jnp.zeros(len(road)) if window.road is None else window.road.weights
    answers = _answers(rig, window, standard, mean, road)
    off, jacobian = value_and_jacobian(rig, standard, window._replace(road=plain_road(window, mean)))
    off = off.at[: len(answers)].add(-answers @ weights)
    taken = jnp.linalg.qr(jacobian)[0]
    padded = jnp.concatenate([answers, jnp.zeros((off.size - len(answers), answers.shape[1]))])
    left, spread, _ = jnp.linalg.svd(padded - taken @ (taken.T @ padded), full_matrices=False)
    squares = (left.T @ (off - taken @ (taken.T @ off))) ** 2
    tried = jnp.geomspace(*ROUGHNESS_MM, _TRIED)
    variance = 1 + (tried[:, None] * spread) ** 2
    roughness = tried[jnp.argmin(jnp.sum(jnp.log(variance) + squares / variance, axis=1))]
    directions, spread, of = jnp.linalg.svd(roughness * answers, full_matrices=False)
    # The unknowns move with the road: what they take of the misfit is not the road's.
    shrink = 1 - 1 / jnp.sqrt(1 + spread**2)
    rows = jnp.concatenate([_whiten(jacobian[: len(answers)], directions, shrink), jacobian[len(answers) :]])
    rest = jnp.concatenate([_whiten(off[: len(answers)], directions, shrink), off[len(answers) :]])
    moved = (off - jacobian @ jnp.linalg.lstsq(rows, rest)[0])[: len(answers)]
    weights = -roughness * of.T @ (spread / (1 + spread**2) * (directions.T @ moved))
    answer = (answers @ weights).reshape(window.readings.shape)
    return Road(weights @ road, weights, answer, directions, shrink), roughness


def with_noise(window: Window, found: Found) -> Window:
    """Return a window whose noise is what a fit left of each channel, where that is more than was measured.

    Residuals with the lag-1 autocorrelation r say as little of what is slow as white ones of (1 + r) / (1 - r) times
    their variance.
    """
    alike = jnp.clip(found.correlation, 0.0, 0.9)
    times = jnp.sqrt(jnp.maximum(found.chi_squared * (1 + alike) / (1 - alike), 1.0))
    return window._replace(weight=window.weight / times[:, None])


def _whiten(off: Array, directions: Array, shrink: Array) -> Array:
    return off - directions @ ((shrink * (directions.T @ off).T).T)


def plain_road(window: Window, mean_mm: Float[Array, " nodes"]) -> Road:
    """Return a road that is known: readings differ from what it makes of them by their noise alone."""
    size = window.readings.size
    nothing = jnp.zeros_like(window.readings)
    return Road(mean_mm, jnp.zeros(1), nothing, jnp.zeros((size, 1)), jnp.zeros(1))


def wave_count(window: Window) -> int:
    """Return how many frequencies a window's road has."""
    return round(float(window.block_s) * window.readings.shape[-1] * PERIOD_WINDOWS * HIGHEST_HZ)


def _waves(window: Window, waves: int) -> Float[Array, "columns nodes"]:
    """Return cosines and sines, mm, each of its size in a road of 1 mm roughness."""
    time_s = node_times(window)
    period_s = PERIOD_WINDOWS * time_s[-1]
    frequency = jnp.arange(1, waves + 1) / period_s
    # The density c / f^2 has the variance c (1 - 1 / 200) between 1 and 200 Hz; a wave stands for its share of it.
    size = 1 / (frequency * jnp.sqrt(period_s * (1 - 1 / 200)))
    angle = 2 * jnp.pi * frequency[:, None] * time_s
    return jnp.concatenate([size[:, None] * jnp.cos(angle), size[:, None] * jnp.sin(angle)])


def _answers(
    rig: Rig, window: Window, standard: Float[Array, " unknowns"], mean_mm: Array, road: Float[Array, "columns nodes"]
) -> Float[Array, "readings columns"]:
    """Return the derivative of all readings, in their noise, by the road's waves about a road."""

    def answer(wave: Array) -> Array:
        return jax.jvp(lambda b: misfit(rig, standard, window, mean_mm + b * wave).ravel(), (0.0,), (1.0,))[1]

    return jax.vmap(answer, out_axes=1)(road)
