"""The role of each column of an `.lvm` table: X or a channel, also where the label of X is blank or missing."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bayes_tyre.formats.lvm.header import Section, is_row

X_LABEL, COMMENT = "X_Value", "comment"


class Roles(NamedTuple):
    """The role of each column of a table.

    Attributes
    ----------
    channels:
        Columns that are channels.
    x:
        The X column of each; None where there is none.
    shift:
        A channel's cell in a line of the header is that of its column number less 1, plus this.
    """

    channels: tuple[int, ...]
    x: tuple[int | None, ...]
    shift: int = 0


def is_x(name: str) -> bool:
    """Return whether a column of this name holds X values."""
    return name.strip().lower().replace(" ", "_") == "x_value"


def find_roles(names: Sequence[str], last: int, x_columns: str) -> Roles:
    """Return the roles of the first `last` columns, from their names and the header's `X_Columns`."""
    at = [i for i in range(last) if is_x(names[i])]
    if len(at) > 1:
        channels = tuple(i for i in range(last) if i not in set(at))
        return Roles(channels, tuple(max((x for x in at if x < i), default=None) for i in channels))
    none = x_columns.strip().lower() == "no"
    if none and at != [0]:
        return Roles(tuple(range(last)), (None,) * last, shift=1)
    return Roles(tuple(range(1, last)), (None if none else 0,) * max(last - 1, 0))


def with_x_labels(names: list[str], section: Section, rows: Sequence[bytes]) -> list[str]:
    """Return the labels of a table's columns, `X_Value` among them where the file leaves it blank or out.

    Parameters
    ----------
    names:
        As in the file.
    section:
        Its header says how many channels there are, and whether they have X columns.
    rows:
        The first rows of the table.
    """
    header, last = section.header, len(names) - bool(names and names[-1].lower() == COMMENT)
    x_columns = (header.get("X_Columns") or [""])[0].strip().lower()
    promised = (header.get("Channels") or [""])[0]
    if not last or not header:
        return names
    if x_columns == "multi" and all(is_x(name) or not name for name in names[:last:2]):
        return [X_LABEL if i % 2 == 0 and i < last else name for i, name in enumerate(names)]
    cells = [[cell.strip() for cell in row.split(section.separator.encode())] for row in rows if row.strip()]
    blank = not any(row[0] for row in cells)
    if not names[0]:
        has_x = x_columns != "no" or promised == str(last - 1) or blank
        return [X_LABEL, *names[1:]] if has_x else names
    # An editor may take away the blank cell that the line of labels begins with: each row has a number more then.
    one_more = bool(cells) and all(len(row) > last and is_row(row[last]) for row in cells)
    left_out = promised == str(last) and x_columns == ("no" if blank else "one") and not is_x(names[0])
    return [X_LABEL, *names] if left_out and one_more else names


def last_channel(names: Sequence[str], columns: Sequence[np.ndarray]) -> int:
    """Return how many columns remain without those at the end that have neither a label nor a reading."""
    last = len(columns)
    while last > 1 and not any(map(str.strip, names[last - 1 : last])) and np.isnan(columns[last - 1]).all():
        last -= 1
    return last
