"""Fits without a posterior, one record or test at a time (`lsq`, `load-deflection`), as their folders hold them."""

import re
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.record import ORIGIN_UNKNOWN
from bayes_tyre.results.columns import numbers, texts
from bayes_tyre.results.provenance import RUN_JSON

_LAW = ("k_kN_per_mm", "x_less_k_beta_kN", "x_kN", "beta_mm", "energy_per_cycle_J", "loop_area_J")
_SLOW = ("test", "k_loading_kN_per_mm", "k_unloading_kN_per_mm", *_LAW)
_SHARED = ("k_kN_per_mm_tests", "k_kN_per_mm_steps", "k_kN_per_mm_combined", "tension")
_CYCLES = ("travel_mm", "energy_J", "law_energy_J", "k_secant_kN_per_mm", "energy_drift", "mean_force_drift_kN")
#: What each file is, and which of its columns are shown before its status.
_SHOWN = {
    "load_deflection.csv": ("slow tests", _SLOW),
    "load_deflection_cases.csv": ("slow tests averaged over repeats", _SLOW),
    "shared_stiffness.csv": ("stiffness shared with step records", ("configuration", "speed_km_h", *_SHARED)),
    "least_squares.csv": ("fits of Equation 2", ("record", "k_kN_per_mm", "C_kN", "beta_mm", "rmse_kN", "points")),
    "loops.csv": ("closed cycles", ("record", "cycle", *_CYCLES)),
}
_TEXTS = ("test", "record", "configuration")
_UNITS = {"kN_per_mm": "kN/mm", "km_h": "km/h", "kN": "kN", "mm": "mm", "J": "J"}
_UNIT = re.compile(rf"_({'|'.join(_UNITS)})(?=_|$)")


class Column(NamedTuple):
    """A column as shown: its name, unit, values (text, or numbers with NaN) and their standard errors (NaN: none)."""

    name: str
    unit: str
    values: pd.Series
    errors: pd.Series
    is_text: bool


class FitTable(NamedTuple):
    """A table of fits: what it is, its columns, the status of each row, and where its data come from."""

    caption: str
    columns: list[Column]
    status: pd.Series
    origin: str

    @property
    def not_ok(self) -> int:
        """How many rows are not ``ok``."""
        return int((self.status != "ok").sum())


def read_separate_fits(folder: Path) -> list[FitTable]:
    """Return the tables of fits in a folder that `lsq` or `load-deflection` wrote; none where a posterior is in it.

    Raises
    ------
    BadInput
        If one is not what the command writes.
    """
    return [] if (folder / RUN_JSON).is_file() else read_fit_tables(folder, tuple(_SHOWN))


def read_fit_tables(folder: Path, names: tuple[str, ...]) -> list[FitTable]:
    """Return the tables of these names that are in a folder, whatever else is there; errors as `read_separate_fits`."""
    return [_table(folder / name) for name in names if (folder / name).is_file()]


def _table(path: Path) -> FitTable:
    caption, shown = _SHOWN[path.name]
    rows = read_table(path)
    missing = [name for name in (*shown, "status") if name not in rows]
    if missing:
        raise BadInput(f"{path}: is not what lsq or load-deflection writes: no column {missing[0]}; run it again")
    origin = " + ".join(sorted(set(texts(rows, "origin")) - {""})) or ORIGIN_UNKNOWN
    return FitTable(caption, [_column(rows, name) for name in shown], texts(rows, "status"), origin)


def _column(rows: pd.DataFrame, name: str) -> Column:
    unit = _UNIT.search(name)
    is_text = name in _TEXTS
    values = texts(rows, name) if is_text else numbers(rows, name)
    title = _UNIT.sub("", name).replace("_", " ")
    return Column(title, _UNITS[unit[1]] if unit else "", values, numbers(rows, f"{name}_se"), is_text)
