"""Block means of a channel, and the noise of these means from the rest before the step."""

import numpy as np
from jaxtyping import Float

from bayes_tyre.record import means_of_blocks

Samples = Float[np.ndarray, " samples"]
Values = Float[np.ndarray, "..."]


def converter_step(readings: Samples) -> float:
    """Return the smallest distance between two levels of a channel: its converter's step, or less without one."""
    gaps = np.diff(np.unique(readings))
    # Values computed from rounded voltages differ in their last digits.
    wide = gaps[gaps > 1e-6 * np.ptp(readings)]
    return float(wide.min()) if len(wide) else 0.0


def block_sd(rest: Samples, length: int) -> float:
    """Return the standard deviation of a block's mean: noise, and rounding errors that do not average out.

    Rounding to steps q adds q^2 / 12 to the variance of a reading. Noise of standard deviation s makes most of it
    independent between readings, and the means' variance includes that share. The share common to all readings is
    q^2 / (2 pi^2) exp(-4 pi^2 s^2 / q^2), the first term of its series (Widrow and Kollar 2008, Quantization Noise,
    chapter 6).
    """
    q = converter_step(rest)
    sd = float(np.std(means_of_blocks(rest, length)))
    least = q**2 / 12 / length
    variance = max(sd**2, least, 1e-18)
    if q > 0:
        noise = max(float(np.var(rest)) - q**2 / 12, 0.0)
        variance += q**2 / (2 * np.pi**2) * np.exp(-4 * np.pi**2 * noise / q**2)
    return float(np.sqrt(variance))


def block_sd_of_differences(rest: Samples, length: int) -> float:
    """Return the standard deviation of a block's mean from that of third differences: motion drops out of them."""
    # The third differences of white noise have 1 + 9 + 9 + 1 times its variance.
    return float(max(np.std(np.diff(means_of_blocks(rest, length), n=3)) / np.sqrt(20), 1e-9))


def level(rest: Samples, dt_s: float) -> tuple[float, float]:
    """Return the mean of a rest and its standard error, from means over 20 ms, so that slow noise counts."""
    length = max(1, round(0.02 / dt_s))
    means = means_of_blocks(rest, length)
    white = float(np.std(rest)) / np.sqrt(len(rest))
    slow = float(np.std(means)) / np.sqrt(max(len(means), 1))
    return float(np.mean(rest)), max(white, slow, 1e-9)


def level_after(after: Values, window: Values, before: tuple[float, float], dt_s: float) -> tuple[float, float]:
    """Return level and standard error of the load after the window; without data, the standard error is large."""
    if len(after) * dt_s < 0.1:
        return float(np.mean(window[-len(window) // 4 :])), max(100 * before[1], 1.0)
    return level(after, dt_s)
