"""How noisy a quiet signal is: robustly, and of its means over short times."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

Samples = Float[np.ndarray, " samples"]
# Readings further from the median than so many robust standard deviations are bumps, not noise.
_CLIP = 5.0


class Level(NamedTuple):
    """Mean of a quiet signal, its standard error, and the noise about it: of a sample, and of means over a time."""

    mean: float
    standard_error: float
    sample_sd: float
    block_sd: float
    block_s: float

    @property
    def density(self) -> float:
        """Variance of the mean over 1 s, unit^2 s: what white noise of the same slow part would have."""
        return self.block_sd**2 * self.block_s


def robust_sd(values: Samples) -> float:
    """Return the standard deviation without the few readings that lie far off; 0 for a constant.

    The median deviation alone does not serve: a coarse converter gives it few values to choose from.
    """
    away = np.abs(values - np.median(values))
    scale = 1.4826 * float(np.median(away))
    kept = values[away <= _CLIP * scale] if scale > 0 else values
    return float(np.std(kept))


def block_means(values: Float[np.ndarray, "... samples"], length: int) -> Float[np.ndarray, "... blocks"]:
    """Return the means of blocks of `length` samples; what is left over at the end goes."""
    blocks = values.shape[-1] // length
    return values[..., : blocks * length].reshape(*values.shape[:-1], blocks, length).mean(axis=-1)


def moving_mean(values: Samples, length: int) -> Samples:
    """Return the centred mean of `length` samples (made odd), of what there is of them at both ends."""
    half = length // 2
    total = np.concatenate([[0.0], np.cumsum(values - values[0])])
    at = np.arange(len(values))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(values))
    return (total[high] - total[low]) / (high - low) + values[0]


def signal_level(values: Samples, dt_s: float, block_s: float = 0.02) -> Level:
    """Return mean and noise of a quiet stretch of a signal.

    Parameters
    ----------
    values:
        Shape (samples,), any unit.
    dt_s, block_s:
        Spacing of the samples; time of the means whose scatter says how slow noise adds up, s.
    """
    length = max(1, round(block_s / dt_s))
    means = block_means(values, length)
    mean, sample_sd = float(np.mean(values)), robust_sd(values)
    # White noise sets the least that means of blocks can scatter; few blocks may show less by luck.
    block_sd = max(robust_sd(means), sample_sd / np.sqrt(length))
    return Level(mean, float(block_sd / np.sqrt(max(len(means), 1))), sample_sd, float(block_sd), length * dt_s)
