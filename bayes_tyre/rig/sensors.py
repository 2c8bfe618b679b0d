"""The three sensors of a rig: what a raw file calls them, their lines from volts, and which way they count."""

from typing import NamedTuple

from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.calibration import Line


class Sensor(NamedTuple):
    """One sensor.

    Attributes
    ----------
    quantity:
        acceleration, displacement or load, as the keys of a rig file begin.
    unit:
        Of its channel: m/s^2, mm or kN.
    channel, voltage:
        Names of the channel in engineering units and of the one in volts; `column 12` of one given by its number.
    line:
        From volts to the unit; None where the rig file has none.
    positive:
        Whether it counts the way its key in `[signs]` says.
    """

    quantity: str
    unit: str
    channel: str
    voltage: str
    line: Line | None
    positive: bool

    def calibration_keys(self) -> tuple[str, str]:
        """Return the keys of its slope and intercept in `[calibration]`."""
        unit = self.unit.replace("/", "_per_").replace("^", "")
        return f"{self.quantity}_slope_{unit}_per_V", f"{self.quantity}_intercept_{unit}"


def sensors_of(rig: Rig) -> tuple[Sensor, Sensor, Sensor]:
    """Return accelerometer, laser and load cell of a rig."""
    return (
        _sensor(rig, "acceleration", "m/s^2", rig.signs.acceleration_positive_upward),
        _sensor(rig, "displacement", "mm", rig.signs.displacement_grows_downward),
        _sensor(rig, "load", "kN", rig.signs.load_positive_into_rollers),
    )


def _sensor(rig: Rig, quantity: str, unit: str, positive: bool) -> Sensor:
    channel, voltage = (_name(getattr(rig.channels, key)) for key in (quantity, f"{quantity}_voltage"))
    sensor = Sensor(quantity, unit, channel, voltage, None, positive)
    slope, intercept = (getattr(rig.calibration, key) for key in sensor.calibration_keys())
    return sensor if slope is None or intercept is None else sensor._replace(line=Line(slope, intercept))


def columns_of(rig: Rig) -> dict[str, int] | None:
    """Return the columns that a rig gives by number, as `bayes_tyre.formats.recordings.raw.read_raw` takes them.

    Returns
    -------
    Channel name, as in `sensors_of`, -> column, counted from 1, the time among them; None where all have names.
    """
    if not rig.channels.by_number:
        return None
    return {
        "time" if key == "time" else _name(column): column for key, column in rig.channels if isinstance(column, int)
    }


def _name(column: str | int) -> str:
    # What readers call a column of a table without names.
    return column if isinstance(column, str) else f"column {column}"
