"""Raw signals from Excel workbooks (`.xlsx`)."""

from collections.abc import Mapping
from pathlib import Path

from bayes_tyre.formats.recordings.sheet import read_sheet
from bayes_tyre.formats.tables.workbook import read_rows
from bayes_tyre.plain_text import quoted
from bayes_tyre.record import RawSignals


def read_excel(path: Path, columns: Mapping[str, int] | None = None) -> RawSignals:
    """Return the raw signals in the first sheet of a workbook that holds anything.

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
    return read_sheet(sheet.rows, f"{path}: sheet {quoted(sheet.title)}", columns, sheet.notes)
