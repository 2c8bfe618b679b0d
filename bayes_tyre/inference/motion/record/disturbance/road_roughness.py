"""The road's roughness under a rolling tyre: its size, and the covariance that it adds to the readings.

A rough road has a displacement whose spectral density falls with the square of the frequency (ISO 8608, waviness 2).
The axle responds mainly at its own frequency, in accelerometer and laser both, so the readings' errors are neither
white nor independent. The columns of this disturbance (`response`) are cosines and sines.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.disturbance.response import Columns, disturbance_response
from bayes_tyre.inference.motion.record.disturbance.road_noise import HIGHEST_HZ as ROAD_NOISE_HZ
from bayes_tyre.inference.motion.record.disturbance.road_noise import waves_between, whitening
from bayes_tyre.inference.motion.record.map_fit import MapEstimate
from bayes_tyre.inference.motion.record.model.window import Disturbance, DisturbanceResponse, Window
from bayes_tyre.rig.axle import Rig

#: Highest frequency of cosines and sines, Hz (above it: `road_noise`), and their period in windows: longer than one, so
#: that the window's two ends are independent.
HIGHEST_HZ, PERIOD_WINDOWS = 40.0, 1.5
#: Range of the grid for the road's standard deviation between 1 and 200 Hz, mm, and its number of points.
ROUGHNESS_MM = (1e-4, 0.1)
_GRID = 121
# Variance between 1 and 200 Hz of the density c / f^2, as a share of c.
_SHARE = 1 - 1 / 200


@functools.partial(jax.jit, static_argnums=(0, 3))
def road_response(
    rig: Rig, window: Window, standard: Float[Array, " parameters"], waves: int, further: Disturbance | None = None
) -> DisturbanceResponse:
    """Return the readings' response to the road; its size is the standard deviation at 1 to 200 Hz, mm.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    standard:
        Standardised parameters near the MAP estimate.
    waves:
        Number of frequencies (`wave_count`).
    further:
        Columns of a disturbance of known size, as in `disturbance_response`.
    """
    columns = road_columns(window, waves)
    among = Columns(columns, jnp.eye(2 * waves)[None], jnp.geomspace(*ROUGHNESS_MM, _GRID))
    return disturbance_response(rig, window, standard, among, further)


def road_columns(window: Window, waves: int) -> Disturbance:
    """Return the columns, cosines and then sines, of a road whose standard deviation at 1 to 200 Hz is 1 mm."""
    road = waves_between(window, 1, waves + 1, PERIOD_WINDOWS)[1] / jnp.sqrt(_SHARE)
    return Disturbance(road, jnp.zeros_like(road), jnp.zeros_like(road))


def of_known_size(window: Window, road: DisturbanceResponse, waves: int) -> tuple[DisturbanceResponse, Disturbance]:
    """Return a road with weights of standard deviation 1, and its columns, each of its size."""
    columns = jax.tree.map(lambda of_road: road.size * of_road, road_columns(window, waves))
    return road._replace(weights=road.weights.at[: 2 * waves].divide(road.size)), columns


def with_residual_noise(window: Window, estimate: MapEstimate) -> Window:
    """Return a window with the noise of laser and load raised to that of a fit's residuals.

    `with_road_noise` does this for the accelerometer. Residuals with lag-1 autocorrelation r carry as much information
    on slow changes as white ones of (1 + r) / (1 - r) times their variance.
    """
    autocorrelation = jnp.clip(estimate.correlation, 0.0, 0.9)
    factor = (
        jnp.sqrt(jnp.maximum(estimate.chi_squared * (1 + autocorrelation) / (1 - autocorrelation), 1.0)).at[0].set(1.0)
    )
    return window._replace(weight=window.weight / factor[:, None])


def wave_count(window: Window, highest_Hz: float = HIGHEST_HZ) -> int:
    """Return the number of frequencies of a window's road up to a highest one, Hz."""
    return round(float(window.block_s) * window.readings.shape[-1] * PERIOD_WINDOWS * highest_Hz)


def with_road_noise(
    rig: Rig, window: Window, standard: Float[Array, " parameters"], roughness_mm: Float[Array, ""]
) -> Window:
    """Return a window with the road's fast waves as coloured noise of its accelerometer (`road_noise`)."""
    road = window.disturbance
    assert road is not None
    numbers, density = (wave_count(window) + 1, wave_count(window, ROAD_NOISE_HZ) + 1), roughness_mm**2 / _SHARE
    matrix = whitening(rig, window, standard, road.mean, density, numbers, PERIOD_WINDOWS)
    return window._replace(disturbance=road._replace(whitening=matrix))
