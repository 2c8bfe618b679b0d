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
        Names of the channel in engineering units and of the one in volts.
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
            names.acceleration,
            names.acceleration_voltage,
            _line(lines.acceleration_slope_m_per_s2_per_V, lines.acceleration_intercept_m_per_s2),
            signs.acceleration_positive_upward,
        ),
        Sensor(
            "displacement",
            "mm",
            names.displacement,
            names.displacement_voltage,
            _line(lines.displacement_slope_mm_per_V, lines.displacement_intercept_mm),
            signs.displacement_grows_downward,
        ),
        Sensor(
            "load",
            "kN",
            names.load,
            names.load_voltage,
            _line(lines.load_slope_kN_per_V, lines.load_intercept_kN),
            signs.load_positive_into_rollers,
        ),
    )


def _line(slope: float | None, intercept: float | None) -> Line | None:
    return None if slope is None or intercept is None else Line(slope, intercept)
