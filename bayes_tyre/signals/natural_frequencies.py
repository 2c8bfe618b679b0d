"""The table of measured natural frequencies, checked: a row a mode and condition."""

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import line_of, quoted
from bayes_tyre.record import ORIGINS
from bayes_tyre.record_table import check_columns, numbers_in

REQUIRED = ("mode", "frequency_Hz")
CONDITIONS = ("pressure_bar", "speed_km_h", "wave")
#: With the rotation and against it.
WAVES = {"forward": 1.0, "backward": -1.0}
#: What the numbers of each column must be.
_NUMBERS = {
    "mode": "a whole number of 0 or more",
    "frequency_Hz": "a number above 0",
    "standard_deviation_Hz": "a number above 0",
    "pressure_bar": "a number above 0",
    "speed_km_h": "a number of 0 or more",
}
_TEXTS = {"wave": (*WAVES, ""), "origin": ORIGINS}


def check_natural_frequencies(table: pd.DataFrame, name: str = "table of natural frequencies") -> pd.DataFrame:
    """Return the table with its columns typed.

    Parameters
    ----------
    table:
        `mode` (waves around the ring: 0 turns it about the rim, 1 moves it as a whole), `frequency_Hz`; optional
        `standard_deviation_Hz`, `pressure_bar`, `speed_km_h`, `wave` (``forward`` or ``backward``, as seen from the
        ground; empty at rest), `origin`. Further columns stay.
    name:
        What to call the table in messages: its file.

    Raises
    ------
    BadInput
        For missing columns, no rows, cells that are not what `_NUMBERS` says, and a turning ring's mode of 2 or more
        without its wave: it has two frequencies.
    """
    check_columns(table, name, "mode", REQUIRED)
    typed = table.reset_index(drop=True)
    for column in (column for column in _NUMBERS if column in typed):
        numbers = numbers_in(typed[column])
        least = numbers.ge(0) if column in ("mode", "speed_km_h") else numbers.gt(0)
        fine = least & numbers.lt(np.inf) & (numbers.eq(numbers.round()) | (column != "mode"))
        _refuse(typed, fine, column, f"is not {_NUMBERS[column]}", name)
        typed[column] = numbers
    for column, allowed in _TEXTS.items():
        if column in typed:
            typed[column] = typed[column].astype(object).where(typed[column].notna(), "").astype(str).str.strip()
            _refuse(typed, typed[column].isin(allowed), column, f"is none of {', '.join(filter(None, allowed))}", name)
    wave = typed["wave"] if "wave" in typed else pd.Series("", index=typed.index)
    if "speed_km_h" in typed:
        unambiguous = (typed["speed_km_h"] == 0) | (typed["mode"] < 2) | (wave != "")
        what = "needs the column wave beside it, forward or backward: a turning ring has two frequencies a mode"
        _refuse(typed, unambiguous, "speed_km_h", what, name)
    return typed


def _refuse(table: pd.DataFrame, fine: pd.Series, column: str, what: str, name: str) -> None:
    """Refuse a table with the first row where a column is not `fine`."""
    if not fine.all():
        row = int(np.flatnonzero(~fine.to_numpy())[0])
        where, cell = f"row {row + 1} (line {line_of(table.attrs, row)})", quoted(str(table[column].iloc[row]))
        raise BadInput(f"{name}: {where}, column {column}: {cell} {what}; mend the cell or remove the row")
