"""The header of a lab's table: found below lines of preamble, its columns renamed, and the row of units below it."""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.x_column import unit_in
from bayes_tyre.plain_text import NAME, REASON, listed, number_in, one_line, quoted

#: Units that are read, by ours: the divisor that turns a number into ours.
UNITS: dict[str, dict[str, float]] = {
    "kN": {"kN": 1.0, "N": 1e3, "lbf": 1e3 / 4.4482216152605},
    "mm": {"mm": 1.0, "m": 1e-3, "in": 1 / 25.4},
    "s": {"s": 1.0, "ms": 1e3},
    "km/h": {"km/h": 1.0},
}
_KNOWN = {unit for units in UNITS.values() for unit in units}
#: A known unit that ends a name without brackets: ``Weg in mm``, ``force_kN``.
UNIT_ENDING = re.compile(rf"(?:[\s_]in)?[\s_]({'|'.join([*map(re.escape, sorted(_KNOWN)), 'km_h'])})$")
#: How any unit begins, beside which `--` or `#NV` stand for a missing number.
_LIKE_UNIT = re.compile(r"[^\W\d_]|[%‰°]")
#: Lines among which the header is looked for.
SEARCHED = 200
#: What a table from disk says of itself in its `attrs`: the line of its first row, and where blank lines stand below
#: (`plain_text.line_of`); the units by column that stand in a row below the header, and sentences on what was left out.
FIRST_LINE, BLANK_LINES, UNITS_ROW, NOTES = "first_line", "blank_lines", "units", "notes"


class Layout(NamedTuple):
    """Where the header of a lab's table is, and what its columns are called.

    Attributes
    ----------
    is_column:
        Whether a name is one that is looked for: the header is the line that holds most of them.
    names:
        Our name by theirs, of the columns to rename; every one must be there.
    skip_rows:
        Lines above the header; None: it is looked for.
    any_units:
        Whether any two texts without a number are a row of units, as below the names of a recording.
    """

    is_column: Callable[[str], bool]
    names: Mapping[str, str] = {}
    skip_rows: int | None = None
    any_units: bool = False

    def header(self, lines: Iterable[Sequence[str]]) -> int:
        """Return which line is the header, counted from 0: that with most known names, else with most text cells."""
        texts = [{cell for cell in map(str.strip, cells) if cell and not _is_number(cell)} for cells in lines]
        counts = [sum(map(self.is_column, cells)) for cells in texts]
        counts = counts if any(counts) else [*map(len, texts)]
        return counts.index(max(counts)) if counts else 0

    def names_in(self, rows: Iterable[tuple[int, Sequence[object]]]) -> int:
        """Return the most known names in one of the numbered rows of a sheet."""
        texts = ({cell.strip() for cell in row if isinstance(cell, str)} for _, row in rows)
        return max((sum(map(self.is_column, cells)) for cells in texts), default=0)

    def renamed(self, names: Sequence[str], path: Path) -> list[str]:
        """Return the columns as we call them.

        Raises
        ------
        BadInput
            If one to be renamed is missing, or another has its name already.
        """
        if missing := [name for name in self.names if name not in names]:
            header = one_line(", ".join(filter(None, names)), REASON)
            meant = listed([self.names[name] for name in missing], 3)
            called = f"{listed(missing, 3, quoted)}, which the column map calls {meant}"
            raise BadInput(f"{path}: no column {called}; found {header}; mend the map, or its skip_rows")
        ours = [self.names.get(name, name) for name in names]
        check_twice(ours, path, self.names.values())
        return ours


def check_twice(names: Sequence[str], path: Path, mapped: Collection[str] = ()) -> None:
    """Refuse a table that has a column twice; of two of a name, one may be `mapped` to it.

    Raises
    ------
    BadInput
        With the first such column.
    """
    twice = next((name for i, name in enumerate(names) if name and name in names[:i]), None)
    if twice is not None:
        what = " beside the one that the column map calls so" if twice in mapped else " twice"
        raise BadInput(f"{path}: column {one_line(twice, NAME)!r} stands{what}; keep one")


def blank_lines(lines: Sequence[int], first: int) -> list[int]:
    """Return, for each line without a row from `first` to the last of the rows' lines, how many rows stand above it."""
    gaps = np.diff([first - 1, *lines]) - 1
    return np.repeat(np.arange(len(lines)), gaps).tolist()


def units_in(cells: Sequence[object], any_units: bool = False) -> tuple[str, ...]:
    """Return the units in the row below the header, one a column; nothing if it is no row of units.

    It is one if it holds two known units at least, or with `any_units` two texts that begin as units do, in brackets or
    not, and no number.
    """
    texts = tuple("" if cell is None else str(cell).strip().strip("[]()").strip() for cell in cells)
    count = sum(bool(_LIKE_UNIT.match(text)) if any_units else text in _KNOWN for text in texts)
    return texts if count > 1 and not any(map(_is_number, texts)) else ()


def unit_of_name(name: str) -> str:
    """Return the unit that a name ends with, in brackets or a known one without; empty where there is none."""
    ending = UNIT_ENDING.search(name)
    return (unit_in(name) or (ending[1] if ending else "")).replace("km_h", "km/h")


def _is_number(text: str) -> bool:
    return number_in(text.replace(",", ".")) is not None
