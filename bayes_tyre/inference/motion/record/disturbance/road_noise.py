"""The road's roughness above the waves of `road_roughness`: coloured noise of the accelerometer.

A rough road's velocity has a flat spectrum, so the force by which it shakes the axle reaches far above the axle's own
frequency, and only the accelerometer measures it. Just after a compression turns, friction makes a tyre several times
as stiff and the shaking several times as large; this is also where beta is identified. If that noise is modelled as
white, betas of single records are off by 2 % (one standard deviation) and their intervals too narrow. Such fast waves
cannot be estimated one by one, but their covariance can: `n + A D A'`, n white, A the response to the waves and D the
variances of a spectrum c / f^2 with an upper end. That end is not known beforehand (a tyre's contact smooths what is
shorter than itself); it is estimated from the residuals of a first fit.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.model.forward_model import misfit, node_times
from bayes_tyre.inference.motion.record.model.window import Disturbance, Window
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.rig.axle import Rig

#: The highest frequency of a wave, Hz: half the Nyquist frequency of blocks of 1 ms.
HIGHEST_HZ = 250.0
# Numbers of grid points for the spectrum's end and for its size relative to the slower waves; standard deviation of the
# latter's lognormal prior about 1; iterations for the white variance.
_ENDS, _SIZES, _SIZE_SD, _WHITE_STEPS = 41, 41, 0.5, 12
# Frequencies above the slower waves' by this factor are free of them.
_CLEAR = 1.1


def waves_between(
    window: Window, first: int, last: int, period_windows: float
) -> tuple[Float[Array, " waves"], Float[Array, "columns nodes"]]:
    """Return frequencies (Hz) and cosines, then sines (mm) of a road whose displacement has the density 1 mm^2 Hz/f^2.

    Parameters
    ----------
    window:
        Of the record.
    first, last:
        Numbers of the waves (periods in the record's period), `last` excluded.
    period_windows:
        The period, in windows.
    """
    time_s = node_times(window)
    period_s = period_windows * time_s[-1]
    frequency = jnp.arange(first, last) / period_s
    size = 1 / (frequency * jnp.sqrt(period_s))
    angle = 2 * jnp.pi * frequency[:, None] * time_s
    return frequency, jnp.concatenate([size[:, None] * jnp.cos(angle), size[:, None] * jnp.sin(angle)])


@functools.partial(jax.jit, static_argnums=(0, 5, 6))
def whitening(
    rig: Rig,
    window: Window,
    standard: Float[Array, " parameters"],
    mean: Disturbance,
    density_mm2_Hz: Float[Array, ""],
    numbers: tuple[int, int],
    period_windows: float,
) -> Float[Array, "blocks blocks"]:
    """Return the matrix that makes the accelerometer's residuals white, a lower triangle.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record, its accelerometer's noise white.
    standard, mean:
        Standardised parameters and road that a first fit found.
    density_mm2_Hz:
        Spectral density of the road's displacement times f^2.
    numbers, period_windows:
        Numbers and period of the waves, as in `waves_between`; static.
    """
    frequency, waves = waves_between(window, *numbers, period_windows)

    def response(wave: Array) -> Array:
        return jax.jvp(
            lambda b: misfit(rig, standard, window, mean._replace(road_mm=mean.road_mm + b * wave))[0], (0.0,), (1.0,)
        )[1]

    responses = jax.vmap(response, out_axes=1)(waves)
    residual = misfit(rig, standard, window, mean)[0]
    white, shares = road_noise_spectrum(window.block_s, residual, responses, frequency, density_mm2_Hz)
    scaled = responses * jnp.sqrt(density_mm2_Hz * jnp.tile(shares, 2))
    lower = jnp.linalg.cholesky(white * jnp.eye(len(residual)) + scaled @ scaled.T)
    whiten = jax.scipy.linalg.solve_triangular(lower, jnp.eye(len(residual)), lower=True)
    # Whittle's likelihood assumes stationary noise. Its size is taken from the whitened residuals, above the slower
    # waves' frequencies: there a first fit leaves more than noise.
    at, power = _periodogram(whiten @ residual, residual != 0, window.block_s)
    above = at > _CLEAR * frequency[0]
    return whiten / jnp.sqrt(jnp.sum(above * power) / jnp.sum(above))


def road_noise_spectrum(
    block_s: ScalarLike,
    residual: Float[Array, " blocks"],
    responses: Float[Array, "blocks columns"],
    frequency: Float[Array, " waves"],
    density: ScalarLike,
) -> tuple[Float[Array, ""], Float[Array, " waves"]]:
    """Return the white noise's variance, and each wave's variance relative to the slower waves' spectrum.

    By Whittle's likelihood of the residuals' periodogram, averaged over the grid of ends and sizes.

    Parameters
    ----------
    block_s:
        Time of a block, s.
    residual:
        Residuals of the accelerometer, in standard deviations of its noise; exactly 0 where there is no reading.
    responses, frequency:
        Response of the accelerometer, standardised, to the waves of `waves_between`, and their frequencies, Hz.
    density:
        Of the slower waves, mm^2 Hz.
    """
    at, power = _periodogram(residual, residual != 0, block_s)
    used = (at > _CLEAR * frequency[0]) & (at < frequency[-1])
    taper = jnp.hanning(len(residual)) * (residual != 0)
    squares = jnp.sum((taper[:, None] * responses) ** 2, axis=0).reshape(2, -1).sum(axis=0) / jnp.sum(taper**2)
    # A wave's variance represents a band of frequencies; the one-sided density of unit white noise is 2 block_s.
    road = jnp.interp(at, frequency, density * squares / (2 * block_s * (frequency[1] - frequency[0])))
    ends = jnp.geomspace(frequency[0], frequency[-1], _ENDS)
    sizes = jnp.exp(_SIZE_SD * jnp.linspace(-3.0, 3.0, _SIZES))

    def objective(end: Array, size: Array) -> tuple[Array, Array]:
        road_power = size * road * (at <= end)

        def iterate(_: object, white: Array) -> Array:
            weight = used / (white + road_power) ** 2
            return jnp.maximum(jnp.sum(weight * (power - road_power)) / jnp.sum(weight), 1e-3)

        white = jax.lax.fori_loop(0, _WHITE_STEPS, iterate, jnp.sum(used * power) / jnp.sum(used))
        whittle = jnp.sum(used * (jnp.log(white + road_power) + power / (white + road_power)))
        return whittle + 0.5 * (jnp.log(size) / _SIZE_SD) ** 2, white

    objectives, whites = jax.vmap(lambda end: jax.vmap(lambda size: objective(end, size))(sizes))(ends)
    share = jnp.exp(jnp.min(objectives) - objectives)
    share = share / jnp.sum(share)
    size_at_end = share @ sizes
    return jnp.sum(share * whites), jnp.sum(size_at_end * (frequency[:, None] <= ends), axis=1)


def _periodogram(values: Array, present: Array, block_s: ScalarLike) -> tuple[Array, Array]:
    """Return frequencies, Hz, and the power at each, tapered: of white noise its variance."""
    taper = jnp.hanning(len(values)) * present
    power = jnp.abs(jnp.fft.rfft(taper * values)) ** 2 / jnp.sum(taper**2)
    return jnp.fft.rfftfreq(len(values), 1.0) / block_s, power
