"""Raw signals from Excel workbooks (`.xlsx`): a sheet's rows of names, units and numbers."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from openpyxl.utils import get_column_letter

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.roles import COMMENT, is_x
from bayes_tyre.formats.recordings.column_signals import named_by_number, signals_of
from bayes_tyre.formats.tables.decimals import NO_READING
from bayes_tyre.formats.tables.workbook import NumberedRows, Row, read_rows
from bayes_tyre.formats.x_column import is_time, unit_in
from bayes_tyre.plain_text import NAME, one_line, quoted
from bayes_tyre.record import RawSignals


class _Names(NamedTuple):
    """Names and units by column, counted from 0, as far as there are any; the row of units, 0 where there is none."""

    names: Mapping[int, str]
    units: Mapping[int, str]
    units_row: int


def read_excel(path: Path, columns: Mapping[str, int] | None = None) -> RawSignals:
    """Return the raw signals in the first sheet of a workbook that holds anything.

    Numbers begin in the first row that holds nothing else in columns of numbers, which are those whose last cell is
    one; or below a row that begins with `X_Value`. The row of text above holds the names; of two, the lower the units.
    Columns of text are left out with a warning.

    Parameters
    ----------
    path:
        An `.xlsx` file.
    columns:
        Channel name -> column, counted from 1, such as ``{"time": 1, "Acc m/s^2": 3, "Disp mm": 12, "Load kN": 13}``;
        rows count from the first that holds numbers in them. Without it, all columns that are no text.

    Returns
    -------
    Cached values of formulas; a formula without one, a blank cell and an error such as `#N/A` are missing.

    Raises
    ------
    BadInput
        If the file is no workbook, unpacks to more than a recording does, holds no numbers, or text among them.
    """
    sheet = read_rows(path)
    return _signals(sheet.rows, f"{path}: sheet {quoted(sheet.title)}", columns, sheet.notes)


def _signals(rows: NumberedRows, where: str, columns: Mapping[str, int] | None, warnings: Sequence[str]) -> RawSignals:
    start = _start(rows, columns)
    if start is None:
        wanted = "" if columns is None else f" in all of columns {', '.join(map(str, columns.values()))}"
        raise BadInput(f"{where}: holds no row of numbers{wanted}; give a column a channel")
    above, texts = _names(rows[:start]), list(warnings)
    if columns is None and above.units_row:
        texts.append(f"row {above.units_row} is taken for the units of the names above it")
    columns_read: list[tuple[str, np.ndarray]] = []
    units: list[str] = []
    wanted_columns = _all_columns(rows[start:], above) if columns is None else named_by_number(columns, above.names)
    for i, name in wanted_columns:
        cells = [(number, row[i] if i < len(row) else None) for number, row in rows[start:]]
        if columns is None and not is_time(name) and _is_text(cell for _, cell in cells):
            texts.append(f"column {quoted(name)} is text: left out")
            continue
        columns_read.append(
            (name, np.array([_reading(cell, where, number, i, name) for number, cell in cells], dtype=float))
        )
        units.append(above.units.get(i) or unit_in(above.names.get(i, "")))
    return signals_of(columns_read, texts, units)


def _start(rows: NumberedRows, columns: Mapping[str, int] | None) -> int | None:
    """Return the index of the first row of numbers."""
    if columns is not None:
        at = [column - 1 for column in columns.values()]
        chosen = ([row[i] for i in at] if max(at) < len(row) else [] for _, row in rows)
        return next((i for i, cells in enumerate(chosen) if _are_numbers(cells)), None)
    for i, ((_, row), (_, below)) in enumerate(itertools.pairwise(rows), start=1):
        if row and isinstance(row[0], str) and is_x(row[0]) and any(map(_is_number, below)):
            return i  # a comment may stand in the first row
    width = max((len(row) for _, row in rows), default=0)
    last: dict[int, object] = {}
    for _, row in reversed(rows):
        if len(last) == width:
            break
        last |= {i: cell for i, cell in enumerate(row) if i not in last and not _is_blank(cell)}
    at = [i for i, cell in last.items() if _number(cell) is not None]
    chosen = ([row[i] for i in at if i < len(row)] for _, row in rows)
    return next((i for i, cells in enumerate(chosen) if _are_numbers(cells)), None)


def _are_numbers(cells: Sequence[object]) -> bool:
    return any(map(_is_number, cells)) and all(_is_blank(cell) or _number(cell) is not None for cell in cells)


def _names(above: NumberedRows) -> _Names:
    """Return the names, and the units, that the rows above the numbers hold."""
    filled = [(number, _texts(row), row) for number, row in above if any(cell is not None for cell in row)]
    if not filled:
        return _Names({}, {}, 0)
    number, lower, row = filled[-1]
    names = {i: str(cell).strip() for i, cell in enumerate(row) if cell is not None}
    upper = filled[-2][1] if len(filled) > 1 and filled[-2][0] == number - 1 else {}
    times = [any(map(is_time, texts.values())) for texts in (upper, lower)]
    # A title has fewer cells than the names below it, and lines of "who" and "when" no time among them.
    if lower and len(upper) >= max(2, len(lower)) and (times[0] or not times[1]):
        return _Names(upper, {i: text.strip("[]() ") for i, text in lower.items()}, number)
    return _Names(names, {}, 0)


def _texts(row: Row) -> dict[int, str]:
    """Return the cells of a row that holds text alone, by column; nothing for others."""
    cells = {i: cell for i, cell in enumerate(row) if cell is not None}
    texts = {i: cell.strip() for i, cell in cells.items() if isinstance(cell, str) and _number(cell) is None}
    return texts if len(texts) == len(cells) else {}


def _all_columns(rows: NumberedRows, above: _Names) -> list[tuple[int, str]]:
    """Return the columns that have a name, no comment's, or a number; each with its name."""
    filled = {i for _, row in rows for i, cell in enumerate(row) if not _is_blank(cell)}
    wanted = [i for i in sorted(filled | above.names.keys()) if above.names.get(i, "").lower() != COMMENT]
    return [(i, above.names.get(i, f"column {i + 1}")) for i in wanted]


def _is_text(cells: Iterable[object]) -> bool:
    given = [cell for cell in cells if not _is_blank(cell)]
    return bool(given) and all(_number(cell) is None for cell in given)


def _is_blank(cell: object) -> bool:
    """Return whether a cell is blank, an error of the spreadsheet, or text that says there is no number."""
    return cell is None or (isinstance(cell, str) and (cell.startswith("#") or cell.strip().lower() in NO_READING))


def _is_number(cell: object) -> bool:
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def _number(cell: object) -> float | None:
    """Return a cell as a number, which may be written as text; None if it is none."""
    if isinstance(cell, int | float | str) and not isinstance(cell, bool):
        try:
            return float(cell)
        except (ValueError, OverflowError):
            pass
    return None


def _reading(cell: object, where: str, row: int, column: int, name: str) -> float:
    """Return a cell of a channel as a number, NaN for a blank one."""
    number = np.nan if _is_blank(cell) else _number(cell)
    if number is None:
        at = f"row {row}, column {get_column_letter(column + 1)} ({one_line(name, NAME)})"
        raise BadInput(f"{where}, {at}: {quoted(str(cell))} is no number; mend the cell, or format it as a number")
    return number
