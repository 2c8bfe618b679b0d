"""Dialect of a CSV file: its encoding, the separator of its cells, and the names in its header.

`csv.Sniffer` guesses the separator from letters too; here it is the most frequent one in the header.
"""

import codecs
import csv
from collections import Counter
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from bayes_tyre.errors import BadInput

#: What may separate cells, the usual one first.
SEPARATORS = (",", ";", "\t")
# UTF-32 before UTF-16: its little-endian mark begins with that of UTF-16.
_MARKS = (
    *((codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32")),
    *((codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16")),
)
_OTHER_FILES = {
    b"PK\x03\x04": ("a workbook or an archive", "save its sheet as CSV (UTF-8)"),
    b"\xd0\xcf\x11\xe0": ("an old workbook", "save its sheet as CSV (UTF-8)"),
    b"PAR1": ("a Parquet file", "name it .parquet"),
}


class Dialect(NamedTuple):
    """How one CSV file is written."""

    encoding: str
    separator: str
    names: tuple[str, ...]


def find_dialect(path: Path) -> Dialect:
    """Return how a CSV file is written: from its byte-order mark and its header, by the rules of CSV.

    The separator is the one that stands most often in the header outside quotes; a comma where none does.

    Raises
    ------
    BadInput
        If the file is of another kind under the name of a CSV, its first line is no header, or a name stands twice.
    UnicodeDecodeError
        If the header is not text in the file's encoding.
    """
    with path.open("rb") as file:
        start = file.read(4)
    for magic, (kind, remedy) in _OTHER_FILES.items():
        if start.startswith(magic):
            raise BadInput(f"{path}: is {kind} under the name of a CSV file; {remedy}")
    encoding = next((name for mark, name in _MARKS if start.startswith(mark)), "utf-8-sig")
    with path.open(encoding=encoding, newline="") as lines:
        counts = _separators(lines)
        separator = max(SEPARATORS, key=lambda one: counts[one])
        lines.seek(0)
        names = next((row for row in csv.reader(lines, delimiter=separator) if "".join(row).strip()), [])
    _check_names(path, names)
    return Dialect(encoding, separator, tuple(name.strip() for name in names))


def _separators(lines: Iterable[str]) -> Counter[str]:
    """Count the separators in the header: its first line that is not blank, outside quotes."""
    counts: Counter[str] = Counter()
    quoted, blank, before = False, True, "\n"
    for character in chain.from_iterable(lines):
        if quoted:
            quoted = character != '"'
        elif character == '"' and before in (*SEPARATORS, "\r", "\n", '"'):  # mid-cell it is a character like others
            quoted = True
        elif character in "\r\n" and not blank:
            break
        elif character in SEPARATORS:
            counts[character] += 1
        blank = blank and character.isspace()
        before = character
    return counts


def _check_names(path: Path, names: list[str]) -> None:
    if any("\0" in name for name in names):
        raise BadInput(f"{path}: the header holds zero bytes: no text, or UTF-16 without its mark; save it as UTF-8")
    if names and names[0].lower().startswith("sep="):
        raise BadInput(
            f"{path}: the first line, {names[0][:20]!r}, is a hint to a spreadsheet and no header; remove it"
        )
    names = [name.strip() for name in names]
    twice = next((name for i, name in enumerate(names) if name and name in names[:i]), None)
    if twice is not None:  # pandas would rename the second, and it would pass for a column of its own
        raise BadInput(f"{path}: column {twice[:60]!r} stands twice; keep one")


def first_long_row(path: Path, dialect: Dialect) -> str:
    """Return what is wrong with the first row that holds more cells than the header; empty where none does."""
    with path.open(encoding=dialect.encoding, newline="") as lines:
        reader = csv.reader(lines, delimiter=dialect.separator)
        rows = (row for row in reader if "".join(row).strip())
        next(rows, None)
        for i, row in enumerate(rows, start=1):
            if len(row) > len(dialect.names):
                return f"row {i} (line {reader.line_num}) holds {len(row)} cells, the header {len(dialect.names)}"
    return ""
