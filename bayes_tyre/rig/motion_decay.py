"""Stiffness and damping from a free vibration: the classic estimate of a spring and a damper on a known mass.

The logarithmic decrement of successive swings and their period (Den Hartog, Mechanical Vibrations). For a tyre
with friction it gives the equivalent spring and damper, which depend on the amplitude: small swings stay on the steep
beginnings of the law's branches and are faster than large ones.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.signal import savgol_filter

from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

#: Turning points that a decrement needs: three swings, so that two of them can be compared twice.
LEAST_TURNS = 4
#: Readings are smoothed by cubics over this part of a period, which takes the same share of every swing, and thinned to
#: so many a period; they are used for as long as they reach so many standard deviations of their noise.
_SMOOTHED, _A_PERIOD, _ABOVE_NOISE = 0.2, 32, 10.0
#: Swings of an undamped vibration may seem to grow by so much.
ROUNDING = 1e-6


class Decay(NamedTuple):
    """The estimate from a free vibration.

    Attributes
    ----------
    k_kN_per_mm, c_kN_s_per_mm:
        Of the spring and the damper that vibrate so, at the point where the mass is.
    damping_ratio:
        Damping in parts of critical.
    """

    k_kN_per_mm: float
    c_kN_s_per_mm: float
    damping_ratio: float


def free_vibration(
    time_s: Float[np.ndarray, " samples"], displacement_mm: Float[np.ndarray, " samples"], m_kg: float
) -> Decay:
    """Return spring and damper from a free vibration about any level.

    Each turning point is that of the parabola through three samples. Swings from one to the next need no level; the
    line through their logarithms gives the decrement, the line through the times the period.

    Parameters
    ----------
    time_s, displacement_mm:
        Evenly spaced, of one mass with no force on it but the spring's and the damper's, smooth enough that
        it turns only where the vibration does.
    m_kg:
        The mass, kg.

    Raises
    ------
    ValueError
        If it turns fewer than `LEAST_TURNS` times, or does not decay.
    """
    rise = np.diff(displacement_mm)
    at = np.flatnonzero(rise[1:] * rise[:-1] < 0) + 1
    if len(at) < LEAST_TURNS:
        raise ValueError(f"turns {len(at)} times; a decrement needs {LEAST_TURNS} turning points")
    before, middle, after = (displacement_mm[at + shift] for shift in (-1, 0, 1))
    bend, slope = (before + after - 2 * middle) / 2, (after - before) / 2
    times = time_s[at] - slope / (2 * bend) * (time_s[1] - time_s[0])
    swings = np.abs(np.diff(middle - slope**2 / (4 * bend)))
    decrement = -2 * np.polyfit(np.arange(len(swings)), np.log(swings), 1)[0]
    if decrement < -ROUNDING:
        raise ValueError(f"its swings grow (logarithmic decrement {decrement:.3g}); a free vibration decays")
    period = 2 * np.polyfit(np.arange(len(times)), times, 1)[0]
    ratio = decrement / np.hypot(2 * np.pi, decrement)
    omega = 2 * np.pi / period / np.sqrt(1 - ratio**2)
    mass = m_kg * KN_PER_KG_MM_PER_S2
    return Decay(*map(float, (mass * omega**2, 2 * ratio * mass * omega, ratio)))


def ring_down(
    time_s: Float[np.ndarray, " samples"], readings: Float[np.ndarray, " samples"], noise: float, m_kg: float
) -> Decay:
    """Return spring and damper from noisy readings of a free vibration, such as an accelerometer's after a load's step.

    Acceleration and displacement swing alike, so that `readings` may be of either, in any unit.

    Parameters
    ----------
    time_s, readings:
        Evenly spaced, to the end of the vibration and beyond: the last quarter is taken for rest.
    noise:
        Standard deviation of a reading.
    m_kg:
        The mass, kg.

    Raises
    ------
    ValueError
        If too few swings stand out from the noise, or they do not decay.
    """
    about_rest = readings - readings[-len(readings) // 4 :].mean()
    # Zero padding: a vibration of a few swings has a peak wider than the spacing of its spectrum. At least two periods
    # are needed.
    spectrum, slowest = np.abs(np.fft.rfft(about_rest, 8 * len(readings))), 2 * 8
    period = 8 * len(readings) / (slowest + int(np.argmax(spectrum[slowest:])))
    smooth = np.asarray(savgol_filter(about_rest, max(5, 2 * int(_SMOOTHED * period / 2) + 1), 3))
    loud = np.flatnonzero(np.abs(smooth) > _ABOVE_NOISE * noise)
    if not len(loud):
        raise ValueError(f"never reaches {_ABOVE_NOISE:g} standard deviations of its noise; a decrement needs swings")
    every = max(1, int(period / _A_PERIOD))
    until = int(loud[-1]) + 1
    return free_vibration(time_s[:until:every], smooth[:until:every], m_kg)
