"""Where the load changes: one change of level in the whole recording, and the ramp from one level to the other."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.record import Samples, means_of_blocks

Ramps = Float[np.ndarray, " ramps"]
_BLOCK_S = 2e-3
# The ramp is sought so far about the change of level, and as long or short as this.
_REACH_S = 0.4
_LENGTHS_S = np.geomspace(4e-3, 0.6, 40)
_START_S = 2e-3
# Sums differ from residuals by rounding, which is far below this share of the squares that are subtracted.
_ROUNDING = 1e-7
# A line climbs from 10 % to 90 % of a smooth ramp; levels are taken clear of what lies outside.
_CLEAR_S = 0.05
# A level is the mean of so many blocks at least, or noise at an end would pass for one.
_LEAST_BLOCKS = 10


class Ramp(NamedTuple):
    """A straight ramp of the load: when it begins and ends, s after the first sample; levels before and after, kN."""

    start_s: float
    end_s: float
    before_kN: float
    after_kN: float


def find_ramp(load_kN: Samples, dt_s: float) -> Ramp:
    """Return the ramp that parts a load into two levels, wherever in the recording it is.

    The change of level is where cumulated deviations from the mean stand out most (CUSUM, scaled to the same variance
    everywhere); about it the straight ramp with the least squares is taken. There always is one: how clear it is,
    `steps` says.

    Parameters
    ----------
    load_kN:
        Cylinder load, kN, shape (samples,).
    dt_s:
        Spacing of the samples, s.
    """
    length = max(1, round(_BLOCK_S / dt_s))
    blocks, block_s = means_of_blocks(load_kN, length), length * dt_s
    change = _change_of_level(blocks)
    reach = round(_REACH_S / block_s)
    low, high = max(0, change - reach), min(len(blocks), change + reach)
    clear = round(_CLEAR_S / block_s)
    before, after = _levels(blocks, change, change, clear)
    time_s = (np.arange(low, high) + 0.5) * block_s
    start_s, end_s = _least_squares(time_s, blocks[low:high], before, after)
    before, after = _levels(blocks, round(start_s / block_s), round(end_s / block_s), clear)
    start_s, end_s = _least_squares(time_s, blocks[low:high], before, after)
    return Ramp(start_s, end_s, before, after)


def _change_of_level(blocks: Samples) -> int:
    n = len(blocks)
    k = np.arange(1, n)
    deviation = np.cumsum(blocks - blocks.mean())[:-1]
    # The scale is flat near both ends, or noise there would stand out as much as a step.
    share = np.clip(k / n, 0.02, 0.98)
    return int(k[np.argmax(np.abs(deviation) / np.sqrt(share * (1 - share)))])


def _levels(blocks: Samples, start: int, end: int, clear: int) -> tuple[float, float]:
    before = blocks[: max(_LEAST_BLOCKS, start - clear)]
    after = blocks[min(len(blocks) - _LEAST_BLOCKS, end + clear) :]
    return float(before.mean()), float(after.mean())


def _least_squares(time_s: Samples, blocks: Samples, before: float, after: float) -> tuple[float, float]:
    """Return start and end of the ramp with the least squares: all are ranked by sums, the best by their residuals."""
    each = [np.arange(time_s[0], time_s[-1] - length_s, _START_S) for length_s in _LENGTHS_S]
    starts, lengths = np.concatenate(each), np.repeat(_LENGTHS_S, [len(one) for one in each])
    if not len(starts):
        return float(time_s[0]), float(time_s[-1])
    rise, change = blocks - before, after - before
    ranked = _by_sums(time_s, rise, change, starts, lengths)
    near = ranked <= ranked.min() + _ROUNDING * (np.sum(rise**2) + len(rise) * change**2)
    starts, lengths = starts[near], lengths[near]
    share = np.clip((time_s - starts[:, None]) / lengths[:, None], 0.0, 1.0)
    i = int(np.argmin(np.sum((blocks - before - change * share) ** 2, axis=1)))
    return float(starts[i]), float(starts[i] + lengths[i])


def _by_sums(time_s: Samples, rise: Samples, change: float, starts: Ramps, lengths: Ramps) -> Ramps:
    """Return each ramp's sum of squares about ``change * clip((time - start) / length, 0, 1)``, up to rounding.

    It is ``sum rise^2 - 2 change sum(rise share) + change^2 sum share^2``, all of which are differences of cumulated
    sums: a ramp costs as much as one block, not as all of them.
    """
    low, high = np.searchsorted(time_s, starts), np.searchsorted(time_s, starts + lengths)
    t, t0 = time_s - time_s[0], starts - time_s[0]  # small numbers: their squares are subtracted

    def on_ramp(values: Samples) -> Ramps:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return total[high] - total[low]

    after = np.sum(rise) - np.concatenate([[0.0], np.cumsum(rise)])[high]
    with_share = (on_ramp(rise * t) - t0 * on_ramp(rise)) / lengths + after
    share_squared = (on_ramp(t**2) - 2 * t0 * on_ramp(t) + t0**2 * (high - low)) / lengths**2 + len(t) - high
    return np.sum(rise**2) - 2 * change * with_share + change**2 * share_squared
