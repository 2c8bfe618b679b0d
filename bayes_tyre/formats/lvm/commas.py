"""Refusal of decimal commas between cells that are separated by commas: such rows are ambiguous."""

import re
from collections.abc import Iterable, Sequence

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.source import Source

_NUMBER = re.compile(rb"\s*(?:[+-]?\d+(?:[eE][+-]?\d+)?|[nN][aA][nN])\s*")
_REMEDY = "save it with tabs between the cells, or with points in the decimals"


def check_declared(source: Source, separator: str, decimal: str) -> None:
    """Refuse a header that says decimals have a comma where commas separate the cells."""
    if separator == decimal == ",":
        raise BadInput(
            f"{source.path}: its header says decimals have a comma, and commas separate its cells; {_REMEDY}"
        )


def spill_over(cells: Sequence[bytes], text_from: int) -> bool:
    """Return whether a row's cells look split at decimal commas: whole numbers, in the comment too."""
    comment = [cell for cell in cells[text_from:] if cell.strip()]
    numbers = [cell for cell in cells[:text_from] if cell.strip()]
    return bool(comment) and all(map(_NUMBER.fullmatch, [*numbers, *comment]))


def spilt(source: Source, line: int) -> BadInput:
    """Return the error of a row whose numbers run on into its comment."""
    return source.fault_in_line(line, f"has numbers in its Comment: decimals with a comma, it seems; {_REMEDY}")


def check_rows(source: Source, lines: Iterable[tuple[int, bytes]], separator: str, text_from: int | None) -> None:
    """Refuse a table whose rows all spill over, the first of them named.

    Parameters
    ----------
    source, separator:
        The file and what separates its cells; only commas are looked at.
    lines:
        The first rows, each with the byte at which it begins.
    text_from:
        The column of the comment, or None.

    Raises
    ------
    BadInput
        If each of the rows has whole numbers alone, in its comment too.
    """
    if separator != "," or text_from is None:
        return
    rows = [(at, line) for at, line in lines if line.strip(b", ")]
    if rows and all(spill_over(line.split(b","), text_from) for _, line in rows):
        raise spilt(source, source.data.count(b"\n", 0, rows[0][0]) + 1)
