"""The three channels of a recording, on one time base, in engineering units, with the signs that the rig says."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Channel, RawSignals, Samples
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.sensors import Sensor, sensors_of

#: Channels may be so far apart in time, as a share of their spacing.
_JITTER = 0.1
#: Fewer samples hold no step, nor does a shorter recording, nor samples further apart, s.
LEAST_SAMPLES, SHORTEST_S, COARSEST_S = 100, 0.5, 2e-3
#: Times that differ by less than rounding does are alike.
_ROUNDED = 1 + 1e-6
# An accelerometer that repeats its largest or smallest value this often, and for so long (s), is clipped: the peak of a
# response is rounder than that even in converter steps.
_CLIPPED, _CLIPPED_S = 8, 1e-3


class Signals(NamedTuple):
    """The readings of the sensors, shape (samples,) each.

    Attributes
    ----------
    time_s:
        At equal steps, as in the file.
    acceleration_m_per_s2:
        At the measurement point, positive upward, the sensor's offset in it.
    laser_mm:
        Reading of the laser at the measurement point, growing as the axle goes down.
    load_kN:
        Of the cylinder, positive into the rollers.
    """

    time_s: Samples
    acceleration_m_per_s2: Samples
    laser_mm: Samples
    load_kN: Samples

    @property
    def dt_s(self) -> float:
        """Spacing of the samples, s."""
        return float((self.time_s[-1] - self.time_s[0]) / (len(self.time_s) - 1))


def find_channels(raw: RawSignals, rig: Rig) -> Signals:
    """Return the three channels of a recording in units and signs.

    Parameters
    ----------
    raw:
        What a file holds; channels are sought by name, as the rig file says, in the one segment that has all three.
        Where an engineering channel is missing, its voltage goes through the rig's calibration line.
    rig:
        Names, signs and calibration lines.

    Raises
    ------
    BadInput
        If a channel is missing or stands twice, has no reading somewhere, never changes or is clipped; if its times
        are not those of the others, have a gap, are uneven or of another unit; and if there are several recordings.
        The message names the channel and what the file has.
    """
    recordings, faults = [], []
    for segment in raw.segments:
        try:
            recordings.append([_find(segment, sensor) for sensor in sensors_of(rig)])
        except BadInput as error:
            faults.append(error)
    if len(recordings) > 1:
        raise BadInput(f"holds {len(recordings)} recordings, one after the other; cut it into a file each")
    if not recordings:
        raise faults[0] if faults else BadInput("holds no channel; record it again")
    return _together(recordings[0])


def _find(segment: Sequence[Channel], sensor: Sensor) -> Channel:
    """Return a sensor's channel in engineering units, sign turned."""
    sign = 1.0 if sensor.positive else -1.0
    ways = [(sensor.channel, lambda values: values), *([(sensor.voltage, sensor.line)] if sensor.line else [])]
    for wanted, convert in ways:
        matches = [channel for channel in segment if channel.name.strip() == wanted.strip()]
        if len(matches) > 1:
            raise BadInput(f"channel {wanted!r} stands {len(matches)} times; give each channel a name of its own")
        if matches and not np.isnan(matches[0].values).all():
            channel = matches[0]
            return replace(channel, name=wanted, values=sign * convert(channel.values))
    has = ", ".join(repr(channel.name) for channel in segment[:12])
    if sensor.line is None:
        raise BadInput(
            f"has no channel {sensor.channel!r}, but {has}; mend [channels] of the rig file, or give it a line for "
            f"{sensor.voltage!r} in [calibration]"
        )
    raise BadInput(
        f"has neither channel {sensor.channel!r} nor {sensor.voltage!r}, but {has}; mend [channels] of the rig file"
    )


def _together(channels: Sequence[Channel]) -> Signals:
    first = channels[0]
    if len(first.values) < LEAST_SAMPLES:
        raise BadInput(f"channel {first.name!r}: {len(first.values)} samples hold no step; record it again")
    for channel in channels:
        if len(channel.values) != len(first.values):
            raise BadInput(
                f"channel {channel.name!r} has {len(channel.values)} samples and {first.name!r} has "
                f"{len(first.values)}; record them together"
            )
        missing = np.flatnonzero(~np.isfinite(channel.values))
        if len(missing):
            raise BadInput(
                f"channel {channel.name!r}: no reading in {len(missing)} of {len(channel.values)} samples, the first "
                f"is sample {missing[0] + 1}; mend the file"
            )
        if np.ptp(channel.values) == 0:
            raise BadInput(f"channel {channel.name!r}: reads {channel.values[0]:g} in every sample; check the sensor")
    _check_times(channels)
    _check_clipping(first)
    return Signals(first.time_s, *(channel.values for channel in channels))


def _check_times(channels: Sequence[Channel]) -> None:
    time, name = channels[0].time_s, channels[0].name
    steps = np.diff(time)
    dt = float(np.median(steps))
    if not (np.isfinite(time).all() and dt > 0):
        raise BadInput(f"channel {name!r}: time does not run forward; mend the X column")
    if dt > COARSEST_S * _ROUNDED or dt * len(time) < SHORTEST_S:
        raise BadInput(
            f"channel {name!r}: {len(time)} samples {dt:g} s apart are {dt * len(time):g} s; a step takes some 0.04 s, "
            f"and needs samples {COARSEST_S:g} s apart or less, and rest about it: is there a time column, in seconds?"
        )
    uneven = channels[0].uneven_steps
    if len(uneven):
        raise BadInput(
            f"channel {name!r}: samples are {dt:g} s apart, but {steps[uneven[0]]:g} s at {time[uneven[0]]:g} s (and "
            f"{len(uneven) - 1} more places); time needs equal steps"
        )
    contradicted = next((channel for channel in channels if channel.contradicting_dt_s is not None), None)
    if contradicted is not None:
        raise BadInput(
            f"channel {contradicted.name!r}: samples are {contradicted.dt_s:.6g} s apart in the X column, but "
            f"{contradicted.contradicting_dt_s:.6g} s by Delta_X; mend the one that is wrong"
        )
    for other in channels[1:]:
        apart = float(np.abs(other.time_s - time).max())
        if not apart <= _JITTER * dt:
            raise BadInput(
                f"channels {name!r} and {other.name!r} are up to {apart:g} s apart in time; record them together"
            )


def _check_clipping(acceleration: Channel) -> None:
    values, dt_s = acceleration.values, float(np.median(np.diff(acceleration.time_s)))
    for end in (values.max(), values.min()):
        at = np.flatnonzero(np.diff(np.concatenate([[0], values == end, [0]])))
        longest = int((at[1::2] - at[::2]).max())
        if longest >= max(_CLIPPED, _CLIPPED_S / dt_s) and end != np.median(values):
            raise BadInput(
                f"channel {acceleration.name!r}: clipped, it stays at {end:g} m/s^2 for {longest} samples; record it "
                "again with a wider range"
            )
