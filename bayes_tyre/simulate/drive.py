"""What drives the axle: the hydraulic load's step, and the runout of wheel, rollers and road under the tyre."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from bayes_tyre.simulate.draw import stream
from bayes_tyre.simulate.truth import Harmonic, Runout, Truth

Times = Float[np.ndarray, " times"]

#: How a load goes from 0 to 1 while s goes from 0 to 1; more than one, for studies of a fit that takes the wrong one.
SHAPES: dict[str, Callable[[Times], Times]] = {
    "raised cosine": lambda s: (1 - np.cos(np.pi * s)) / 2,
    "minimum jerk": lambda s: s**3 * (10 - 15 * s + 6 * s**2),
    "linear": lambda s: s,
    "first-order lag": lambda s: np.expm1(-4 * s) / np.expm1(-4.0),
    "two stages": lambda s: (2 - np.cos(np.pi * np.minimum(2 * s, 1)) - np.cos(np.pi * np.maximum(2 * s - 1, 0))) / 4,
}
#: Rolling starts so long before the first sample, s, that what its start stirred up has all but died away.
WARM_UP_S = 3.0
_FADE_IN_S = 0.5
# The road's amplitudes fall by its slope between these; it is a smooth curve through knots.
_ROAD_BAND_HZ, _ROAD_KNOTS_HZ = (1.0, 200.0), 2000.0


def cylinder_load(truth: Truth, time_s: Times) -> Times:
    """Return the hydraulic cylinder's force, kN, shape (times,); time 0 is the first sample."""
    s = np.clip((time_s - truth.step_start_s) / truth.rise_time_s, 0.0, 1.0)
    return truth.load_before_kN + (truth.load_after_kN - truth.load_before_kN) * SHAPES[truth.load_shape](s)


def runout(truth: Truth, time_s: Times) -> Times:
    """Return the displacement of the ground under the tyre, mm, shape (times,), positive where it compresses the tyre.

    Sines of the turns of wheel and rollers, and the road's noise; faded in at the start of the warm-up.
    """
    if truth.runout == Runout():
        return np.zeros_like(time_s)
    moved = truth.runout
    total = _road(truth)(time_s)
    total += _sines(moved.wheel_turn_Hz, moved.wheel_harmonics, time_s)
    total += _sines(moved.roller_turn_Hz, moved.roller_harmonics, time_s)
    return total * SHAPES["minimum jerk"](np.clip((time_s + WARM_UP_S) / _FADE_IN_S, 0.0, 1.0))


def _sines(turn_Hz: float, harmonics: tuple[Harmonic, ...], time_s: Times) -> Times:
    total = np.zeros_like(time_s)
    for order, harmonic in enumerate(harmonics, start=1):
        total += harmonic.amplitude_mm * np.sin(2 * np.pi * order * turn_Hz * time_s + harmonic.phase_rad)
    return total


def _road(truth: Truth) -> CubicSpline:
    """Return the road's noise as a smooth function of time, so that it is the same at any sampling rate."""
    knots = int(np.ceil((truth.plan.duration_s + WARM_UP_S) * _ROAD_KNOTS_HZ)) + 1
    spectrum = np.fft.rfft(stream(truth.seed, "road", truth.plan.label).standard_normal(knots))
    frequency = np.fft.rfftfreq(knots, 1 / _ROAD_KNOTS_HZ)
    inside = (frequency >= _ROAD_BAND_HZ[0]) & (frequency <= _ROAD_BAND_HZ[1])
    falls = np.maximum(frequency, _ROAD_BAND_HZ[0]) ** -truth.runout.road_slope
    height = np.fft.irfft(np.where(inside, spectrum * falls, 0.0), knots)
    time_s = np.arange(knots) / _ROAD_KNOTS_HZ - WARM_UP_S
    return CubicSpline(time_s, height * (truth.runout.road_noise_mm / height.std()))
