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

from bayes_tyre.inference.motion.record.forward_model import misfit
from bayes_tyre.inference.motion.record.map_fit import Found, value_and_jacobian
from bayes_tyre.inference.motion.record.road_noise import HIGHEST_HZ as QUICK_HZ
from bayes_tyre.inference.motion.record.road_noise import waves_between, whitening
from bayes_tyre.inference.motion.record.window import Road, Window
from bayes_tyre.rig.axle import Rig

#: Cosines and sines up to this frequency, Hz; what is above is noise of the accelerometer (`motion_quick_road`). They
#: repeat after so many windows, so that its two ends are not tied together.
HIGHEST_HZ, PERIOD_WINDOWS = 40.0, 1.5
#: Standard deviations of the road between 1 and 200 Hz that are tried, mm.
ROUGHNESS_MM = (1e-4, 0.1)
_TRIED = 121
# The density c / f^2 has this share of c as its variance between 1 and 200 Hz.
_SHARE = 1 - 1 / 200


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
    road = waves_between(window, 1, waves + 1, PERIOD_WINDOWS)[1] / jnp.sqrt(_SHARE)
    mean = jnp.zeros(road.shape[1]) if window.road is None else window.road.mean_mm
    weights = jnp.zeros(len(road)) if window.road is None else window.road.weights
    answers = _answers(rig, window, standard, mean, road)
    off, jacobian = value_and_jacobian(rig, standard, window._replace(road=_known_road(window, mean)))
    off = off.at[: len(answers)].add(-answers @ weights)
    padded = jnp.concatenate([answers, jnp.zeros((off.size - len(answers), answers.shape[1]))])
    padded, rest = padded - jacobian @ _least(jacobian, padded), off - jacobian @ _least(jacobian, off)
    left, spread, _ = _singular(padded)
    squares = (left.T @ rest) ** 2
    tried = jnp.geomspace(*ROUGHNESS_MM, _TRIED)
    variance = 1 + (tried[:, None] * spread) ** 2
    roughness = tried[jnp.argmin(jnp.sum(jnp.log(variance) + squares / variance, axis=1))]
    directions, spread, of = _singular(roughness * answers)
    # The unknowns move with the road: what they take of the misfit is not the road's.
    shrink = 1 - 1 / jnp.sqrt(1 + spread**2)
    rows = jnp.concatenate([_whiten(jacobian[: len(answers)], directions, shrink), jacobian[len(answers) :]])
    rest = jnp.concatenate([_whiten(off[: len(answers)], directions, shrink), off[len(answers) :]])
    moved = (off - jacobian @ _least(rows, rest))[: len(answers)]
    weights = -roughness * of.T @ (spread / (1 + spread**2) * (directions.T @ moved))
    answer = (answers @ weights).reshape(window.readings.shape)
    quick = None if window.road is None else window.road.quick
    return Road(weights @ road, weights, answer, directions, shrink, quick), roughness


def with_noise(window: Window, found: Found) -> Window:
    """Return a window whose noise is what a fit left of laser and load, where that is more than was measured.

    What it leaves of the accelerometer is `with_quick_road`'s. Residuals with the lag-1 autocorrelation r say as little
    of what is slow as white ones of (1 + r) / (1 - r) times their variance.
    """
    alike = jnp.clip(found.correlation, 0.0, 0.9)
    times = jnp.sqrt(jnp.maximum(found.chi_squared * (1 + alike) / (1 - alike), 1.0)).at[0].set(1.0)
    return window._replace(weight=window.weight / times[:, None])


def _least(rows: Array, off: Array) -> Array:
    """Return the least-squares weights of a Jacobian's columns; its last rows are the prior's, and it has full rank."""
    return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(rows.T @ rows), rows.T @ off)


def _singular(columns: Float[Array, "rows columns"]) -> tuple[Array, Array, Array]:
    """Return the singular value decomposition of a tall matrix, from its columns' products: a tenth of the time.

    Values below a millionth of the largest are off, and directions along them not orthonormal: what is shrunk by so
    little may stay as it is.
    """
    squares, of = jnp.linalg.eigh(columns.T @ columns)
    spread = jnp.sqrt(jnp.maximum(squares, 1e-12 * squares[-1]))
    return columns @ of / spread, spread, of.T


def _whiten(off: Array, directions: Array, shrink: Array) -> Array:
    return off - directions @ ((shrink * (directions.T @ off).T).T)


def _known_road(window: Window, mean_mm: Float[Array, " nodes"]) -> Road:
    """Return a road that is known: readings differ from what it makes of them by their noise alone."""
    size, quick = window.readings.size, None if window.road is None else window.road.quick
    nothing = jnp.zeros_like(window.readings)
    return Road(mean_mm, jnp.zeros(1), nothing, jnp.zeros((size, 1)), jnp.zeros(1), quick)


def wave_count(window: Window, highest_Hz: float = HIGHEST_HZ) -> int:
    """Return how many frequencies a window's road has up to one, Hz."""
    return round(float(window.block_s) * window.readings.shape[-1] * PERIOD_WINDOWS * highest_Hz)


def with_quick_road(
    rig: Rig, window: Window, standard: Float[Array, " unknowns"], roughness_mm: Float[Array, ""]
) -> Window:
    """Return a window that has a road with what is quick of it as noise of its accelerometer (`motion_quick_road`)."""
    assert window.road is not None
    numbers, density = (wave_count(window) + 1, wave_count(window, QUICK_HZ) + 1), roughness_mm**2 / _SHARE
    quick = whitening(rig, window, standard, window.road.mean_mm, density, numbers, PERIOD_WINDOWS)
    return window._replace(road=window.road._replace(quick=quick))


def _answers(
    rig: Rig, window: Window, standard: Float[Array, " unknowns"], mean_mm: Array, road: Float[Array, "columns nodes"]
) -> Float[Array, "readings columns"]:
    """Return the derivative of all readings, in their noise, by the road's waves about a road."""

    def answer(wave: Array) -> Array:
        return jax.jvp(lambda b: misfit(rig, standard, window, mean_mm + b * wave).ravel(), (0.0,), (1.0,))[1]

    return jax.vmap(answer, out_axes=1)(road)
