"""From what the axle does to what the data logger writes: sensors, noise, the converter, and the channels of B1."""

import numpy as np

from bayes_tyre.record import Channel, RawSignals, Samples
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.calibration import Line
from bayes_tyre.rig.sensors import sensors_of
from bayes_tyre.simulate.draw import stream
from bayes_tyre.simulate.truth import Truth

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
    engineering channel is the calibration line of the rounded voltage. A sensor without a line has only the latter
    channel, not rounded. Left out: bandwidth of sensors and filters,
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
    readings = (-lever * acceleration_m_per_s2, lever * displacement_mm, load_kN)
    offsets = (truth.acceleration_offset_m_per_s2, truth.laser_at_first_touch_mm, 0.0)
    sds = (truth.noise_acceleration_m_per_s2, truth.noise_displacement_mm, truth.noise_load_kN)
    written: list[Channel] = []
    for sensor, reading, offset, sd in zip(sensors_of(rig), readings, offsets, sds, strict=True):
        noise = sd * stream(truth.seed, "sensor", sensor.channel, truth.plan.label).standard_normal(len(time_s))
        values = (reading if sensor.positive else -reading) + offset + noise
        unit = sensor.unit
        if sensor.line is not None:
            volts, unit = converted(values, sensor.line), _UNIT
            values = sensor.line(volts)
            written.append(Channel(sensor.voltage, unit, time_s, volts, len(time_s)))
        written.append(Channel(sensor.channel, unit, time_s, values, len(time_s)))
    elapsed = np.array([1000 * truth.plan.duration_s + _ELAPSED_BEYOND_MS])
    return RawSignals(segments=((*written, Channel("Time Elapsed", "", np.zeros(1), elapsed, 1)),))


def converted(reading: Samples, line: Line) -> Samples:
    """Return the voltage, V, that the converter makes of a reading: the nearest of its steps."""
    volts = (reading - line.intercept) / line.slope
    return np.round(volts / CONVERTER_STEP_V) * CONVERTER_STEP_V
