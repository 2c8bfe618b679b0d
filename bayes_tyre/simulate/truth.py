"""What is true of a simulated record: every parameter of the motion and of the sensors, and its row of `truth.csv`."""

from dataclasses import asdict, dataclass, field
from typing import NamedTuple

from bayes_tyre.simulate.plan import Planned


class Harmonic(NamedTuple):
    """One harmonic of a turning body: amplitude, mm, and phase, rad, of its sine at the first sample."""

    amplitude_mm: float
    phase_rad: float


class Runout(NamedTuple):
    """What moves the ground under a rolling tyre; the default is one that stands.

    Attributes
    ----------
    wheel_turn_Hz, roller_turn_Hz:
        Turns a second.
    wheel_harmonics, roller_harmonics:
        Of the turn, the first one first.
    road_noise_mm, road_slope:
        Standard deviation of what is not periodic; its amplitudes fall as 1 / frequency to this power.
    """

    wheel_turn_Hz: float = 0.0
    roller_turn_Hz: float = 0.0
    wheel_harmonics: tuple[Harmonic, ...] = ()
    roller_harmonics: tuple[Harmonic, ...] = ()
    road_noise_mm: float = 0.0
    road_slope: float = 1.0


@dataclass(frozen=True)
class Truth:
    """What is true of one simulated record; units in the names, forces and displacements down positive.

    Attributes
    ----------
    plan, seed:
        The record, and the seed that all draws start from.
    k_kN_per_mm, C_kN, x_kN, beta_mm:
        Of `laws.fancher.Fancher`, on flat ground.
    m_kg, c_kN_s_per_mm:
        Of the axle, at the wheel centre.
    rest_friction_kN:
        Tyre force less k d + C while all is at rest, before the wheels turn, on flat ground.
    load_before_kN, load_after_kN:
        Of the cylinder; the source's set points were not met exactly.
    step_start_s, rise_time_s, load_shape:
        Of the load's step: when it begins, how long it takes, and a name in `drive.SHAPES`.
    runout:
        Under the tyre.
    acceleration_offset_m_per_s2, laser_at_first_touch_mm:
        Readings of accelerometer and laser with the axle at rest where tyre and rollers just touch.
    noise_acceleration_m_per_s2, noise_displacement_mm, noise_load_kN:
        Standard deviations before the converter.
    """

    plan: Planned
    seed: int
    k_kN_per_mm: float
    C_kN: float
    x_kN: float
    beta_mm: float
    m_kg: float
    c_kN_s_per_mm: float
    rest_friction_kN: float
    load_before_kN: float
    load_after_kN: float
    step_start_s: float
    rise_time_s: float
    acceleration_offset_m_per_s2: float
    laser_at_first_touch_mm: float
    noise_acceleration_m_per_s2: float
    noise_displacement_mm: float
    noise_load_kN: float
    runout: Runout = field(default_factory=Runout)
    load_shape: str = "raised cosine"

    def row(self) -> dict[str, object]:
        """Return its row of `truth.csv`: file, factors, every number with its unit in the name; no tuples."""
        plan, values = self.plan, asdict(self)
        del values["plan"], values["runout"]
        turns = {"wheel_turn_Hz": self.runout.wheel_turn_Hz, "roller_turn_Hz": self.runout.roller_turn_Hz}
        for body in ("wheel", "roller"):
            for order, (amplitude, phase) in enumerate(getattr(self.runout, f"{body}_harmonics"), start=1):
                turns |= {f"{body}_runout_{order}_mm": amplitude, f"{body}_runout_{order}_rad": phase}
        factors = {"file": plan.file, "record": plan.record, **plan.case._asdict(), "repeat": plan.repeat}
        recording = {"duration_s": plan.duration_s, "rate_Hz": plan.rate_Hz}
        road = {"road_noise_mm": self.runout.road_noise_mm, "road_slope": self.runout.road_slope}
        return {**factors, **recording, **values, **turns, **road}
