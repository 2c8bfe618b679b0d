"""Tables on disk: CSV and Parquet, read with one kind of error and written whole or not at all."""

import csv
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd

from bayes_tyre.errors import BadInput


def _read_csv(path: Path) -> pd.DataFrame:
    # Cells stay as they are written: an empty cell or 'NA' must be found and named, not silently become NaN.
    with path.open(encoding="utf-8-sig", newline="") as lines:
        header = next(csv.reader(lines), [])
    twice = [name for i, name in enumerate(header) if name in header[:i]]
    if twice:  # pandas would rename the second, and it would pass for a column of its own
        raise ValueError(f"column {twice[0]!r} stands twice")
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            return pd.read_csv(
                path,
                encoding="utf-8-sig",
                index_col=False,  # or a first cell too many becomes an index, and all others move one column on
                keep_default_na=False,
                low_memory=False,
                dtype=dict.fromkeys(("record", "configuration", "direction", "origin"), str),
            )
        except pd.errors.ParserWarning:
            raise ValueError("rows hold more cells than the header") from None


READERS: dict[str, Callable[[Path], pd.DataFrame]] = {".csv": _read_csv, ".parquet": pd.read_parquet}


def read_table(path: Path) -> pd.DataFrame:
    """Return the table in a `.csv` or `.parquet` file, cells unchecked.

    Raises
    ------
    BadInput
        If the file is missing, a folder, empty, of another kind, or cannot be parsed.
    """
    if not path.exists():
        raise BadInput(f"{path}: no such file; check the path")
    if path.is_dir():
        raise BadInput(f"{path}: is a folder, not a table; name a .csv or .parquet file in it")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise BadInput(f"{path}: {path.suffix or 'no suffix'} is not a table format; use {' or '.join(READERS)}")
    if path.stat().st_size == 0:
        raise BadInput(f"{path}: the file is empty; give at least a header and one record")
    try:
        return reader(path)
    except Exception as error:  # parsers raise a dozen kinds; to the user each is an unreadable file
        reason = " ".join(str(error).split())[:200]
        remedy = "mend it, or save it again" + (" as UTF-8" if reader is _read_csv else "")
        raise BadInput(f"{path}: cannot be read as {path.suffix[1:]}: {reason}; {remedy}") from error


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; it takes its place only when the block ends without an error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=path.suffix)
    os.close(handle)
    beside = Path(name)
    try:
        yield beside
        beside.chmod(0o666 & ~_umask())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_table(table: pd.DataFrame, path: Path) -> Path:
    """Write a table as `.csv` or `.parquet`, whole or not at all, numbers unrounded; return the path."""
    with whole_file(path) as beside:
        if path.suffix.lower() == ".parquet":
            table.to_parquet(beside, index=False)
        else:
            table.to_csv(beside, index=False, lineterminator="\n")
    return path


def write_text(text: str, path: Path) -> Path:
    """Write UTF-8 text, whole or not at all; return the path."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8")
    return path
