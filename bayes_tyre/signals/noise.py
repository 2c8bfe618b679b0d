"""Noise of a signal at rest: a robust standard deviation, and that of means over short times."""

from typing import NamedTuple

import numpy as np

from bayes_tyre.record import Samples, means_of_blocks

# Readings further from the median than this many robust standard deviations are outliers.
_CLIP = 5.0


class Level(NamedTuple):
    """Mean of a signal at rest, its standard error, and the standard deviation of a sample and of means over a time."""

    mean: float
    standard_error: float
    sample_sd: float
    block_sd: float
    block_s: float

    @property
    def density(self) -> float:
        """Variance of the mean over 1 s, unit^2 s, of white noise with the same block means."""
        return self.block_sd**2 * self.block_s


def robust_sd(values: Samples) -> float:
    """Return the standard deviation without outliers; 0 for a constant.

    The median deviation alone does not serve: a coarse converter gives it few values to choose from.
    """
    away = np.abs(values - np.median(values))
    scale = 1.4826 * float(np.median(away))
    inliers = values[away <= _CLIP * scale] if scale > 0 else values
    return float(np.std(inliers))


def moving_mean(values: Samples, length: int) -> Samples:
    """Return the centred mean of `length` samples (made odd), of the available ones at both ends."""
    half = length // 2
    total = np.concatenate([[0.0], np.cumsum(values - values[0])])
    at = np.arange(len(values))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(values))
    return (total[high] - total[low]) / (high - low) + values[0]


def signal_level(values: Samples, dt_s: float, block_s: float = 0.02) -> Level:
    """Return mean and noise of a signal at rest.

    Parameters
    ----------
    values:
        Shape (samples,), any unit.
    dt_s, block_s:
        Spacing of the samples; length of the block means that measure slow noise, s.
    """
    length = max(1, round(block_s / dt_s))
    means = means_of_blocks(values, length)
    mean, sample_sd = float(np.mean(values)), robust_sd(values)
    # White noise sets a lower bound for block means; few blocks may be below it by chance.
    block_sd = max(robust_sd(means), sample_sd / np.sqrt(length))
    return Level(mean, float(block_sd / np.sqrt(max(len(means), 1))), sample_sd, float(block_sd), length * dt_s)
