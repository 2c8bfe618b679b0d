"""Block means of a channel, and the noise of these means from the rest before the step."""

import numpy as np
from jaxtyping import Float

from bayes_tyre.record import means_of_blocks

#: Levels of a rest that say little of its noise.
_FEW_LEVELS = 3
Samples = Float[np.ndarray, " samples"]
Values = Float[np.ndarray, "..."]


def converter_step(readings: Samples) -> float:
    """Return the smallest distance between two levels of a channel: its converter's step, or less without one."""
    gaps = np.diff(np.unique(readings))
    # Values computed from rounded voltages differ in their last digits.
    wide = gaps[gaps > 1e-6 * np.ptp(readings)]
    return float(wide.min()) if len(wide) else 0.0


def common_rounding_variance(rest: Samples, q: float) -> float:
    """Return the variance of the rounding error that all readings of a rest share, of a converter with steps `q`.

    Rounding adds q^2 / 12 to the variance of a reading. Noise of standard deviation s makes most of it independent
    between readings. The share common to all readings is q^2 / (2 pi^2) exp(-4 pi^2 s^2 / q^2), the first term of its
    series (Widrow and Kollar 2008, Quantization Noise, chapter 6).

    On few levels the variance says where between two of them the rest is, not how large the noise is: that is then no
    more than reaches the third, as four of its standard deviations do.
    """
    if q <= 0:
        return 0.0
    levels = round(float(np.ptp(rest)) / q) + 1
    noise = max(float(np.var(rest)) - q**2 / 12, 0.0)
    if levels <= _FEW_LEVELS:
        noise = (max(levels - 2, 0) * q / 8) ** 2
    return float(q**2 / (2 * np.pi**2) * np.exp(-4 * np.pi**2 * noise / q**2))


def block_sd(rest: Samples, length: int, q: float) -> float:
    """Return the standard deviation of a block's mean: noise, and rounding to steps `q`."""
    sd = float(np.std(means_of_blocks(rest, length)))
    variance = max(sd**2, q**2 / 12 / length, 1e-18)
    return float(np.sqrt(variance + common_rounding_variance(rest, q)))


def block_sd_of_differences(rest: Samples, length: int) -> float:
    """Return the standard deviation of a block's mean from that of third differences: motion drops out of them."""
    # The third differences of white noise have 1 + 9 + 9 + 1 times its variance.
    return float(max(np.std(np.diff(means_of_blocks(rest, length), n=3)) / np.sqrt(20), 1e-9))


def level(rest: Samples, dt_s: float, q: float) -> tuple[float, float]:
    """Return the mean of a rest and its standard error, from means over 20 ms, so that slow noise counts.

    Rounding to steps `q` is an error of the mean too, as far as all readings share it.
    """
    length = max(1, round(0.02 / dt_s))
    means = means_of_blocks(rest, length)
    white = float(np.std(rest)) / np.sqrt(len(rest))
    slow = float(np.std(means)) / np.sqrt(max(len(means), 1))
    shared = float(np.sqrt(common_rounding_variance(rest, q)))
    return float(np.mean(rest)), float(np.hypot(max(white, slow, 1e-9), shared))


def level_after(
    after: Values, window: Values, before: tuple[float, float], dt_s: float, q: float
) -> tuple[float, float]:
    """Return level and standard error of the load after the window; without data, the standard error is large."""
    if len(after) * dt_s < 0.1:
        return float(np.mean(window[-len(window) // 4 :])), max(100 * before[1], 1.0)
    return level(after, dt_s, q)
