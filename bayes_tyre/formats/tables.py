"""Tables on disk: CSV and Parquet, read with one kind of error."""

import csv
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.decimals import read_by_decimals
from bayes_tyre.formats.dialect import Dialect, find_dialect, first_long_row
from bayes_tyre.formats.files import whole_file
from bayes_tyre.formats.formulas import as_meant, harmless, map_texts, texts_of
from bayes_tyre.formats.tydex.table import read_tydex_table
from bayes_tyre.plain_text import reason
from bayes_tyre.record import TEXT_COLUMNS

_WORKBOOKS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
_TEXTS = (".txt", ".tsv", ".dat", ".asc")


def _read_csv(path: Path) -> pd.DataFrame:
    dialect = find_dialect(path)
    table = read_by_decimals(lambda decimal: _parse(path, dialect, decimal), path, dialect.separator)
    # A spreadsheet writes a separator for every column that once held a cell.
    unnamed = [table.columns[i] for i, name in enumerate(dialect.names) if not name]
    table = table.drop(columns=[name for name in unnamed if (table[name] == "").all()])
    return map_texts(table, lambda text: as_meant(_text(text)))


def _parse(path: Path, dialect: Dialect, decimal: str) -> pd.DataFrame:
    # Cells stay as they are written: an empty cell or 'NA' must be found and named, not silently become NaN.
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            return pd.read_csv(
                path,
                sep=dialect.separator,
                decimal=decimal,
                encoding=dialect.encoding,
                index_col=False,  # or a first cell too many becomes an index, and all others move one column on
                keep_default_na=False,
                low_memory=False,
                dtype=dict.fromkeys(TEXT_COLUMNS, str),
            ).rename(columns=str.strip)
        except (pd.errors.ParserWarning, pd.errors.ParserError):
            wrong = first_long_row(path, dialect)
            if not wrong:
                raise
    commas = " (a decimal comma makes two of one: put semicolons between the cells)" if dialect.separator == "," else ""
    raise BadInput(f"{path}: {wrong}; mend the row{commas}")


def _read_parquet(path: Path) -> pd.DataFrame:
    return map_texts(pd.read_parquet(path), _text)


def _text(text: str) -> str:
    if "\0" in text:  # a netCDF file could not hold it
        raise ValueError(f"{text[:40]!r} holds a zero byte, which is no text")
    return text


def _write_csv(table: pd.DataFrame, path: Path) -> None:
    table = map_texts(table, harmless)
    table.to_csv(path, index=False, lineterminator="\n", quoting=quoting_of(table), errors="backslashreplace")


def _write_parquet(table: pd.DataFrame, path: Path) -> None:
    table.to_parquet(path, index=False)


READERS: dict[str, Callable[[Path], pd.DataFrame]] = {
    ".csv": _read_csv,
    ".parquet": _read_parquet,
    ".tdx": read_tydex_table,
}
_KINDS = " or ".join(READERS)
#: A path with another suffix is written as CSV.
_WRITERS: dict[str, Callable[[pd.DataFrame, Path], None]] = {".csv": _write_csv, ".parquet": _write_parquet}


def read_table(path: Path) -> pd.DataFrame:
    """Return the table in a `.csv`, `.parquet` or TYDEX (`.tdx`) file, cells unchecked.

    A CSV file may have commas, semicolons or tabs between its cells, decimal commas beside semicolons or tabs, and
    be UTF-8 or, with its byte-order mark, UTF-16. Text comes back as it was before `write_table` made it harmless.

    Raises
    ------
    BadInput
        If the file is missing, a folder, empty, of another kind, or cannot be parsed.
    """
    if not path.exists():
        raise BadInput(f"{path}: no such file; check the path")
    if path.is_dir():
        raise BadInput(f"{path}: is a folder, not a table; name a {_KINDS} file in it")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise BadInput(f"{path}: {path.suffix or 'no suffix'} is not a table format; {_remedy(path.suffix.lower())}")
    try:
        if path.stat().st_size == 0:
            raise BadInput(f"{path}: the file is empty; give at least a header and one record")
        return reader(path)
    except (BadInput, MemoryError):
        raise
    except PermissionError:
        raise BadInput(f"{path}: may not be read; ask for the permission to read it") from None
    except Exception as error:  # parsers raise many kinds of error
        remedy = "mend it, or save it again" + (" as UTF-8" if reader is _read_csv else "")
        raise BadInput(f"{path}: cannot be read as {path.suffix[1:]}: {reason(error)}; {remedy}") from error


def _remedy(suffix: str) -> str:
    use = f"use {_KINDS}"
    if suffix in _WORKBOOKS:
        return f"{use}: save the sheet as CSV (UTF-8)"
    return f"{use}: name it .csv if commas, semicolons or tabs stand between its cells" if suffix in _TEXTS else use


def write_table(table: pd.DataFrame, path: Path) -> Path:
    """Write a table as `.csv` or `.parquet`, whole or not at all, numbers unrounded; return the path.

    In a CSV, text that a spreadsheet would take for a formula gets an apostrophe before it; `read_table` takes it
    away again.
    """
    with whole_file(path) as beside:
        _WRITERS.get(path.suffix.lower(), _write_csv)(table, beside)
    return path


def quoting_of(table: pd.DataFrame) -> Literal[0, 2]:
    """Return which cells of a table need quotes in a CSV, as `csv` counts it."""
    # Python 3.12 leaves a lone carriage return without quotes, and every reader takes it for the end of a row.
    returns = any("\r" in text for i in range(table.shape[1]) for text in texts_of(table.iloc[:, i]))
    return csv.QUOTE_NONNUMERIC if returns else csv.QUOTE_MINIMAL
