"""The method `thesis`: the source's own processing with its hand-picked times found from the data, for comparison."""

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Samples
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.signals.integrate import MM_PER_M, integrated
from bayes_tyre.signals.noise import moving_mean
from bayes_tyre.signals.processed import Processed, Recording, clarity

#: The source's moving average and the margin of its region: 801 and 400 samples at 10 kHz.
WINDOW_S, MARGIN_S = 0.0801, 0.0400
# A maximum below this share of the largest displacement is noise at the start.
_PEAK_FROM = 0.1


def thesis(recording: Recording, rig: Rig, window_s: float = WINDOW_S) -> Processed:
    """Return a recording as the source processed it.

    Acceleration less its mean, 0 before its last change of sign before the spike, integrated twice; cut at the
    overshoot and held; load held at its means before and after the response; both smoothed by a centred mean of 80 ms;
    region from 40 ms before the load's start to 40 ms after the displacement's end. As in the source's code, Eq. 7
    takes the displacement since the step, to which the laser's mean before is added; Eq. 8 takes the same displacement
    here. `window_s` is another moving mean's length, s, for a study of what it does; all else stays as it is. Three
    things differ: times that the source picked by eye are found (the load's from the straight ramp that
    fits it best), means are over all of the rest before and after, and windows are times, for other sampling rates.

    Raises
    ------
    BadInput
        If the displacement does not follow the load.
    """
    step, signals, dt_s = recording.step, recording.signals, recording.signals.dt_s
    upward = integrated(integrated(_zeroed(recording), dt_s), dt_s) * MM_PER_M
    end = _end_of_displacement(-step.sign * upward, step.start, step.sign > 0)
    upward[end:] = upward[end]
    load_start, load_end = round(step.ramp.start_s / dt_s), round(step.ramp.end_s / dt_s)
    after = float(signals.load_kN[max(load_end, step.settled) :].mean())
    load = signals.load_kN.copy()
    load[:load_start], load[load_end:] = step.load.mean, after
    window = round(window_s / dt_s)
    moved = -np.asarray(geometry.wheel_centre_displacement(rig, moving_mean(upward, window)), float)
    force = np.asarray(geometry.tyre_load(rig, moving_mean(load, window)), float)
    margin = round(MARGIN_S / dt_s)
    region = slice(max(0, load_start - margin), min(len(moved), end + margin + 1))
    d = np.asarray(geometry.flat_ground_displacement(rig, moved[region]), float)
    per_wheel_centre = np.asarray(geometry.flat_ground_force(rig, np.ones_like(d), moved[region]), float)
    averaged = np.sqrt(min(window, max(load_end - load_start, 1))) / window
    force_sd = step.load.sample_sd * averaged * float(geometry.wheel_centre_force(rig, 1.0))
    since = np.clip(signals.time_s[region] - signals.time_s[step.start], 0.0, (end - step.start) * dt_s)
    density = step.acceleration.density * MM_PER_M**2
    lever = float(geometry.wheel_centre_displacement(rig, 1.0))
    return Processed(
        recording.factors,
        signals.time_s[region],
        d + float(signals.laser_mm[: step.pre_step].mean()),
        force[region] * per_wheel_centre,
        np.sqrt(density * since**3 / 3) * lever,
        force_sd * per_wheel_centre,
        {
            **clarity(step),
            "displacement_at_measurement_mm": float(-upward[end]),
            "response_s": (end - step.start) * dt_s,
            "runout_rms_m_per_s2": recording.runout_rms_m_per_s2,
            "method": "thesis",
        },
        recording,
    )


def _zeroed(recording: Recording) -> Samples:
    """Return the upward acceleration less its mean, m/s^2, 0 before the motion starts."""
    step = recording.step
    zeroed = recording.signals.acceleration_m_per_s2 - step.acceleration.mean
    zeroed[: step.start + 1] = 0.0
    return zeroed


def _end_of_displacement(moved: Samples, start: int, loading: bool) -> int:
    """Return where the source ends a displacement, mm, counted positive the way the load changes.

    Loading: at its first maximum. Unloading: where it first passes the value of the first minimum after the overshoot.
    """
    most = np.abs(moved).max()
    falls = np.flatnonzero((np.diff(moved[start:]) <= 0) & (moved[start:-1] > _PEAK_FROM * most))
    if not len(falls):
        raise BadInput(
            "displacement does not follow the load to a maximum; check the sign of the acceleration in [signs] of the "
            "rig file"
        )
    peak = start + int(falls[0])
    rises = np.flatnonzero(np.diff(moved[peak:]) > 0)
    if loading or not len(rises):
        return peak
    return start + int(np.argmax(moved[start:] >= moved[peak + int(rises[0])]))
