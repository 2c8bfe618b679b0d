"""Text files of numbers without a header: what separates their cells, and whether names and units stand above."""

import re
from typing import NamedTuple

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.header import TAGS, Section
from bayes_tyre.formats.lvm.source import MOST_COLUMNS, Source, as_text
from bayes_tyre.formats.tables.header import units_in
from bayes_tyre.plain_text import number_in, quoted

_LINES = 20
_START = 1 << 20
_LONGEST_CELL = 60
#: What may separate cells, and what decimals may be written with then. A blank is any run of blanks.
_DIALECTS = (("\t", ".,"), (";", ".,"), (",", "."), (" ", ".,"))


class _Dialect(NamedTuple):
    separator: str
    names: list[str] | None
    units: tuple[str, ...] = ()


def find_plain_table(source: Source) -> Section:
    """Return the one table of a file without a header.

    Raises
    ------
    BadInput
        If the file is empty, a header that has no end, or its lines are no rows of numbers.
    """
    lines = [line for line in source.data[:_START].split(b"\n", _LINES)[:_LINES] if line.strip()]
    if not lines:
        raise BadInput(f"{source.path}: holds nothing; give a recording")
    start = source.data.index(lines[0])
    if max(line.count(one) for line in lines for one in (b"\t", b",", b";", b" ")) >= MOST_COLUMNS:
        raise source.fault(start, f"has over {MOST_COLUMNS} columns; give a file with a column a channel")
    # Where no dialect suits all lines, one that suits the first shows which of the others is at fault.
    dialect = next(
        (dialect for some in (lines, lines[:3], lines[:2]) for one in _DIALECTS if (dialect := _dialect(some, *one))),
        None,
    )
    if dialect is None:
        if re.split(r"[\t,;]", as_text(lines[0][:200]))[0].strip().strip('"\ufeff') in TAGS:
            raise BadInput(f"{source.path}: its header has no end (***End_of_Header***); it may have been cut short")
        line = as_text(lines[min(1, len(lines) - 1)].strip())
        raise source.fault(start, f"no header, and no rows of numbers below: {quoted(line)}; give a recording")
    above = lines[: (dialect.names is not None) + bool(dialect.units)]
    for line in above:
        start = source.line(source.data.index(line, start))[1]
    return Section({}, dialect.names, start, len(source.data), dialect.separator, "", dialect.units)


def _dialect(lines: list[bytes], separator: str, decimals: str) -> _Dialect | None:
    """Return how the lines are written if all but names, and units below them, are numbers between these separators."""
    rows, units = [_cells(line, separator) for line in lines], ()
    if any(_numeric(rows[0], decimal) for decimal in decimals):
        names, body = None, rows
    else:
        names, body = [as_text(name).strip().strip('"\ufeff') for name in rows[0]], rows[1:]
        units = _units(body[0], len(names)) if len(body) > 1 else ()
        body = body[1:] if units else body
        comment = bool(names) and names[-1].lower() == "comment"
        body = [cells[: len(names) - 1] if comment else cells for cells in body]
    # The last line may be half written: it counts only where there is no other.
    whole = body[:-1] or body
    if not whole or not any(all(_numeric(cells, decimal) for cells in whole) for decimal in decimals):
        return None
    if max(map(len, whole)) < 2 and (separator != "\t" or any(_splits(line) for line in lines[-len(whole) :])):
        return None
    return _Dialect(separator, names, units)


def _units(cells: list[bytes], columns: int) -> tuple[str, ...]:
    """Return the units in a row below so many names; nothing if it is no row of units."""
    return units_in([as_text(cell).strip('"') for cell in cells], any_units=True) if len(cells) <= columns else ()


def _splits(line: bytes) -> bool:
    return any(one in line.strip() for one in (b"\t", b",", b";", b" "))


def _cells(line: bytes, separator: str) -> list[bytes]:
    cells = line.split() if separator == " " else line.split(separator.encode())
    return [cell.strip() for cell in cells]


def _numeric(cells: list[bytes], decimal: str) -> bool:
    """Return whether all cells are numbers or blank, and one at least is a number."""
    return any(cells) and all(not cell or _is_number(cell, decimal) for cell in cells)


def _is_number(cell: bytes, decimal: str) -> bool:
    if len(cell) > _LONGEST_CELL or (decimal == "," and b"." in cell):
        return False
    return number_in(cell.replace(decimal.encode(), b".") if decimal != "." else cell) is not None
