"""Raw signals from Excel workbooks (`.xlsx`): saved values, no formula computed, archives checked first."""

import warnings
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import openpyxl

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.sheet import Row, read_sheet
from bayes_tyre.plain_text import quoted, reason
from bayes_tyre.record import RawSignals

#: Bytes that an archive may hold unpacked, and times its own size; a sheet of 150,000 x 13 numbers is some 80 MB, and
#: packs to a tenth.
MOST_BYTES, MOST_TIMES = 1 << 29, 150
_MOST_PARTS, _SMALL = 10_000, 10_000_000
MOST_ROWS, _MOST_COLUMNS, _MOST_CELLS = 1 << 20, 1000, 50_000_000
_PROLOG = 4096
_NO_ARCHIVE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, EOFError, ValueError)


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
    if not path.is_file():
        raise BadInput(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; check the path")
    _check_archive(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on styles and extensions, which are not read
            book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
            try:
                return _read_book(book, path, columns)
            finally:
                book.close()
    except BadInput:
        raise
    except Exception as error:  # the library raises what its parsers raise; to the user each is an unreadable file
        raise BadInput(f"{path}: cannot be read as a workbook: {reason(error)}; save it again as .xlsx") from error


def _check_archive(path: Path) -> None:
    """Refuse what unpacks to more than a recording does, and XML that declares entities, before it is read."""
    try:
        with zipfile.ZipFile(path) as archive:
            parts = archive.infolist()
            size = sum(part.file_size for part in parts)
            too_much = size > MOST_BYTES or (size > _SMALL and size > MOST_TIMES * path.stat().st_size)
            if len(parts) > _MOST_PARTS or too_much:
                raise BadInput(f"{path}: unpacks to {len(parts)} parts, {size} bytes; save its one sheet as CSV")
            for part in parts:
                if part.filename.lower().endswith((".xml", ".rels")):
                    with archive.open(part) as file:
                        start = file.read(_PROLOG)
                    if b"<!DOCTYPE" in start or b"<!ENTITY" in start:
                        raise BadInput(f"{path}: its part {quoted(part.filename)} declares entities; save it again")
    except _NO_ARCHIVE as error:
        raise BadInput(f"{path}: is no workbook ({reason(error)}); save it as .xlsx") from None


def _read_book(book: openpyxl.Workbook, path: Path, columns: Mapping[str, int] | None) -> RawSignals:
    others = []
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # the declared size may be wrong
        rows = _checked(sheet.iter_rows(values_only=True), path)
        first = next((item for item in rows if any(cell is not None for cell in item[1])), None)
        if first is not None:
            others = [other.title for other in book.worksheets if other is not sheet]
            notes = [f"sheet {quoted(sheet.title)} read, {len(others)} others left out"] if others else []
            return read_sheet([first, *rows], f"{path}: sheet {quoted(sheet.title)}", columns, notes)
    raise BadInput(f"{path}: holds nothing; give a column a channel")


def _checked(rows: Iterator[Row], path: Path) -> Iterator[tuple[int, Row]]:
    """Yield the rows with their numbers, counted from 1; refuse a sheet that is too large."""
    cells = 0
    for number, row in enumerate(rows, start=1):
        cells += len(row)
        if number > MOST_ROWS or len(row) > _MOST_COLUMNS or cells > _MOST_CELLS:
            raise BadInput(
                f"{path}: row {number}, cell {len(row)}: a sheet of over {MOST_ROWS} rows, {_MOST_COLUMNS} columns or "
                f"{_MOST_CELLS} cells; save the recording as .lvm or .csv"
            )
        yield number, row
