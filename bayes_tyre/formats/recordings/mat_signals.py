"""Raw signals from MATLAB files (`.mat`): vectors, or structs of them, beside a vector of times."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.channels import grouped_warnings
from bayes_tyre.formats.recordings.channel_groups import segments_of
from bayes_tyre.formats.recordings.mat_variables import read_mat
from bayes_tyre.formats.x_column import is_time, seconds_per_unit
from bayes_tyre.record import Channel, RawSignals

type _Leaves = Mapping[str, np.ndarray | str]

#: Fields that hold the readings of a struct which is one channel, as Simulink has it.
_READINGS = ("data", "value", "values")
_NO_TIME = "no vector of times has its length: its time counts samples, not seconds"


def read_mat_signals(path: Path) -> RawSignals:
    """Return the vectors of a MATLAB file as channels, those of a struct after one another.

    Times are the vector with a name such as `time` of the same length in the same struct, else in those around it.
    A struct with the field `data` or `values` is one channel. Units are text: `unit` in such a struct, else
    `NAME_unit` or `unit.NAME` beside `NAME`.

    Raises
    ------
    BadInput
        If the file cannot be read, or holds no vector of numbers beside times.
    """
    leaves, groups, warnings = read_mat(path), {}, []
    clocks = _clocks(leaves)
    for name, values in leaves.items():
        if isinstance(values, str) or values.ndim == 0 or name in clocks.get(_owner(name), ()):
            continue
        owner, label, unit = _described(name, leaves)
        if values.ndim > 1:
            warnings.append((label, "is a matrix: left out; save a vector a channel"))
            continue
        time_s = _times(name, len(values), clocks, leaves)
        warnings += [(label, _NO_TIME)] if time_s is None else []
        times = np.arange(len(values), dtype=float) if time_s is None else time_s
        groups.setdefault(owner, []).append(Channel(label, unit, times, values.astype(float)))
    if not groups:
        raise BadInput(f"{path}: holds no vector of numbers beside times; save vectors, or a struct of them, no object")
    return RawSignals(segments_of(groups.values()), tuple(grouped_warnings(warnings)))


def _owner(name: str) -> str:
    return name.rpartition(".")[0]


def _last(name: str) -> str:
    return name.rpartition(".")[2]


def _clocks(leaves: _Leaves) -> dict[str, list[str]]:
    """Return the vectors of times of each struct; one called `x` is none where another is named for time."""
    clocks: dict[str, list[str]] = {}
    for name, values in leaves.items():
        if isinstance(values, np.ndarray) and values.ndim == 1 and is_time(_last(name)):
            clocks.setdefault(_owner(name), []).append(name)
    return {
        owner: [name for name in names if not _last(name).lower().startswith("x")] or names
        for owner, names in clocks.items()
    }


def _described(name: str, leaves: _Leaves) -> tuple[str, str, str]:
    """Return the struct that a channel belongs to, its name and its unit."""
    owner, field = _owner(name), _last(name)
    if owner and field.lower() in _READINGS:
        label = _text(leaves, (f"{owner}.name", f"{owner}.label")) or _last(owner)
        return _owner(owner), label, _text(leaves, (f"{owner}.unit", f"{owner}.units"))
    around = f"{owner}." if owner else ""
    keys = (f"{name}_unit", f"{name}_units", f"{around}unit.{field}", f"{around}units.{field}")
    return owner, field, _text(leaves, keys)


def _text(leaves: _Leaves, keys: tuple[str, ...]) -> str:
    return next((text.strip() for key in keys if isinstance(text := leaves.get(key), str)), "")


def _times(name: str, samples: int, clocks: Mapping[str, list[str]], leaves: _Leaves) -> np.ndarray | None:
    """Return the vector of times (s) that belongs to a vector."""
    owner = name
    while owner:
        owner = _owner(owner)
        for clock in clocks.get(owner, ()):
            times = leaves[clock]
            if isinstance(times, np.ndarray) and len(times) == samples:
                return times * seconds_per_unit(_last(clock), _described(clock, leaves)[2])
    return None
