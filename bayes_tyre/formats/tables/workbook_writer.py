"""Tables written as one Excel workbook (`.xlsx`), a sheet each; `excel.py` reads such files."""

import math
from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import Any

import openpyxl
import pandas as pd
from openpyxl.cell import WriteOnlyCell
from openpyxl.styles import Font
from openpyxl.utils import get_column_letter

from bayes_tyre.formats.files import whole_file
from bayes_tyre.plain_text import escaped

#: What a reader must not miss stands in the first column.
_FIRST = "verdict"
#: Widest column, letters; rows that a sheet can hold below its header.
_WIDEST, MOST_ROWS = 40, (1 << 20) - 1


def write_workbook(tables: Mapping[str, pd.DataFrame], path: Path) -> Path:
    """Write tables as the sheets of a workbook, whole or not at all; return the path.

    Numbers stay numbers, to 16 digits, so that a spreadsheet shows them with its own decimal sign; missing cells are
    blank; text is text, whatever it begins with. The header row is frozen, and a column `verdict` comes first.

    Raises
    ------
    ValueError
        For a table with more rows than a sheet holds.
    """
    book = openpyxl.Workbook(write_only=True)
    for name, table in tables.items():
        if len(table) > MOST_ROWS:
            raise ValueError(f"{name}: {len(table)} rows are more than the {MOST_ROWS} of a sheet")
        columns = sorted(map(str, table.columns), key=lambda column: column != _FIRST)
        sheet: Any = book.create_sheet(name)
        sheet.freeze_panes = "A2"
        for i, column in enumerate(columns, 1):
            sheet.column_dimensions[get_column_letter(i)].width = min(_WIDEST, max(10, len(column) + 2))
        sheet.append([_text(sheet, column, Font(bold=True)) for column in columns])
        for row in table[columns].itertuples(index=False):
            sheet.append([_cell(sheet, value) for value in row])
    with whole_file(path) as beside:
        book.save(beside)
    return path


def _cell(sheet: Any, value: object) -> object:
    """Return a value as a cell: a number, a text, or blank."""
    if isinstance(value, Real):
        number = float(value)
        return value if math.isfinite(number) else None if math.isnan(number) else _text(sheet, str(number))
    return None if value is None or value is pd.NA or value == "" else _text(sheet, str(value))


def _text(sheet: Any, text: str, font: Font | None = None) -> Any:
    cell = WriteOnlyCell(sheet, escaped(text))
    cell.data_type = "s"  # or a text that begins with = would be a formula
    if font is not None:
        cell.font = font
    return cell
