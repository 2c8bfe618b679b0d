"""The vocabulary: words of a record, columns of a record table, the case, and raw signals as a file holds them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

REQUIRED = ("record", "displacement_mm", "force_kN")
CASE_FACTORS = ("configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN")
FACTORS = (*CASE_FACTORS, "repeat")
DIRECTIONS = ("loading", "unloading")
#: Where the numbers of a table come from; a table that does not say is shown as `origin not stated`.
ORIGINS = ("measured", "published", "reconstructed", "simulated")
ORIGIN_UNKNOWN = "origin not stated"
TEXT_COLUMNS = ("record", "configuration", "direction", "origin")
NUMBER_COLUMNS = ("displacement_mm", "force_kN", "time_s", "speed_km_h", "initial_load_kN", "step_kN", "repeat")


class Case(NamedTuple):
    """What was tested: everything that names a record but its repeat (km/h, kN; `step_kN` is signed)."""

    configuration: str
    direction: str
    speed_km_h: float
    initial_load_kN: float
    step_kN: float

    @property
    def label(self) -> str:
        """The source's way of writing a case, such as ``single (0)30-20``, as far as the words are known."""
        known = {name: value for name, value in self._asdict().items() if value == value and value is not None}
        parts = [self.configuration] if self.configuration else []
        if "step_kN" not in known and self.direction:
            parts.append(self.direction)
        speed = f"({self.speed_km_h:g})" if "speed_km_h" in known else ""
        if {"initial_load_kN", "step_kN"} <= known.keys():
            loads = f"{self.initial_load_kN:g}-{self.initial_load_kN + self.step_kN:g}"
        else:
            loads = " ".join(f"{name} {known[name]:g}" for name in ("initial_load_kN", "step_kN") if name in known)
        return " ".join([*parts, *([speed + loads] if speed + loads else [])]) or "all records"


@dataclass(frozen=True)
class Channel:
    """One channel of one segment, as the file has it.

    Attributes
    ----------
    name, unit:
        As written in the file; empty where it says nothing.
    time_s:
        Shape (samples,): X of each sample, as read or from X0 and Delta_X.
    values:
        Shape (samples,); NaN where the cell is blank or says so.
    declared_samples:
        What the header promises; None where it promises nothing.
    """

    name: str
    unit: str
    time_s: Float[np.ndarray, " samples"]
    values: Float[np.ndarray, " samples"]
    declared_samples: int | None = None

    @property
    def dt_s(self) -> float:
        """Median spacing of the samples; NaN with fewer than two."""
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else float("nan")


@dataclass(frozen=True)
class RawSignals:
    """What one raw file holds, from whatever reader, or from the simulator.

    Attributes
    ----------
    segments:
        Channels that were recorded together; a file of one recording has one.
    remarks:
        What is odd about the file but could be read all the same: a sentence each.
    notes:
        What the file says of itself in words, such as that it was simulated.
    """

    segments: tuple[tuple[Channel, ...], ...]
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
