"""A vertical test in a TYDEX file as one record, and one load-deflection test, of a table."""

from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tydex.reader import read_tydex
from bayes_tyre.formats.tydex.write import Tydex
from bayes_tyre.plain_text import listed, one_line, quoted

#: What one of a unit, in lower case, is in kN, mm or s.
_KN = {"n": 1e-3, "kn": 1.0}
_MM = {"m": 1e3, "cm": 10.0, "mm": 1.0}
_S = {"s": 1.0, "ms": 1e-3}
#: Part of the readings of a force that must be negative for its sign to be another convention's.
_NEGATIVE = 0.9


def read_tydex_table(path: Path) -> pd.DataFrame:
    """Return the readings of a vertical test, a row each, as a record table and a load-deflection table need them.

    `record` and `test` are the header's MEASID, or the name of the file; `force_kN` and `load_kN` are FZW, positive
    where the ground presses on the tyre: where nine of ten readings are negative, the sign is turned. `displacement_mm`
    is TYREDEFW; without it, how far DSTGRWHC, the height of the wheel centre, has fallen since the first reading.
    `time_s` is RUNTIME. Constants that are numbers are further columns, such as `INFLPRES_bar`.

    Raises
    ------
    BadInput
        For a file that cannot be read, lacks a channel, or has one in another unit.
    """
    file = read_tydex(path)
    names = [channel.name for channel in file.channels]
    lacks = next((of for of in (("FZW",), ("TYREDEFW", "DSTGRWHC")) if not {*of} & {*names}), None)
    if lacks:
        raise BadInput(
            f"{path}: has no channel {' or '.join(lacks)}, but {listed(names, show=one_line)}; give a vertical test"
        )
    force = _values(path, file, "FZW", _KN)
    force = -force if np.mean(force < 0) > _NEGATIVE else force
    if "TYREDEFW" in names:
        displacement = _values(path, file, "TYREDEFW", _MM)
    else:
        height = _values(path, file, "DSTGRWHC", _MM)
        displacement = height[0] - height
    name = file.header.get("MEASID") or path.stem
    columns = {"record": name, "test": name, "displacement_mm": displacement, "force_kN": force, "load_kN": force}
    columns |= {"time_s": _values(path, file, "RUNTIME", _S)} if "RUNTIME" in names else {}
    for constant in file.constants:
        number = pd.to_numeric(constant.value.replace(",", "."), errors="coerce")
        if np.isfinite(number):
            columns[f"{constant.name}_{constant.unit}".rstrip("_-").replace("/", "_per_")] = float(number)
    return pd.DataFrame(columns)


def _values(path: Path, file: Tydex, name: str, units: dict[str, float]) -> np.ndarray:
    """Return a channel in the unit that has the factor 1."""
    channel = next(channel for channel in file.channels if channel.name == name)
    if channel.unit.lower() not in units:
        raise BadInput(f"{path}: channel {name} is in {quoted(channel.unit)}; give it in one of {', '.join(units)}")
    return channel.values * units[channel.unit.lower()]
