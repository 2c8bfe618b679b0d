"""The result of a processing method: a record's columns, its scalars, and the recording for figures."""

from typing import NamedTuple

from bayes_tyre.record import FORCE_PER_KG, Samples
from bayes_tyre.signals.channels import Signals
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.signals.runout import Turning
from bayes_tyre.signals.steps import Step


class Recording(NamedTuple):
    """A recording ready for a method: factors, channels (as read, runout removed), step, runout's size, bodies."""

    factors: RecordFactors
    raw: Signals
    signals: Signals
    step: Step
    runout_rms_m_per_s2: float
    bodies: tuple[Turning, ...] = ()

    def for_motion(self) -> tuple[float, Samples, Samples, Samples, int, tuple[float, float], tuple[Turning, ...]]:
        """Return what a motion is fitted to, channels as read (`inference.motion.record.model.window.Recorded`)."""
        read, step = self.raw, self.step
        channels = read.acceleration_m_per_s2, read.laser_mm, read.load_kN
        return read.dt_s, *channels, step.pre_step, (step.ramp.start_s, step.ramp.end_s), self.bodies


class Processed(NamedTuple):
    """A record on flat ground.

    Attributes
    ----------
    factors:
        Its name, case and repeat.
    time_s, displacement_mm, force_kN, displacement_sd_mm, force_sd_kN:
        Shape (points,); time is the file's. The standard deviations are those of the noise before the step.
    force_per_kg_kN:
        Shape (points,): by how much each force would change had a kilogram more been taken off as moving mass; None
        where none was.
    extras:
        A number or text for the record, by column name.
    recording:
        Its source, for figures.
    """

    factors: RecordFactors
    time_s: Samples
    displacement_mm: Samples
    force_kN: Samples
    displacement_sd_mm: Samples
    force_sd_kN: Samples
    extras: dict[str, float | str]
    recording: Recording
    force_per_kg_kN: Samples | None = None

    def columns(self) -> dict[str, object]:
        """Return the columns of a record table, factors and extras repeated on every row."""
        return {
            **self.factors.row(),
            "time_s": self.time_s,
            "displacement_mm": self.displacement_mm,
            "force_kN": self.force_kN,
            "displacement_sd_mm": self.displacement_sd_mm,
            "force_sd_kN": self.force_sd_kN,
            **({} if self.force_per_kg_kN is None else {FORCE_PER_KG: self.force_per_kg_kN}),
            **self.extras,
        }


def clarity(step: Step) -> dict[str, float | str]:
    """Return the signal-to-noise ratios of a step as extras."""
    return {
        "load_change_kN": step.change_kN,
        "load_clarity": step.load_clarity,
        "acceleration_clarity": step.acceleration_clarity,
    }
