"""The road's roughness above its waves: coloured noise of the accelerometer, larger where the tyre is stiffer.

A rough road's velocity has all frequencies alike, so the force by which it shakes the axle reaches far above the axle's
own frequency, and only the accelerometer sees it. Just after a compression turns, friction makes a tyre several times
as stiff, and the shaking is several times as large: where beta shows. Taken for white, that noise made betas of single
records 2 % off by one standard deviation, and said so too seldom. Waves so quick cannot be told one by one; their
covariance can: `n + A D A'`, n white, A the readings' answers to waves and D the variances of a spectrum c / f^2 that
ends somewhere. Where it ends is not known before (a tyre's contact smooths what is shorter than itself): it is read
from what a first fit leaves.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.forward_model import misfit, node_times
from bayes_tyre.inference.motion.record.window import Window
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.rig.axle import Rig

#: The highest frequency, Hz, of a wave: half-way to what blocks of 1 ms show.
HIGHEST_HZ = 250.0
# Ends of the spectrum that are tried, and its sizes, times what the slower waves have: lognormal about 1.
_ENDS, _SIZES, _SIZE_SD, _WHITE_STEPS = 41, 41, 0.5, 12
# Frequencies above the slower waves' by so much have nothing of them.
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
        Numbers of the waves, `last` not among them: times that they repeat in a period.
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
    standard: Float[Array, " unknowns"],
    mean_mm: Float[Array, " nodes"],
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
        Of the record, its accelerometer taken for white.
    standard, mean_mm:
        Unknowns and road that a first fit found.
    density_mm2_Hz:
        What its road has: the spectral density of its displacement times f^2.
    numbers, period_windows:
        Which waves are meant here, as in `waves_between`; static.
    """
    frequency, waves = waves_between(window, *numbers, period_windows)

    def answer(wave: Array) -> Array:
        return jax.jvp(lambda b: misfit(rig, standard, window, mean_mm + b * wave)[0], (0.0,), (1.0,))[1]

    answers = jax.vmap(answer, out_axes=1)(waves)
    left = misfit(rig, standard, window, mean_mm)[0]
    white, shares = quick_spectrum(window.block_s, left, answers, frequency, density_mm2_Hz)
    scaled = answers * jnp.sqrt(density_mm2_Hz * jnp.tile(shares, 2))
    lower = jnp.linalg.cholesky(white * jnp.eye(len(left)) + scaled @ scaled.T)
    whiten = jax.scipy.linalg.solve_triangular(lower, jnp.eye(len(left)), lower=True)
    # Whittle's likelihood takes the noise for equally large at all times. How large it is, what was made white says,
    # above the slower waves: of those a first fit leaves more than noise.
    at, power = _periodogram(whiten @ left, left != 0, window.block_s)
    above = at > _CLEAR * frequency[0]
    return whiten / jnp.sqrt(jnp.sum(above * power) / jnp.sum(above))


def quick_spectrum(
    block_s: ScalarLike,
    left: Float[Array, " blocks"],
    answers: Float[Array, "blocks columns"],
    frequency: Float[Array, " waves"],
    density: ScalarLike,
) -> tuple[Float[Array, ""], Float[Array, " waves"]]:
    """Return variance of the white noise, and each wave's, times what the slower waves' spectrum says.

    By Whittle's likelihood of the residuals' periodogram, averaged over the ends and sizes that are tried.

    Parameters
    ----------
    block_s:
        Time of a block, s.
    left:
        What a fit leaves of the accelerometer, in its noise; exactly 0 where there is no reading.
    answers, frequency:
        Of the accelerometer, in its noise, to the waves of `waves_between`, and their frequencies, Hz.
    density:
        Of the slower waves, mm^2 Hz.
    """
    at, power = _periodogram(left, left != 0, block_s)
    shown = (at > _CLEAR * frequency[0]) & (at < frequency[-1])
    taper = jnp.hanning(len(left)) * (left != 0)
    squares = jnp.sum((taper[:, None] * answers) ** 2, axis=0).reshape(2, -1).sum(axis=0) / jnp.sum(taper**2)
    # A wave's variance stands for a width of frequencies; of white noise of 1 the one-sided density is 2 block_s.
    road = jnp.interp(at, frequency, density * squares / (2 * block_s * (frequency[1] - frequency[0])))
    ends = jnp.geomspace(frequency[0], frequency[-1], _ENDS)
    sizes = jnp.exp(_SIZE_SD * jnp.linspace(-3.0, 3.0, _SIZES))

    def height(end: Array, size: Array) -> tuple[Array, Array]:
        there = size * road * (at <= end)

        def again(_: object, white: Array) -> Array:
            weight = shown / (white + there) ** 2
            return jnp.maximum(jnp.sum(weight * (power - there)) / jnp.sum(weight), 1e-3)

        white = jax.lax.fori_loop(0, _WHITE_STEPS, again, jnp.sum(shown * power) / jnp.sum(shown))
        whittle = jnp.sum(shown * (jnp.log(white + there) + power / (white + there)))
        return whittle + 0.5 * (jnp.log(size) / _SIZE_SD) ** 2, white

    heights, whites = jax.vmap(lambda end: jax.vmap(lambda size: height(end, size))(sizes))(ends)
    share = jnp.exp(jnp.min(heights) - heights)
    share = share / jnp.sum(share)
    of_end = share @ sizes
    return jnp.sum(share * whites), jnp.sum(of_end * (frequency[:, None] <= ends), axis=1)


def _periodogram(values: Array, there: Array, block_s: ScalarLike) -> tuple[Array, Array]:
    """Return frequencies, Hz, and the power at each, tapered: of white noise its variance."""
    taper = jnp.hanning(len(values)) * there
    power = jnp.abs(jnp.fft.rfft(taper * values)) ** 2 / jnp.sum(taper**2)
    return jnp.fft.rfftfreq(len(values), 1.0) / block_s, power
