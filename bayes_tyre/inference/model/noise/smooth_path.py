"""Noisy readings of a displacement that starts slowly, so that many of them lie near the start of its curve.

Each by itself may lie anywhere near its reading, where the curve is steepest and bent most. But the displacement is
smooth in time: its neighbours say where it is. Each reading is replaced by the middle of a parabola through the
readings about it, as many of them as the parabola fits.

Source: Savitzky and Golay (1964), "Smoothing and differentiation of data by simplified least squares procedures".
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

#: Readings on either side that a parabola may go through; the most that it fits are taken.
_SIDES = (4, 6, 9, 13, 19, 28)
#: Standard deviations from the start within which readings are smoothed: further on the curve is hardly bent.
_REACH = 20.0
#: Standard deviations that a window may travel: a longer way has too few readings to say that it is smooth.
_TRAVEL = 40.0
#: Standard deviations of the sum of squared residuals by which it may be above its mean.
_MISFIT = 2.0


class SmoothPath(NamedTuple):
    """A displacement that is smoothed near its start.

    Attributes
    ----------
    path_mm:
        Shape (points,): the displacement.
    averaged:
        Shape (points,): of how many readings the error of each is that of a mean; 1 where it is the reading.
    """

    path_mm: Float[np.ndarray, " points"]
    averaged: Float[np.ndarray, " points"]


def smooth_near_start(read: Float[np.ndarray, " points"], start_mm: float, sd_mm: float) -> SmoothPath:
    """Return a displacement (mm) whose readings near the start are smoothed.

    Parameters
    ----------
    read:
        Readings, mm, in the order of time and evenly spaced in it.
    start_mm, sd_mm:
        Where they start, and the standard deviation of the independent error of each.
    """
    near = np.abs(read - start_mm) < _REACH * sd_mm
    path, averaged = read.copy(), np.ones(len(read))
    for side in _SIDES:
        middles = np.arange(side, len(read) - side)
        middles = middles[near[middles]]
        windows = (read[middles[:, None] + np.arange(-side, side + 1)] - start_mm) / sd_mm
        basis = _parabolas(side)
        fitted = windows @ basis @ basis.T
        chosen = _fits(windows, fitted)
        path[middles[chosen]] = start_mm + sd_mm * fitted[chosen, side]
        averaged[middles[chosen]] = 1.0 / np.sum(basis[side] ** 2)
    return SmoothPath(path, averaged)


def _parabolas(side: int) -> Float[np.ndarray, "window 3"]:
    """Return an orthonormal basis of the parabolas over a window."""
    return np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, 2 * side + 1), 3))[0]


def _fits(
    windows: Float[np.ndarray, "windows window"], fitted: Float[np.ndarray, "windows window"]
) -> Bool[np.ndarray, " windows"]:
    """Return which parabolas fit readings, in standard deviations of these, as well as noise lets them."""
    freedom = windows.shape[1] - 3
    squares = np.sum((windows - fitted) ** 2, axis=1)
    slow = np.abs(fitted[:, -1] - fitted[:, 0]) <= _TRAVEL
    return slow & (squares <= freedom + _MISFIT * np.sqrt(2.0 * freedom))
