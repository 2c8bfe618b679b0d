"""Text that a spreadsheet would run as a formula: escaped in written CSV files, restored where they are read."""

import re
from collections.abc import Callable

import pandas as pd

# The apostrophe is what a spreadsheet's user types before text. Text that has one already gets another, so that no two
# labels become one, and reading takes away exactly what writing put there.
_RUNS = re.compile(r"'*[=+\-@\t\r\n]")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


def harmless(text: str) -> str:
    """Return a text with an apostrophe before it if a spreadsheet would take it for a formula; a number is none.

    Examples
    --------
    >>> harmless("=1+1"), harmless("-1.5"), harmless("single")
    ("'=1+1", '-1.5', 'single')
    """
    return f"'{text}" if _RUNS.match(text) and not _NUMBER.fullmatch(text) else text


def as_meant(text: str) -> str:
    """Return the text that `harmless` made this of.

    Examples
    --------
    >>> as_meant("'=1+1"), as_meant("'single'")
    ('=1+1', "'single'")
    """
    return text[1:] if text.startswith("'") and harmless(text[1:]) == text else text


def texts_of(cells: pd.Series) -> set[str]:
    """Return the distinct texts in a column; numbers and missing cells are none."""
    if isinstance(cells.dtype, pd.StringDtype):
        cells = pd.Series(cells.unique())
    elif not (isinstance(cells.dtype, pd.CategoricalDtype) or cells.dtype == object):
        return set()
    return {text for text in cells if isinstance(text, str)}


def map_texts(table: pd.DataFrame, change: Callable[[str], str]) -> pd.DataFrame:
    """Return the table with every text in it changed, cells and names; numbers are not touched."""
    changed = table.rename(columns=lambda name: change(name) if isinstance(name, str) else name)
    for i, name in enumerate(table.columns):
        other = {text: new for text in texts_of(table[name]) if (new := change(text)) != text}
        if other:
            cells = [other.get(cell, cell) if isinstance(cell, str) else cell for cell in table[name]]
            changed.isetitem(i, cells)
    return changed
