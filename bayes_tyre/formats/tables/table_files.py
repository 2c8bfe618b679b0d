"""Tables on disk: CSV, Parquet, Excel and MATLAB, read with one kind of error; CSV and Parquet are written."""

import csv
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import pandas as pd

from bayes_tyre.errors import NO_MEMORY, BadInput, out_of_memory
from bayes_tyre.formats.files import whole_file
from bayes_tyre.formats.tables.decimals import numbers_of_texts, read_by_decimals
from bayes_tyre.formats.tables.dialect import Dialect, blank_lines_in, find_dialect, first_long_row, lines_below
from bayes_tyre.formats.tables.formulas import as_meant, harmless, map_texts, texts_of
from bayes_tyre.formats.tables.header import (
    BLANK_LINES,
    FIRST_LINE,
    NOTES,
    SEARCHED,
    UNITS_ROW,
    Layout,
    blank_lines,
    check_twice,
    units_in,
)
from bayes_tyre.formats.tables.workbook import read_rows, split_sheet
from bayes_tyre.formats.tydex.table import read_tydex_table
from bayes_tyre.formats.unpacked import MOST_BYTES, check_parquet
from bayes_tyre.plain_text import reason
from bayes_tyre.record import TEXT_COLUMNS

#: Characters of one cell; our own tables have cells that name several labels.
MOST_TEXT = 50_000
#: Columns of names, which may look like numbers: `01` stays `01`; of slow tests, and of models in `comparison.csv`.
_NAMES = (*TEXT_COLUMNS, "test", "model")
_MEMORY = "give it more memory or, where it may be damaged, save it again"
_WORKBOOKS = (".xlsm", ".xlsb", ".xls", ".ods")
_TEXTS = (".txt", ".tsv", ".dat", ".asc")


def _read_csv(path: Path, layout: Layout | None) -> pd.DataFrame:
    dialect = find_dialect(path, layout)
    ours = dialect.names if layout is None else layout.renamed(dialect.names, path)
    table = read_by_decimals(lambda decimal: _parse(path, dialect, decimal, ours), path, dialect.separator)
    # A spreadsheet writes a separator for every column that once held a cell.
    unnamed = [table.columns[i] for i, name in enumerate(ours) if not name]
    table = table.drop(columns=[name for name in unnamed if (table[name] == "").all()])
    table.attrs[UNITS_ROW] = dict(zip(ours, dialect.units, strict=False))
    return map_texts(table, lambda text: as_meant(_text(text)))


def _parse(path: Path, dialect: Dialect, decimal: str, ours: Sequence[str]) -> pd.DataFrame:
    # Cells stay as they are written: an empty cell or 'NA' must be found and named, not silently become NaN.
    with warnings.catch_warnings(), path.open(encoding=dialect.encoding, newline="") as lines:
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            table = pd.read_csv(
                lines_below(lines, dialect.above),
                sep=dialect.separator,
                decimal=decimal,
                skiprows=None if dialect.units_row is None else [dialect.units_row],
                index_col=False,  # or a first cell too many becomes an index, and all others move one column on
                keep_default_na=False,
                low_memory=False,
                dtype={name: str for name, our in zip(dialect.header, ours, strict=True) if our in _NAMES},
            )
        except (pd.errors.ParserWarning, pd.errors.ParserError):
            wrong = first_long_row(path, dialect)
            if not wrong:
                raise
        else:
            table.columns = [our or str(name) for our, name in zip(ours, table.columns, strict=True)]
            table.attrs |= {FIRST_LINE: dialect.first_line, BLANK_LINES: blank_lines_in(path, dialect, len(table))}
            return table
    commas = " (a decimal comma makes two of one: put semicolons between the cells)" if dialect.separator == "," else ""
    raise BadInput(f"{path}: {wrong}; mend the row{commas}")


def _read_parquet(path: Path, layout: Layout | None) -> pd.DataFrame:
    check_parquet(path)
    table = pd.read_parquet(path)
    if any(name is not None for name in table.index.names):  # a column that pandas keeps as its index
        table = table.reset_index()
    return _renamed(map_texts(table, _text), path, layout)


def _read_mat(path: Path, layout: Layout | None) -> pd.DataFrame:
    from bayes_tyre.formats.tables.mat_table import read_mat_table  # imports SciPy and h5py

    return _renamed(map_texts(read_mat_table(path), _text), path, layout)


def _read_tydex(path: Path, layout: Layout | None) -> pd.DataFrame:
    return _renamed(read_tydex_table(path), path, layout)


def _renamed(table: pd.DataFrame, path: Path, layout: Layout | None) -> pd.DataFrame:
    return table if layout is None else table.set_axis(layout.renamed([*map(str, table.columns)], path), axis=1)


def _read_xlsx(path: Path, layout: Layout | None) -> pd.DataFrame:
    sheet = read_rows(*split_sheet(path), names_in=None if layout is None else layout.names_in)
    first = 0 if layout is None else layout.skip_rows or 0
    rows = [(number, row) for number, row in sheet.rows if number > first and any(cell is not None for cell in row)]
    if layout is not None and layout.skip_rows is None:
        head = [[cell for cell in row if isinstance(cell, str)] for _, row in rows[:SEARCHED]]
        rows = rows[layout.header(head) :]
    names = ["" if cell is None else str(cell).strip() for cell in rows[0][1]] if rows else []
    units = units_in(rows[1][1]) if layout is not None and len(rows) > 1 else ()
    rows = rows[2:] if units else rows[1:]
    width = max([len(names), *(len(row) for _, row in rows)])
    names += [""] * (width - len(names))
    ours = names if layout is None else layout.renamed(names, path)
    check_twice(ours, path)
    cells = pd.DataFrame([[*row, *[None] * (width - len(row))] for _, row in rows], columns=range(width), dtype=object)
    used = [i for i in range(width) if ours[i] or cells[i].notna().any()]
    table = cells[used].set_axis([ours[i] or f"column {i + 1}" for i in used], axis=1).infer_objects()
    table.attrs |= {NOTES: sheet.notes, UNITS_ROW: dict(zip(ours, units, strict=False))}
    first = rows[0][0] if rows else 2
    table.attrs |= {FIRST_LINE: first, BLANK_LINES: blank_lines([number for number, _ in rows], first)}
    return numbers_of_texts(map_texts(table, _text), path)


def _text(text: str) -> str:
    if len(text) > MOST_TEXT:
        raise ValueError(f"a text of {len(text)} characters is no label ({text[:40]!r}...)")
    if "\0" in text:  # a netCDF file could not hold it
        raise ValueError(f"{text[:40]!r} holds a zero byte, which is no text")
    return text


def _write_csv(table: pd.DataFrame, path: Path) -> None:
    table = map_texts(table, harmless)
    table.to_csv(path, index=False, lineterminator="\n", quoting=quoting_of(table), errors="backslashreplace")


def _write_parquet(table: pd.DataFrame, path: Path) -> None:
    table.to_parquet(path, index=False)


READERS: dict[str, Callable[[Path, Layout | None], pd.DataFrame]] = {
    **{".csv": _read_csv, ".parquet": _read_parquet, ".xlsx": _read_xlsx, ".mat": _read_mat, ".tdx": _read_tydex}
}
_KINDS = f"{', '.join([*READERS][:-1])} or {[*READERS][-1]}"
#: A path with another suffix is written as CSV.
WRITERS: dict[str, Callable[[pd.DataFrame, Path], None]] = {".csv": _write_csv, ".parquet": _write_parquet}


def read_table(path: Path, layout: Layout | None = None) -> pd.DataFrame:
    """Return the table in a `.csv`, `.parquet`, `.xlsx`, `.mat` or TYDEX (`.tdx`) file, cells unchecked.

    A CSV file may have commas, semicolons or tabs between its cells, decimal commas beside semicolons or tabs, and be
    UTF-8, Windows-1252 or, with its byte-order mark, UTF-16. Text comes back as it was before `write_table` made it
    harmless. ``FILE.xlsx#Sheet`` names a sheet.

    Parameters
    ----------
    path:
        The file.
    layout:
        For a lab's table: what to look for in the header, below which units may stand, and how to rename columns;
        then `attrs` say what was found (`formats.header`). None: the header is the first line, nothing is renamed.

    Raises
    ------
    BadInput
        If the file is missing, a folder, empty, of another kind, or cannot be parsed.
    """
    file = split_sheet(path)[0]
    if not file.exists():
        raise BadInput(f"{path}: no such file; check the path")
    if file.is_dir():
        raise BadInput(f"{path}: is a folder, not a table; name a {_KINDS} file in it")
    suffix = file.suffix.lower()
    reader = READERS.get(suffix)
    if reader is None:
        raise BadInput(f"{path}: {file.suffix or 'no suffix'} is not a table format; {_remedy(suffix)}")
    try:
        if file.stat().st_size == 0:
            raise BadInput(f"{path}: the file is empty; give at least a header and one record")
        return reader(path, layout)
    except BadInput:
        raise
    except PermissionError:
        raise BadInput(f"{path}: may not be read; ask for the permission to read it") from None
    except Exception as error:  # parsers raise many kinds of error
        if out_of_memory(error):
            if file.stat().st_size > MOST_BYTES:
                raise MemoryError from error
            raise BadInput(f"{path}: {NO_MEMORY} for what it claims to hold; {_MEMORY}") from None
        remedy = "mend it, or save it again" + (" as UTF-8" if reader is _read_csv else "")
        raise BadInput(f"{path}: cannot be read as {suffix[1:]}: {reason(error)}; {remedy}") from error


def _remedy(suffix: str) -> str:
    use = f"use {_KINDS}"
    if suffix in _WORKBOOKS:
        return f"{use}: save it as .xlsx, or the sheet as CSV (UTF-8)"
    return f"{use}: name it .csv if commas, semicolons or tabs stand between its cells" if suffix in _TEXTS else use


def write_table(table: pd.DataFrame, path: Path) -> Path:
    """Write a table as `.csv` or `.parquet`, whole or not at all, numbers unrounded; return the path.

    In a CSV, text that a spreadsheet would take for a formula gets an apostrophe before it; `read_table` takes it
    away again.
    """
    with whole_file(path) as beside:
        WRITERS.get(path.suffix.lower(), _write_csv)(table, beside)
    return path


def quoting_of(table: pd.DataFrame) -> Literal[0, 2]:
    """Return which cells of a table need quotes in a CSV, as `csv` counts it."""
    # Python 3.12 leaves a lone carriage return without quotes, and every reader takes it for the end of a row.
    returns = any("\r" in text for i in range(table.shape[1]) for text in texts_of(table.iloc[:, i]))
    return csv.QUOTE_NONNUMERIC if returns else csv.QUOTE_MINIMAL
