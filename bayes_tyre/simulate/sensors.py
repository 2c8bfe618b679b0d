"""From what the axle does to what the data logger writes: sensors, noise, the converter, and the channels of B1."""

import numpy as np
from jaxtyping import Float

from bayes_tyre.record import Channel, RawSignals
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.calibration import Line
from bayes_tyre.simulate.draw import stream
from bayes_tyre.simulate.truth import Truth

Samples = Float[np.ndarray, " samples"]

#: One step of the analogue-to-digital converter, V. Source: the levels in the rows of appendix B1.
CONVERTER_STEP_V = 0.0001525
# The logger's clock, ms, beyond the recording itself, as in appendix B1 (15144 for 15 s).
_ELAPSED_BEYOND_MS = 144.0
# Appendix B1 writes this over all six channels, the converted ones too; files of the rig are like that.
_UNIT = "Volts"


def channels(
    truth: Truth, rig: Rig, time_s: Samples, displacement_mm: Samples, acceleration_m_per_s2: Samples, load_kN: Samples
) -> RawSignals:
    """Return the raw signals of a record, named and ordered as in appendix B1.

    Each sensor reads with an offset and white noise; its voltage is rounded to the converter's step, and the
    engineering channel is the calibration line of the rounded voltage. Left out: bandwidth of sensors and filters,
    the laser's own sampling, saturation, cross-talk, hum.

    Parameters
    ----------
    truth:
        Offsets and noise.
    rig:
        Lever arms, calibration lines, channel names and signs.
    time_s:
        Sampling times, s, shape (samples,).
    displacement_mm, acceleration_m_per_s2:
        Of the wheel centre, down positive, shape (samples,).
    load_kN:
        Of the cylinder, shape (samples,).
    """
    lever = rig.axle.support_to_measurement_mm / rig.axle.support_to_wheel_centre_mm
    upward = -1.0 if rig.signs.acceleration_positive_upward else 1.0
    downward = 1.0 if rig.signs.displacement_grows_downward else -1.0
    inward = 1.0 if rig.signs.load_positive_into_rollers else -1.0
    readings = (
        upward * lever * acceleration_m_per_s2 + truth.acceleration_offset_m_per_s2,
        downward * lever * displacement_mm + truth.laser_at_first_touch_mm,
        inward * load_kN,
    )
    sds = (truth.noise_acceleration_m_per_s2, truth.noise_displacement_mm, truth.noise_load_kN)
    written: list[Channel] = []
    for (volts_name, name, line), reading, sd in zip(_sensors(rig), readings, sds, strict=True):
        noise = sd * stream(truth.seed, "sensor", name, truth.plan.label).standard_normal(len(time_s))
        volts = converted(reading + noise, line)
        written += [
            Channel(volts_name, _UNIT, time_s, volts, len(time_s)),
            Channel(name, _UNIT, time_s, line(volts), len(time_s)),
        ]
    elapsed = np.array([1000 * truth.plan.duration_s + _ELAPSED_BEYOND_MS])
    return RawSignals(segments=((*written, Channel("Time Elapsed", "", np.zeros(1), elapsed, 1)),))


def converted(reading: Samples, line: Line) -> Samples:
    """Return the voltage, V, that the converter makes of a reading: the nearest of its steps."""
    volts = (reading - line.intercept) / line.slope
    return np.round(volts / CONVERTER_STEP_V) * CONVERTER_STEP_V


def _sensors(rig: Rig) -> tuple[tuple[str, str, Line], ...]:
    names, lines = rig.channels, rig.calibration
    return (
        (
            names.acceleration_voltage,
            names.acceleration,
            Line(lines.acceleration_slope_m_per_s2_per_V, lines.acceleration_intercept_m_per_s2),
        ),
        (
            names.displacement_voltage,
            names.displacement,
            Line(lines.displacement_slope_mm_per_V, lines.displacement_intercept_mm),
        ),
        (names.load_voltage, names.load, Line(lines.load_slope_kN_per_V, lines.load_intercept_kN)),
    )
