"""Detection of a last row that was cut short while it was written."""

import re

from bayes_tyre.formats.lvm.source import MOST_COLUMNS, Source

_NUMBER = re.compile(rb"[+-]?\d*[.,]?(\d*)([eE][+-]?\d+)?")
_WORD = re.compile(rb"[+-]?(?:nan|inf(?:inity)?|1[.,]#(?:[qs]?nan|ind|inf)\d*)", re.IGNORECASE)
#: How many rows above show what a whole row looks like.
_ROWS_ABOVE = 20
_LONGEST_LINE = 1 << 20


def end_of_whole_rows(source: Source, start: int, stop: int, separator: str, text_from: int | None) -> tuple[int, bool]:
    """Return where the whole rows between two bytes end, and whether a half-written row was left out.

    A row is half written if the file ends within it: its line has no end, and cells are missing that the row above
    has, or its last number has fewer decimals than those above. A line with an end must show both.
    """
    data = source.data
    low = max(start, stop - _LONGEST_LINE)
    body = data[low:stop].rstrip(b"\r\n")
    ended = data[low:stop] != body
    lines = [line.rstrip(b"\r") for line in body.rsplit(b"\n", _ROWS_ABOVE + 1)[-_ROWS_ABOVE - 1 :]]
    rows = [_cells(line, separator, text_from) for line in lines if line.strip()]
    if len(rows) < 2:
        return stop, False
    *above, last = rows
    given = [i for i, cell in enumerate(last) if cell]
    if not given:
        return stop, False
    lacking = any(above[-1][given[-1] + 1 :])
    # A cell with a separator behind it was written to its end.
    cut = given[-1] == len(last) - 1 and _is_cut(last[-1], [row[given[-1]] for row in above if len(row) > given[-1]])
    if (lacking and cut) if ended else (lacking or cut):
        return low + len(body) - len(lines[-1].rstrip(b"\r")), True
    return stop, False


def _cells(line: bytes, separator: str, text_from: int | None) -> list[bytes]:
    cells = line.split(None, MOST_COLUMNS) if separator == " " else line.split(separator.encode(), MOST_COLUMNS)
    return [cell.strip() for cell in cells[:text_from]]


def _is_cut(cell: bytes, above: list[bytes]) -> bool:
    """Return whether a number lacks decimals, or an exponent, that all those above have; or is no number."""
    whole = [match for other in above if (match := _NUMBER.fullmatch(other))]
    match = _NUMBER.fullmatch(cell)
    if not whole or _WORD.fullmatch(cell):
        return False
    if match is None or not any(character in b"0123456789" for character in cell):
        return True
    decimals = min(len(other[1]) for other in whole)
    return len(match[1]) < decimals or (match[2] is None and all(other[2] for other in whole))
