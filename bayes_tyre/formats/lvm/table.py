"""Columns of numbers from rows of text: parsed directly where all rows have one width, padded first where not."""

import itertools
import os
import re
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.commas import spill_over, spilt
from bayes_tyre.formats.lvm.source import Source, as_text
from bayes_tyre.plain_text import quoted

_BLOCK = 1 << 20
_LARGEST_BLOCK = (1 << 31) - 1
_LEAST_PIECE, _MOST_PIECES, _LONGEST_ROW = 2 << 20, 8, 1 << 16
_BLANKS = ["", "NaN", "nan", "NAN"]
#: How LabVIEW and the C library of old Windows spell what is no number.
_NO_NUMBER = re.compile(r"[+-]?(?:n/?a|nan|1[.,]#(?:qnan|snan|ind|nan)\d*)", re.IGNORECASE)
_INFINITE = re.compile(r"([+-]?)1[.,]#inf\d*", re.IGNORECASE)
_NUMBER = {
    sign: re.compile(
        rf"[+-]?(?:(?:[0-9]+[{sign}]?[0-9]*|[{sign}][0-9]+)(?:[eE][+-]?[0-9]+)?|inf(?:inity)?)", re.IGNORECASE
    )
    for sign in ".,"
}
_LONGEST_CELL = 400
_LINE_OF_BLANKS = re.compile(rb"^ +$", re.MULTILINE)


class Rows(NamedTuple):
    """The rows of a table, and how to read them.

    Attributes
    ----------
    source, start, stop:
        The bytes of the rows.
    separator:
        A tab, comma or semicolon; or a blank, which stands for any run of blanks.
    columns:
        How many columns have a name.
    wanted:
        Those to read as numbers, ascending.
    names:
        Of the columns, for messages.
    text_from:
        The column from which on cells are text, as a comment is; None where there is none.
    decimals:
        Decimal signs to try, in order.
    """

    source: Source
    start: int
    stop: int
    separator: str
    columns: int
    wanted: list[int]
    names: list[str]
    text_from: int | None
    decimals: str


class Numbers(NamedTuple):
    """Columns, shape (rows,) each, NaN where a cell is blank; and the decimal sign they were written with."""

    columns: list[np.ndarray]
    decimal: str


def read_numbers(rows: Rows) -> Numbers:
    """Return the wanted columns of a table.

    Raises
    ------
    BadInput
        If a row has more cells than the table has columns, or a cell that should be a number is none.
    """
    try:
        return _read_uniform(rows) or _read_uneven(rows)
    finally:
        pa.default_memory_pool().release_unused()  # or Arrow holds the memory of several files


def _read_uniform(rows: Rows) -> Numbers | None:
    """Return what `read_numbers` does, if all rows but the first have one width; None if one does not fit."""
    width = _common_width(rows) if rows.separator != " " else None
    if width is None:
        return None
    data, start = _uniform_first_row(rows, width)
    stop = rows.stop if data is rows.source.data else len(data)
    try:
        numbers = _parse(pa.py_buffer(data).slice(start, stop - start), width, rows, rows.decimals[0], _BLOCK)
    except pa.ArrowInvalid:
        return None
    return Numbers(numbers, rows.decimals[0])


def _common_width(rows: Rows) -> int | None:
    """Return how many cells the second row has, or the only one; None where that cannot serve for all."""
    line, at = rows.source.line(rows.start)
    if at < rows.stop:
        line, _ = rows.source.line(at)
    width = line.count(rows.separator.encode()) + 1
    return width if line.strip() and width <= rows.columns + 1 and width > max(rows.wanted, default=0) else None


def _uniform_first_row(rows: Rows, width: int) -> tuple[bytes, int]:
    """Return bytes and where in them the rows begin; the first row alone may carry a comment, which is cut."""
    line, at = rows.source.line(rows.start)
    cells = line.split(rows.separator.encode(), rows.columns + 1)
    if len(cells) <= width or len(cells) > rows.columns or rows.text_from is None or rows.text_from > width:
        return rows.source.data, rows.start
    first = rows.separator.encode().join(cells[:width]) + b"\n"
    return b"".join([first, memoryview(rows.source.data)[at : rows.stop]]), 0


def _parse(data: pa.Buffer, width: int, rows: Rows, decimal: str, block: int) -> list[np.ndarray]:
    """Return the wanted columns of rows with equally many cells.

    Raises
    ------
    pyarrow.ArrowInvalid
        If a row has another width, or a cell is no number.
    """
    names = [str(i) for i in range(width)]
    wanted = [names[i] for i in rows.wanted if i < width]
    # Cells beyond the named columns are read as text that must be blank.
    beyond = names[rows.columns :]
    # Arrow's own threads may abort the process when it ends, with all work done (apache/arrow issue 34314).
    reading = pa_csv.ReadOptions(column_names=names, block_size=block, use_threads=False)
    parsing = pa_csv.ParseOptions(delimiter=_byte(rows), quote_char=False, double_quote=False)
    converting = pa_csv.ConvertOptions(
        column_types={**dict.fromkeys(wanted, pa.float64()), **dict.fromkeys(beyond, pa.null())},
        include_columns=[*wanted, *beyond],
        null_values=_BLANKS,
        decimal_point=decimal,
    )

    def parse(piece: pa.Buffer) -> pa.Table:
        return pa_csv.read_csv(pa.BufferReader(piece), reading, parsing, converting)

    pieces = _pieces(data)
    if len(pieces) == 1:
        table = parse(data)
    else:
        with ThreadPoolExecutor(len(pieces)) as pool:
            table = pa.concat_tables(list(pool.map(parse, pieces)))
    missing = np.full(table.num_rows, np.nan)
    numbers = [table.column(name).to_numpy() for name in wanted]
    return [*numbers, *([missing] * (len(rows.wanted) - len(wanted)))]


def _pieces(data: pa.Buffer) -> list[pa.Buffer]:
    """Return the rows in pieces of equal size, one for each core; in one if there are few."""
    number = max(1, min(os.cpu_count() or 1, _MOST_PIECES, data.size // _LEAST_PIECE))
    view = np.frombuffer(data, dtype=np.uint8)
    cuts = [0]
    for i in range(1, number):
        middle = data.size * i // number
        ends = np.flatnonzero(view[middle : middle + _LONGEST_ROW] == ord("\n"))
        cuts += [middle + int(ends[0]) + 1] if len(ends) and middle > cuts[-1] else []
    cuts.append(data.size)
    return [data.slice(low, high - low) for low, high in itertools.pairwise(cuts) if high > low] or [data]


def _byte(rows: Rows) -> str:
    return "\t" if rows.separator == " " else rows.separator


def _read_uneven(rows: Rows) -> Numbers:
    """Return what `read_numbers` does, of rows that differ in their cells; slower."""
    text = rows.source.data[rows.start : rows.stop].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    even, width, longest, lines = _padded(text, rows)
    del text
    if not len(lines):
        return Numbers([np.empty(0)] * len(rows.wanted), rows.decimals[0])
    if longest > _LARGEST_BLOCK:
        raise rows.source.fault(rows.start, "is too long; give a file with a line a sample")
    buffer = pa.py_buffer(even)
    for decimal in rows.decimals:
        try:
            return Numbers(_parse(buffer, width, rows, decimal, max(_BLOCK, longest + 2)), decimal)
        except pa.ArrowInvalid:
            continue
    return _read_cell_by_cell(even, width, lines, rows)


def _padded(text: bytes, rows: Rows) -> tuple[np.ndarray, int, int, np.ndarray]:
    """Return rows with equally many cells, as bytes; how many, the longest row's bytes, and the line each stands in."""
    if rows.separator == " ":
        text = b"\n".join(b"\t".join(line.split()) for line in text.split(b"\n"))
    elif b" " in text:  # a line of blanks is an empty line
        text = _LINE_OF_BLANKS.sub(b"", text)
    mark = _byte(rows).encode()
    characters = np.frombuffer(text, dtype=np.uint8)
    stops = np.flatnonzero(characters == ord("\n"))
    if text and not text.endswith(b"\n"):
        stops = np.append(stops, len(text))
    starts = np.concatenate([[0], stops[:-1] + 1]) if len(stops) else stops
    cells = np.diff(np.searchsorted(np.flatnonzero(characters == ord(mark)), stops), prepend=0) + 1
    first_line = rows.source.data.count(b"\n", 0, rows.start) + 1
    long = np.flatnonzero(cells > rows.columns)
    if len(long):
        return _padded(_shortened(text, long, mark, first_line, rows), rows)
    there = stops > starts
    width = int(cells[there].max(initial=1))
    short = np.where(there, width - cells, 0)
    if short.sum() > 10 * len(text) + 10_000_000:
        worst = int(np.argmax(cells))
        raise rows.source.fault_in_line(first_line + worst, f"has {width} cells, most rows few; give equal rows")
    longest = int((stops - starts + short).max(initial=0))
    lines = first_line + np.flatnonzero(there)
    even = np.insert(characters, np.repeat(stops, short), ord(mark)) if short.any() else characters
    return even, width, longest, lines


def _shortened(text: bytes, long: np.ndarray, mark: bytes, first_line: int, rows: Rows) -> bytes:
    """Return the rows without the cells beyond the last column, which are blank, or a comment that has commas."""
    lines = text.split(b"\n")
    runs_on = rows.text_from == rows.columns - 1 and mark == b","
    for i in long:
        cells = lines[i].split(mark, rows.columns)
        beyond = cells.pop()
        if runs_on and spill_over(lines[i].split(mark), rows.columns - 1):
            raise spilt(rows.source, first_line + int(i))
        if beyond.strip(mark + b" ") and not runs_on:
            cells = lines[i].count(mark) + 1
            raise rows.source.fault_in_line(
                first_line + int(i), f"has {cells} cells under {rows.columns} columns; mend the row"
            )
        lines[i] = mark.join(cells)
    return b"\n".join(lines)


def _read_cell_by_cell(even: np.ndarray, width: int, lines: np.ndarray, rows: Rows) -> Numbers:
    """Return what `read_numbers` does, cell by cell: blanks of spaces, old spellings of NaN; or name what is wrong."""
    names = [str(i) for i in range(width)]
    wanted = [i for i in rows.wanted if i < width]
    table = pa_csv.read_csv(
        pa.BufferReader(as_text(even.tobytes()).encode()),
        pa_csv.ReadOptions(column_names=names, block_size=min(2 * len(even) + 2, _LARGEST_BLOCK), use_threads=False),
        pa_csv.ParseOptions(delimiter=_byte(rows), quote_char=False, double_quote=False),
        pa_csv.ConvertOptions(
            column_types=dict.fromkeys(names, pa.string()), include_columns=[names[i] for i in wanted], null_values=[]
        ),
    )
    fault = None
    for decimal in rows.decimals:
        try:
            numbers = [_numbers(table.column(names[i]), decimal, rows.names[i], lines, rows.source) for i in wanted]
        except BadInput as error:
            fault = fault or error
        else:
            missing = np.full(table.num_rows, np.nan)
            return Numbers([*numbers, *([missing] * (len(rows.wanted) - len(wanted)))], decimal)
    raise fault or rows.source.fault(rows.start, "holds no numbers; mend the row")


def _numbers(column: pa.ChunkedArray, decimal: str, name: str, lines: np.ndarray, source: Source) -> np.ndarray:
    number = _NUMBER[decimal]
    numbers = np.full(len(column), np.nan)
    for i, text in enumerate(column.to_pylist()):
        cell = text.strip()
        if len(cell) <= _LONGEST_CELL and number.fullmatch(cell):
            numbers[i] = float(cell.replace(decimal, "."))
        elif len(cell) <= _LONGEST_CELL and (infinite := _INFINITE.fullmatch(cell)):
            numbers[i] = float(f"{infinite[1]}inf")
        elif cell and not (len(cell) <= _LONGEST_CELL and _NO_NUMBER.fullmatch(cell)):
            wrong = f"{quoted(cell)} is no number; mend the cell"
            raise source.fault_in_line(int(lines[i]), wrong, name or "without a name")
    return numbers
