"""Dialect of a CSV file: its encoding, the separator of its cells, and the names in its header.

`csv.Sniffer` guesses the separator from letters too; here it is the most frequent one in the header. A comma before a
space is none where there are others: ``Zeit, s;Weg, mm``.
"""

import codecs
import csv
import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import BinaryIO, NamedTuple, TextIO

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.header import SEARCHED, Layout, blank_lines, check_twice, units_in

#: Characters of a header, and columns.
MOST_HEADER, MOST_COLUMNS = 500_000, 5000
#: Rows in which blanks between cells are looked for.
_FIRST_ROWS = 20
#: What commas leave between them of numbers with decimal commas that blanks separate: `1 2` of `0,1 2,3`.
_TWO_NUMBERS = re.compile(r"\d+(?:[eE][+-]?\d+)?\s+[+-]?\d+")
#: What may separate cells, the usual one first.
SEPARATORS = (",", ";", "\t")
# UTF-32 before UTF-16: its little-endian mark begins with that of UTF-16.
_MARKS = (
    *((codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32")),
    *((codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16")),
)
#: What a file without a mark may be, the usual one first.
_WITHOUT_MARK = ("utf-8-sig", "cp1252")
_OTHER_FILES = {
    b"PK\x03\x04": ("a workbook or an archive", "save its sheet as CSV (UTF-8)"),
    b"\xd0\xcf\x11\xe0": ("an old workbook", "save its sheet as CSV (UTF-8)"),
    b"PAR1": ("a Parquet file", "name it .parquet"),
}


class Dialect(NamedTuple):
    """How one CSV file is written.

    `header` holds the names as written, after `above` lines of preamble; `units` those of a row of units, which is row
    `units_row` of those that follow the preamble, counted from 0; `first_line` that of the first row, counted from 1. A
    row with a cell of several lines counts as one line, as in a spreadsheet.
    """

    encoding: str
    separator: str
    header: tuple[str, ...]
    above: int = 0
    first_line: int = 2
    units: tuple[str, ...] = ()
    units_row: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The names in the header, without spaces around them."""
        return tuple(name.strip() for name in self.header)


def find_dialect(path: Path, layout: Layout | None = None) -> Dialect:
    """Return how a CSV file is written: from its byte-order mark and its header, by the rules of CSV.

    The separator is the one that stands most often in the header outside quotes; a comma where none does. Without
    `layout` the header is the first line, and no units are looked for. Without a mark the encoding is UTF-8, or
    Windows-1252 where only this one fits.

    Raises
    ------
    BadInput
        If the file is of another kind under the name of a CSV, its first line is no header, a name stands twice, or
        blanks separate its cells and commas its decimals.
    UnicodeDecodeError
        If the header is not text in the file's encoding.
    """
    encoding = _encoding(path)
    with path.open(encoding=encoding, newline="") as lines:
        above = _lines_above(path, lines, layout)
        _checked_line(path, lines_below(lines, above))
        separator = _separator(lines_below(lines, above))
        reader = csv.reader(lines_below(lines, above), delimiter=separator)
        filled = ((i, row) for i, row in enumerate(reader) if "".join(row).strip())
        at, names = next(filled, (-1, []))
        _check_names(path, names)
        header = Dialect(encoding, separator, tuple(names), above, above + at + 2)
        below, cells = next(filled, (0, [])) if layout is not None else (0, [])
        if separator == ",":
            below_names = [row for row in (cells, *(row for _, row in islice(filled, _FIRST_ROWS))) if row]
            _check_blanks(path, below_names or [names])
    units = units_in(cells, layout is not None and layout.any_units)
    return header._replace(units=units, units_row=below, first_line=above + below + 2) if units else header


def _checked_line(path: Path, lines: TextIO) -> str:
    """Return the next line, which may be the header, or refuse it as too long."""
    line = lines.readline(MOST_HEADER)
    if len(line) == MOST_HEADER:
        raise BadInput(f"{path}: its header has over {MOST_HEADER} characters; give a table with a column a channel")
    return line


def lines_below(lines: TextIO, above: int) -> TextIO:
    """Return the lines of an open file that follow so many of them."""
    lines.seek(0)
    for _ in range(above):
        lines.readline()
    return lines


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(4)
        for magic, (kind, remedy) in _OTHER_FILES.items():
            if start.startswith(magic):
                raise BadInput(f"{path}: is {kind} under the name of a CSV file; {remedy}")
        if encoding := next((name for mark, name in _MARKS if start.startswith(mark)), ""):
            return encoding
        return next((one for one in _WITHOUT_MARK if _fits(file, one)), _WITHOUT_MARK[0])


def _fits(file: BinaryIO, encoding: str) -> bool:
    """Return whether all bytes of a file are text in an encoding."""
    file.seek(0)
    decoder = codecs.getincrementaldecoder(encoding)()
    try:
        for piece in iter(lambda: file.read(1 << 20), b""):
            decoder.decode(piece)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return False
    return True


def _lines_above(path: Path, lines: TextIO, layout: Layout | None) -> int:
    if layout is None:
        return 0
    if layout.skip_rows is not None:
        return layout.skip_rows
    first = islice(iter(lambda: _checked_line(path, lines), ""), SEARCHED)
    return layout.header(next(csv.reader([line], delimiter=_separator([line])), []) for line in first)


def _separator(lines: Iterable[str]) -> str:
    """Return what separates the cells of the header: the first line that is not blank, outside quotes."""
    counts: Counter[str] = Counter()
    quoted, blank, before, punctuation = False, True, "\n", 0
    for character in chain.from_iterable(lines):
        if quoted:
            quoted = character != '"'
        elif character == '"' and before in (*SEPARATORS, "\r", "\n", '"'):  # mid-cell it is a character like others
            quoted = True
        elif character in "\r\n" and not blank:
            break
        elif character in SEPARATORS:
            counts[character] += 1
        elif character == " " and before == ",":
            punctuation += 1
        blank = blank and character.isspace()
        before = character
    if counts[";"] or counts["\t"]:
        counts[","] -= punctuation
    return max(SEPARATORS, key=lambda one: counts[one])


def _check_names(path: Path, names: list[str]) -> None:
    if any("\0" in name for name in names):
        raise BadInput(f"{path}: the header holds zero bytes: no text, or UTF-16 without its mark; save it as UTF-8")
    if names and names[0].lower().startswith("sep="):
        raise BadInput(
            f"{path}: the first line, {names[0][:20]!r}, is a hint to a spreadsheet and no header; remove it"
        )
    if len(names) > MOST_COLUMNS:
        raise BadInput(f"{path}: has {len(names)} columns, over {MOST_COLUMNS}; keep those of the records")
    check_twice([name.strip() for name in names], path)  # pandas would rename the second


def _check_blanks(path: Path, rows: Sequence[Sequence[str]]) -> None:
    """Refuse a file in which commas cut numbers in two and leave the end of one and the start of the next together."""
    cut = [row for row in rows if len(row) > 2]
    if cut and all("." not in "".join(row) and all(map(_TWO_NUMBERS.fullmatch, row[1:-1])) for row in cut):
        raise BadInput(
            f"{path}: blanks stand between its cells and commas in its numbers; put semicolons or tabs between the "
            "cells, or name it .txt if it is a recording"
        )


def blank_lines_in(path: Path, dialect: Dialect, rows: int) -> list[int]:
    """Return where blank lines stand among so many rows of a table, as `header.blank_lines` does.

    All lines are only read again where there are more than rows.
    """
    with path.open("rb") as file:
        count = sum(piece.count(b"\n") for piece in iter(lambda: file.read(1 << 20), b""))
        file.seek(-1, os.SEEK_END)
        count += file.read(1) != b"\n"
    if count < dialect.first_line + rows:
        return []
    with path.open(encoding=dialect.encoding, newline="") as lines:
        reader = csv.reader(lines_below(lines, dialect.above), delimiter=dialect.separator)
        # As pandas has it: a line of separators is a row, though its cells are blank.
        at = (line for line, row in enumerate(reader, dialect.above + 1) if len(row) > 1 or "".join(row).strip())
        return blank_lines([line for line in at if line >= dialect.first_line], dialect.first_line)


def first_long_row(path: Path, dialect: Dialect) -> str:
    """Return what is wrong with the first row that holds more cells than the header; empty where none does."""
    with path.open(encoding=dialect.encoding, newline="") as lines:
        reader = csv.reader(lines_below(lines, dialect.above), delimiter=dialect.separator)
        filled = ((at, row) for at, row in enumerate(reader) if "".join(row).strip() and at != dialect.units_row)
        next(filled, None)
        for i, (at, row) in enumerate(filled, start=1):
            if len(row) > len(dialect.names):
                line = dialect.above + at + 1
                return f"row {i} (line {line}) holds {len(row)} cells, the header {len(dialect.names)}"
    return ""
