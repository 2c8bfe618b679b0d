"""Calibration lines from a raw file that holds volts beside engineering units."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tomli_w
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, write_text
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.plain_text import one_line, path_text
from bayes_tyre.record import Channel
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.rig.calibration import Line, fit_line, quantisation_step, residual_rms, with_best_signs
from bayes_tyre.rig.sensors import Sensor, columns_of, sensors_of

Readings = Float[np.ndarray, " rows"]
#: Residual of a good line, in steps of the digitiser (root mean square); rounding of both readings leaves less than 1.
_FEW_STEPS = 3.0
#: Signs seem lost where restoring them lowers the residual to this share.
_FAR_BETTER = 0.2


class Fitted(NamedTuple):
    """One sensor's line.

    Attributes
    ----------
    sensor:
        Names and unit.
    line:
        unit / V and unit.
    residual_rms:
        Root mean square of the residuals, in the unit.
    volts_step, unit_step:
        Step of the digitiser, V and the unit; NaN where all readings are equal.
    rows, mended:
        Rows with both readings, and the number of restored minus signs among them.
    mended_rms:
        Root mean square of the residuals with the best signs.
    """

    sensor: Sensor
    line: Line
    residual_rms: float
    volts_step: float
    unit_step: float
    rows: int
    mended: int
    mended_rms: float

    def warning(self) -> str:
        """Return why the line may be wrong; empty where its residual is as small as rounding allows."""
        # The coarser of the two steps: readings and volts may be printed with different numbers of digits.
        step = np.nanmax([self.unit_step, abs(self.line.slope) * self.volts_step, 0.0])
        if not self.residual_rms > _FEW_STEPS * step:
            return ""
        unit = self.sensor.unit
        steps = f", {self.residual_rms / step:.2g} steps of its converter" if step else ""
        text = f"the line of the {self.sensor.quantity} leaves {self.residual_rms:.2g} {unit}{steps}"
        if self.mended_rms <= _FAR_BETTER * self.residual_rms:
            return f"{text}; minus signs seem lost, with --mend-signs it leaves {self.mended_rms:.2g} {unit}"
        return f"{text}; look whether {self.sensor.channel!r} belongs to {self.sensor.voltage!r}"


def calibrate(raw: Path, rig: str | None, mend_signs: bool, out: Path | None) -> tuple[list[Fitted], list[str]]:
    """Return the lines of all sensors that can be calibrated, and notes; write `[calibration]` to `out`.

    Notes say how the file differs from its header, why a sensor has no line, and which lines may be wrong.

    Parameters
    ----------
    raw:
        A recording with a channel in volts and one in engineering units for each sensor.
    rig:
        Name or TOML file whose `[channels]` name the channels; None for their defaults.
    mend_signs:
        Whether to restore minus signs lost in print, where that puts a sensor's readings on a line.
    out:
        A `.toml` file, or None.

    Raises
    ------
    BadInput
        If the file, the rig or `out` cannot be used, or no sensor has a line; nothing is written then.
    """
    if out is not None:
        if out.is_dir() or out.suffix.lower() != ".toml":
            raise BadInput(f"--out {out}: is no .toml file; name one")
        check_folder(out.parent)
    # The channels that both embedded rigs name are the defaults.
    machine = load_rig(rig if rig is not None else "single")
    sensors = sensors_of(machine)
    recording = read_raw(raw, columns_of(machine))
    lines: list[Fitted] = []
    notes = [f"{path_text(raw)}: {text}" for text in recording.warnings]
    for sensor in sensors:
        try:
            lines.append(_fit(recording.segments, sensor, mend_signs))
        except BadInput as error:
            notes.append(f"{path_text(raw)}: no line of the {sensor.quantity}: {error}")
    if not lines:
        raise BadInput(f"{notes[-len(sensors)]} (and no other sensor has a line)")
    notes += [f"{path_text(raw)}: {warning}" for fitted in lines if (warning := fitted.warning())]
    if out is not None:
        write_text(_section(raw, lines), out)
    return lines, notes


def _fit(segments: Sequence[Sequence[Channel]], sensor: Sensor, mend: bool) -> Fitted:
    volts, values = _pair(segments, sensor)
    both = np.isfinite(volts) & np.isfinite(values)
    if both.sum() < 2:
        raise BadInput(
            f"{both.sum()} of {len(both)} rows have a reading of both {sensor.voltage!r} and {sensor.channel!r}; "
            "record it again"
        )
    volts, values = volts[both], values[both]
    try:
        signed = with_best_signs(volts, values) if mend else values
        line = fit_line(volts, signed)
        best = with_best_signs(volts, values) if len(np.unique(volts)) > 2 else signed
    except ValueError as error:
        alike = f"all {len(volts)} readings of {sensor.voltage!r} lie within {np.ptp(volts):g} V: {error}"
        raise BadInput(f"{alike}; record it while the sensor moves") from None
    steps = [quantisation_step(each) if np.ptp(each) > 0 else np.nan for each in (volts, signed)]
    rms, mended_rms = (residual_rms(fit_line(volts, each), volts, each) for each in (signed, best))
    mended = int((signed != values).sum())
    return Fitted(sensor, line, rms, *steps, rows=len(volts), mended=mended, mended_rms=mended_rms)


def _pair(segments: Sequence[Sequence[Channel]], sensor: Sensor) -> tuple[Readings, Readings]:
    """Return the voltage and the value of the first segment that has both."""
    names = (sensor.voltage, sensor.channel)
    for segment in segments:
        volts, values = ([channel for channel in segment if channel.name.strip() == name.strip()] for name in names)
        for name, channels in zip(names, (volts, values), strict=True):
            if len(channels) > 1:
                raise BadInput(f"channel {name!r} stands {len(channels)} times; give each channel a name of its own")
        if volts and values:
            # Readers drop blank rows at a channel's end: only rows that both channels have are paired.
            rows = min(len(volts[0].values), len(values[0].values))
            if not np.array_equal(volts[0].time_s[:rows], values[0].time_s[:rows], equal_nan=True):
                raise BadInput(f"{names[0]!r} and {names[1]!r} have different times; record them together")
            return volts[0].values[:rows], values[0].values[:rows]
    present = {channel.name.strip() for segment in segments for channel in segment}
    absent = " and ".join(repr(name) for name in names if name.strip() not in present)
    what = f"no channel {absent}" if absent else f"{names[0]!r} and {names[1]!r} in no one segment"
    raise BadInput(f"has {what}; mend [channels] of the rig file, or name another file")


def _section(raw: Path, lines: Sequence[Fitted]) -> str:
    """Return the `[calibration]` section of a rig file."""
    keys: dict[str, float] = {}
    for fitted in lines:
        keys |= dict(zip(fitted.sensor.calibration_keys(), fitted.line, strict=True))
    source = one_line(path_text(raw), None)
    return f"# Least-squares lines from {source}: a section of a rig file.\n{tomli_w.dumps({'calibration': keys})}"
