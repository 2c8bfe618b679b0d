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
    names, lines, signs = rig.channels, rig.calibration, rig.signs
    return (
        Sensor(
            "acceleration",
            "m/s^2",
            _name(names.acceleration),
            _name(names.acceleration_voltage),
            _line(lines.acceleration_slope_m_per_s2_per_V, lines.acceleration_intercept_m_per_s2),
            signs.acceleration_positive_upward,
        ),
        Sensor(
            "displacement",
            "mm",
            _name(names.displacement),
            _name(names.displacement_voltage),
            _line(lines.displacement_slope_mm_per_V, lines.displacement_intercept_mm),
            signs.displacement_grows_downward,
        ),
        Sensor(
            "load",
            "kN",
            _name(names.load),
            _name(names.load_voltage),
            _line(lines.load_slope_kN_per_V, lines.load_intercept_kN),
            signs.load_positive_into_rollers,
        ),
    )


def columns_of(rig: Rig) -> dict[str, int] | None:
    """Return the columns that a rig gives by number, as `bayes_tyre.formats.raw.read_raw` takes them.

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


def _line(slope: float | None, intercept: float | None) -> Line | None:
    return None if slope is None or intercept is None else Line(slope, intercept)
