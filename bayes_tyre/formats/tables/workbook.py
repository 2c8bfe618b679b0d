"""Rows of a sheet of an Excel workbook (`.xlsx`): saved values, no formula computed, archives checked first."""

import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.header import SEARCHED
from bayes_tyre.plain_text import listed, quoted, reason

type Row = Sequence[object]
type NumberedRows = Sequence[tuple[int, Row]]

#: Bytes that an archive may hold unpacked, and times its own size; a sheet of 150,000 x 13 numbers is some 80 MB, and
#: packs to a tenth.
MOST_BYTES, MOST_TIMES = 1 << 29, 150
_MOST_PARTS, _SMALL = 10_000, 10_000_000
MOST_ROWS, _MOST_COLUMNS, _MOST_CELLS = 1 << 20, 1000, 50_000_000
_PROLOG = 4096
_NO_ARCHIVE = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, EOFError, ValueError)


class Sheet(NamedTuple):
    """The rows of a sheet, counted from 1, the first with anything in it first; and the titles of the other sheets."""

    title: str
    rows: NumberedRows
    others: Sequence[str]

    @property
    def notes(self) -> list[str]:
        """What to say of the other sheets."""
        others = listed(self.others, 3, quoted)
        return [f"sheet {quoted(self.title)} read; left out: {others}"] if self.others else []


def split_sheet(path: Path) -> tuple[Path, str | None]:
    """Return the file and the sheet that ``FILE.xlsx#Sheet`` names; None where it names no sheet."""
    name, mark, title = path.name.rpartition("#")
    if mark and name.lower().endswith(".xlsx") and not path.exists():
        return path.with_name(name), title
    return path, None


def read_rows(path: Path, title: str | None = None, names_in: Callable[[NumberedRows], int] | None = None) -> Sheet:
    """Return the rows of the sheet of that title; None: of the first that holds anything.

    Parameters
    ----------
    path, title:
        The workbook, and a sheet of it.
    names_in:
        Number of the names looked for in the top rows of a sheet: without a title, the first sheet with most of them
        is read. A workbook often begins with a cover sheet.

    Returns
    -------
    Cached values of formulas; a formula without one and a blank cell are None.

    Raises
    ------
    BadInput
        If the file is no workbook, unpacks to more than a recording does, or lacks the sheet.
    """
    _check_archive(path)
    import openpyxl  # half a second that most tables do not need

    try:
        # Opened here, because the library leaves a file open where it fails.
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on styles and extensions, which are not read
            book = openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
            try:
                return _sheet(book, path, title, names_in)
            finally:
                book.close()
    except (BadInput, MemoryError):
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


def _sheet(book: Any, path: Path, title: str | None, names_in: Callable[[NumberedRows], int] | None) -> Sheet:
    titles = [sheet.title for sheet in book.worksheets]
    chosen = [sheet for sheet in book.worksheets if title in (None, sheet.title)]
    for sheet in chosen:
        sheet.reset_dimensions()  # the declared size may be wrong
    if names_in is not None and len(chosen) > 1:
        chosen.sort(key=lambda sheet: -names_in(_top(sheet, path)))  # a stable order: the first of equals is first
    for sheet in chosen:
        rows = _checked(sheet.iter_rows(values_only=True), path)
        first = next((item for item in rows if any(cell is not None for cell in item[1])), None)
        if first is not None:
            others = [other for other in titles if other != sheet.title] if title is None else []
            return Sheet(sheet.title, [first, *rows], others)
    if title is not None and not chosen:
        raise BadInput(f"{path}: no sheet {quoted(title)}; name one of {listed(titles, show=quoted)}")
    raise BadInput(f"{path}: holds nothing; give a column a channel")


def _top(sheet: Any, path: Path) -> NumberedRows:
    """Return the rows of a sheet among which its header is."""
    return [*islice(_checked(sheet.iter_rows(values_only=True), path), SEARCHED)]


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
