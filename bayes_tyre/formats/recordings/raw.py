"""Reader of each suffix of raw recordings, and the recordings in a folder."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from bayes_tyre.errors import NO_MEMORY, BadInput
from bayes_tyre.formats.lvm.channels import grouped_warnings
from bayes_tyre.formats.lvm.reader import read_lvm
from bayes_tyre.formats.recordings.column_signals import numbered, read_columns
from bayes_tyre.record import Channel, RawSignals

type _Columns = Mapping[str, int] | None


def _read_lvm(path: Path, columns: _Columns) -> RawSignals:
    return numbered(read_lvm(path), columns, path)


# Libraries of the other formats are imported with the first such file: text files must not wait for them.
def _read_tdms(path: Path, columns: _Columns) -> RawSignals:
    from bayes_tyre.formats.recordings.tdms import read_tdms

    return numbered(read_tdms(path), columns, path)


def _read_mdf(path: Path, columns: _Columns) -> RawSignals:
    from bayes_tyre.formats.recordings.mdf import read_mdf

    return numbered(read_mdf(path), columns, path)


def _read_mat(path: Path, columns: _Columns) -> RawSignals:
    from bayes_tyre.formats.recordings.mat_signals import read_mat_signals

    return numbered(read_mat_signals(path), columns, path)


def _read_excel(path: Path, columns: _Columns) -> RawSignals:
    from bayes_tyre.formats.recordings.excel import read_excel

    return read_excel(path, columns)


READERS: dict[str, Callable[[Path, _Columns], RawSignals]] = {
    ".lvm": _read_lvm,
    ".txt": _read_lvm,
    ".tdms": _read_tdms,
    ".mf4": _read_mdf,
    ".mat": _read_mat,
    ".xlsx": _read_excel,
    ".csv": read_columns,
    ".parquet": read_columns,
}
#: The simulator's table of truths, which belongs to the recordings beside it.
TRUTH = "truth.csv"
#: Suffixes of recordings and nothing else; the others in the same folder may be tables, notes, results.
_RECORDINGS = (".lvm", ".tdms", ".mf4")


def read_raw(path: Path, columns: Mapping[str, int] | None = None) -> RawSignals:
    """Return the raw signals in a file.

    Parameters
    ----------
    path:
        A file with one of the suffixes in `READERS`.
    columns:
        Channel name -> column, counted from 1, with `time` among them, for files whose channels have no names of use.

    Raises
    ------
    BadInput
        If the file is missing, of another kind, or cannot be read.
    """
    suffix = path.suffix.lower()
    reader = READERS.get(suffix)
    if reader is None and path.is_dir():
        raise BadInput(f"{path}: is a folder; name a file in it")
    if reader is None:
        raise BadInput(f"{path}: {suffix or 'no suffix'} is no kind of recording; use {', '.join(READERS)}")
    try:
        if reader is not read_columns and not path.is_file():  # tables have words of their own for it
            raise BadInput(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; check the path")
        raw = reader(path, columns)
        return replace(raw, warnings=(*raw.warnings, *_uneven(raw)))
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}; check the path and the disk") from None
    except MemoryError:
        raise BadInput(f"{path}: {NO_MEMORY} to read it; cut it in pieces") from None


def _uneven(raw: RawSignals) -> list[str]:
    """Return warnings on channels whose samples do not follow one another at equal steps of time."""
    return [
        text
        for segment in raw.segments
        for text in grouped_warnings([(channel.name, _uneven_steps(channel)) for channel in segment])
    ]


def _uneven_steps(channel: Channel) -> str:
    at = channel.uneven_steps
    if not len(at) or np.isnan(channel.time_s).any():  # that X is blank is said by the reader
        return ""
    before, after = channel.time_s[at[0] : at[0] + 2]
    more = f" (and {len(at) - 1} more places)" if len(at) > 1 else ""
    if after <= before:
        return f"time does not increase from sample {at[0] + 1} at {before:g} s to the next at {after:g} s{more}"
    return f"samples are {channel.dt_s:g} s apart, but {after - before:g} s after sample {at[0] + 1}{more}"


def raw_files(paths: Iterable[Path]) -> tuple[list[Path], list[str]]:
    """Return the recordings that files and folders name, and warnings on files that were skipped.

    Of a folder, all `.lvm`, `.tdms` and `.mf4` files below it, sorted; where there are none, all files with another
    known suffix but `.txt`. A file that is named itself is taken whatever it is.

    Raises
    ------
    BadInput
        If a path is not there, or no recording is below a folder.
    """
    files: list[Path] = []
    warnings: list[str] = []
    for path in paths:
        if not path.is_dir():
            if not path.exists():
                raise BadInput(f"{path}: no such file; check the path")
            files.append(path)
            continue
        below = sorted(Path(folder) / name for folder, _, names in os.walk(path) for name in names)
        readable = [file for file in below if file.suffix.lower() in READERS and not file.name.startswith(".")]
        recordings = [file for file in readable if file.suffix.lower() in _RECORDINGS]
        tables = [file for file in readable if file.suffix.lower() not in (*_RECORDINGS, ".txt") and file.name != TRUTH]
        if recordings and tables:
            warnings.append(f"{path}: {len(tables)} tables beside the recordings are not read; name those that are raw")
        if not recordings and not tables:
            raise BadInput(f"{path}: holds no recording ({', '.join(READERS)}); name another folder")
        files += recordings or tables
    return list(dict.fromkeys(files)), warnings
