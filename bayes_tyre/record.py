"""What all rooms share: names of factors, columns and parameters, the case, and the raw signals of a file."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

#: Readings of a recording, one a sample.
Samples = Float[np.ndarray, " samples"]

REQUIRED = ("record", "displacement_mm", "force_kN")
CASE_FACTORS = ("configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN")
FACTORS = (*CASE_FACTORS, "repeat")
DIRECTIONS = ("loading", "unloading")
#: Origins of a table's values; a table without one is shown as `origin not stated`.
ORIGINS = ("measured", "published", "reconstructed", "simulated")
ORIGIN_UNKNOWN = "origin not stated"
#: All that columns of text may hold which may not hold any text.
ALLOWED_TEXTS = {"direction": DIRECTIONS, "origin": ORIGINS}
TEXT_COLUMNS = ("record", "configuration", "direction", "origin")
NUMBER_COLUMNS = ("displacement_mm", "force_kN", "time_s", "speed_km_h", "initial_load_kN", "step_kN", "repeat")
#: Where a moving mass was taken off: that mass (kg), how well it is known (kg), and by how much a force would change
#: with another kilogram of it (kN).
MASS, MASS_SD, FORCE_PER_KG = "mass_kg", "mass_sd_kg", "force_per_kg_kN"
#: Relative standard deviation of an unknown factor on all displacements, or all forces, of a rig.
DISPLACEMENT_SCALE_SD, FORCE_SCALE_SD = "displacement_scale_sd", "force_scale_sd"

#: Units by parameter; the parameters that a record has. Those after `sigma` are of motions; `settled` is x - k beta.
RECORD_UNITS = {
    **{"k": "kN/mm", "beta": "mm", "J": "kN", "C": "kN", "F_i": "kN", "sigma": "kN"},
    **{"x": "kN", "settled": "kN", "n": "1", "m": "kg", "c": "kN s/mm", "energy_per_cycle": "J"},
    **{"belt_frequency": "Hz", "belt_damping": "1", "sidewall_ratio": "1"},
}
#: The parameters of force laws that a motion can have, in the order of tables; those of its axle; and energy lost.
LAW_PARAMETERS = ("k", "x", "settled", "beta", "n", "belt_frequency", "belt_damping", "sidewall_ratio")
AXLE_PARAMETERS = ("m", "c")
ENERGY = "energy_per_cycle"
#: Half the stroke of free vibration, mm at the wheel centre: a ring-down ends in tenths of a millimetre.
RING_DOWN_MM = 0.1
#: How a fit's note begins that another law may hold as well.
EITHER_LAW = "beta: the records do not tell "
#: A sample may lie so much closer to the next one than the median, or further apart, as a share of it.
_JITTER = 0.1


def parameter_column(parameter: str) -> str:
    """Return the column of a table that holds a parameter: its name and its unit, such as ``k_kN_per_mm``."""
    unit = RECORD_UNITS[parameter].replace("/", "_per_").replace(" ", "_")
    return parameter if unit == "1" else f"{parameter}_{unit}"


def means_of_blocks(values: Float[np.ndarray, "... samples"], length: int) -> Float[np.ndarray, "... blocks"]:
    """Return the means of blocks of `length` samples of channels; an incomplete last block is dropped."""
    blocks = values.shape[-1] // length
    return values[..., : blocks * length].reshape(*values.shape[:-1], blocks, length).mean(axis=-1)


class Case(NamedTuple):
    """The test conditions of a record: all its factors but the repeat (km/h, kN; `step_kN` is signed)."""

    configuration: str
    direction: str
    speed_km_h: float
    initial_load_kN: float
    step_kN: float

    @property
    def label(self) -> str:
        """The case in the source's notation, such as ``single (0)30-20``, as far as its factors are given."""
        given = {name: value for name, value in self._asdict().items() if value == value and value is not None}
        names = [self.configuration] if self.configuration else []
        if "step_kN" not in given and self.direction:
            names.append(self.direction)
        speed = f"({self.speed_km_h:g})" if "speed_km_h" in given else ""
        if {"initial_load_kN", "step_kN"} <= given.keys():
            names.append(f"{speed}{self.initial_load_kN:g}-{self.initial_load_kN + self.step_kN:g}")
        else:
            words = {"initial_load_kN": "load", "step_kN": "step"}
            loads = [f"{word} {given[name]:g} kN" for name, word in words.items() if name in given]
            names += [part for part in (speed, *loads) if part]
        return " ".join(names) or "all records"

    @property
    def group(self) -> str:
        """The name of its group: configuration and direction, as far as they are given."""
        return f"{self.configuration or ''} {self.direction or ''}".strip()

    @property
    def conditions(self) -> str:
        """The case in words, as far as its factors are given: ``dual, unloading, 25 km/h, load 30 kN, step -10 kN``."""
        units = {"speed_km_h": "{:g} km/h", "initial_load_kN": "load {:g} kN", "step_kN": "step {:g} kN"}
        given = {name: value for name, value in self._asdict().items() if value == value and value not in (None, "")}
        return ", ".join(units.get(name, "{}").format(value) for name, value in given.items())

    def record(self, repeat: int) -> str:
        """Return the source's name for a record of the case, such as ``S(0)30-20(1)`` (S = single, D = dual)."""
        loads = f"{self.initial_load_kN:g}-{self.initial_load_kN + self.step_kN:g}"
        return f"{self.configuration[0].upper()}({self.speed_km_h:g}){loads}({repeat})"


@dataclass(frozen=True)
class Channel:
    """One channel of one segment, as in the file.

    Attributes
    ----------
    name, unit:
        As written in the file; empty where there is none.
    time_s:
        Shape (samples,): X of each sample, as read or from X0 and Delta_X.
    values:
        Shape (samples,); NaN where the cell is blank or NaN.
    declared_samples:
        Number of samples by the header; None where it gives none.
    contradicting_dt_s:
        Spacing of the samples by the header, where X has another and its printed digits do not explain it; else None.
    """

    name: str
    unit: str
    time_s: Float[np.ndarray, " samples"]
    values: Float[np.ndarray, " samples"]
    declared_samples: int | None = None
    contradicting_dt_s: float | None = None

    @property
    def dt_s(self) -> float:
        """Median spacing of the samples; NaN with fewer than two."""
        return float(np.median(self._steps_s)) if len(self.time_s) > 1 else float("nan")

    @property
    def uneven_steps(self) -> Int[np.ndarray, " steps"]:
        """Indices of samples whose next one comes before them, with them, or over 10 % off the median spacing."""
        steps_s, dt_s = self._steps_s, self.dt_s
        off = np.abs(steps_s - dt_s) > _JITTER * dt_s
        return np.flatnonzero(off | ~(steps_s > 0))

    @property
    def _steps_s(self) -> Float[np.ndarray, " steps"]:
        with np.errstate(all="ignore"):  # a damaged file may hold infinite times
            return np.diff(self.time_s)


@dataclass(frozen=True)
class RawSignals:
    """The signals of one raw file, from any reader or from the simulator.

    Attributes
    ----------
    segments:
        Channels that were recorded together; a file of one recording has one segment.
    warnings:
        Irregularities of the file that did not prevent reading: a sentence each.
    notes:
        Comments in the file, such as that it was simulated.
    """

    segments: tuple[tuple[Channel, ...], ...]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
