"""The road's roughness under a rolling tyre: its size, and the covariance that it adds to the readings.

A rough road has a displacement whose spectral density falls with the square of the frequency (ISO 8608, waviness 2).
The axle responds mainly at its own frequency, in accelerometer and laser both, so the readings' errors are neither
white nor independent. To first order they are G b, b normal(0, roughness^2), G the response to cosines and sines. The
covariance of the readings is increased accordingly (`forward_model.residuals`), without additional parameters.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.disturbance.road_noise import HIGHEST_HZ as ROAD_NOISE_HZ
from bayes_tyre.inference.motion.record.disturbance.road_noise import waves_between, whitening
from bayes_tyre.inference.motion.record.forward_model import misfit
from bayes_tyre.inference.motion.record.map_fit import MapEstimate, value_and_jacobian
from bayes_tyre.inference.motion.record.window import RoadResponse, Window
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
    rig: Rig, window: Window, standard: Float[Array, " parameters"], waves: int
) -> tuple[RoadResponse, Float[Array, ""]]:
    """Return the readings' response to the road, and its roughness: standard deviation at 1 to 200 Hz, mm.

    The roughness is estimated by restricted maximum likelihood (Patterson and Thompson 1971) from the residuals of a
    fit. Friction responds to a road of some um slightly nonlinearly: a second call, with a window that has a road,
    linearises about that road's estimate.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    standard:
        MotionParameters near the MAP estimate.
    waves:
        Number of frequencies (`wave_count`).
    """
    road = waves_between(window, 1, waves + 1, PERIOD_WINDOWS)[1] / jnp.sqrt(_SHARE)
    mean = jnp.zeros(road.shape[1]) if window.road is None else window.road.mean_mm
    weights = jnp.zeros(len(road)) if window.road is None else window.road.weights
    responses = _responses(rig, window, standard, mean, road)
    residual, jacobian = value_and_jacobian(rig, standard, window._replace(road=_fixed_road(window, mean)))
    residual = residual.at[: len(responses)].add(-responses @ weights)
    padded = jnp.concatenate([responses, jnp.zeros((residual.size - len(responses), responses.shape[1]))])
    padded, rest = (
        padded - jacobian @ _least_squares(jacobian, padded),
        residual - jacobian @ _least_squares(jacobian, residual),
    )
    left, singular_values, _ = _singular(padded)
    squares = (left.T @ rest) ** 2
    grid = jnp.geomspace(*ROUGHNESS_MM, _GRID)
    variance = 1 + (grid[:, None] * singular_values) ** 2
    roughness = grid[jnp.argmin(jnp.sum(jnp.log(variance) + squares / variance, axis=1))]
    directions, singular_values, loadings = _singular(roughness * responses)
    # The parameters are estimated jointly with the road.
    shrink = 1 - 1 / jnp.sqrt(1 + singular_values**2)
    rows = jnp.concatenate([_whiten(jacobian[: len(responses)], directions, shrink), jacobian[len(responses) :]])
    rest = jnp.concatenate([_whiten(residual[: len(responses)], directions, shrink), residual[len(responses) :]])
    moved = (residual - jacobian @ _least_squares(rows, rest))[: len(responses)]
    weights = -roughness * loadings.T @ (singular_values / (1 + singular_values**2) * (directions.T @ moved))
    response = (responses @ weights).reshape(window.readings.shape)
    whitening_matrix = None if window.road is None else window.road.whitening
    return RoadResponse(weights @ road, weights, response, directions, shrink, whitening_matrix), roughness


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


def _least_squares(rows: Array, residual: Array) -> Array:
    """Return the least-squares weights of a Jacobian's columns; its last rows are the prior's, and it has full rank."""
    return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(rows.T @ rows), rows.T @ residual)


def _singular(columns: Float[Array, "rows columns"]) -> tuple[Array, Array, Array]:
    """Return the singular value decomposition of a tall matrix, by its Gram matrix: a tenth of the time.

    Values below a millionth of the largest are inaccurate and their directions not orthonormal; such directions are
    hardly scaled at all.
    """
    squares, vectors = jnp.linalg.eigh(columns.T @ columns)
    singular_values = jnp.sqrt(jnp.maximum(squares, 1e-12 * squares[-1]))
    return columns @ vectors / singular_values, singular_values, vectors.T


def _whiten(residual: Array, directions: Array, shrink: Array) -> Array:
    return residual - directions @ ((shrink * (directions.T @ residual).T).T)


def _fixed_road(window: Window, mean_mm: Float[Array, " nodes"]) -> RoadResponse:
    """Return the response for a fixed road, without covariance: residuals are the noise alone."""
    size, whitening_matrix = window.readings.size, None if window.road is None else window.road.whitening
    nothing = jnp.zeros_like(window.readings)
    return RoadResponse(mean_mm, jnp.zeros(1), nothing, jnp.zeros((size, 1)), jnp.zeros(1), whitening_matrix)


def wave_count(window: Window, highest_Hz: float = HIGHEST_HZ) -> int:
    """Return the number of frequencies of a window's road up to a highest one, Hz."""
    return round(float(window.block_s) * window.readings.shape[-1] * PERIOD_WINDOWS * highest_Hz)


def with_road_noise(
    rig: Rig, window: Window, standard: Float[Array, " parameters"], roughness_mm: Float[Array, ""]
) -> Window:
    """Return a window with the road's fast waves as coloured noise of its accelerometer (`road_noise`)."""
    assert window.road is not None
    numbers, density = (wave_count(window) + 1, wave_count(window, ROAD_NOISE_HZ) + 1), roughness_mm**2 / _SHARE
    matrix = whitening(rig, window, standard, window.road.mean_mm, density, numbers, PERIOD_WINDOWS)
    return window._replace(road=window.road._replace(whitening=matrix))


def _responses(
    rig: Rig, window: Window, standard: Float[Array, " parameters"], mean_mm: Array, road: Float[Array, "columns nodes"]
) -> Float[Array, "readings columns"]:
    """Return the derivative of the standardised readings by the road's waves about a road."""

    def response(wave: Array) -> Array:
        return jax.jvp(lambda b: misfit(rig, standard, window, mean_mm + b * wave).ravel(), (0.0,), (1.0,))[1]

    return jax.vmap(response, out_axes=1)(road)
