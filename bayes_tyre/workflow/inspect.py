"""Raw files in, a row a channel and segment out: what they hold, and what is odd about them."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder
from bayes_tyre.formats.raw import read_raw
from bayes_tyre.formats.tables import write_table
from bayes_tyre.record import Channel, RawSignals

COLUMNS = ("file", "segment", "channel", "unit", "samples", "dt_s", "first", "last", "min", "max", "missing")


def inspect_raw(
    files: Sequence[Path], out: Path | None, on_progress: Callable[[int], None]
) -> tuple[pd.DataFrame, list[str]]:
    """Return what raw files hold, and remarks on them, each with its file; write the table to `out` if given.

    Parameters
    ----------
    files:
        As `bayes_tyre.formats.raw.raw_files` finds them.
    out:
        A `.csv` or `.parquet` file.
    on_progress:
        Called with 1 after each file.

    Returns
    -------
    A row a channel and segment: `samples` counts its rows, `missing` those without a reading; `first`, `last`,
    `min`, `max` are readings in the unit of the file, `dt_s` the median step of X (s); NaN where there are none.

    Raises
    ------
    BadInput
        At the first file that cannot be read; nothing is written then.
    """
    if out is not None:
        if out.is_dir() or out.suffix.lower() not in (".csv", ".parquet"):
            raise BadInput(f"--out {out}: is no .csv or .parquet file; name one")
        check_folder(out.parent)
    rows: list[tuple[object, ...]] = []
    remarks: list[str] = []
    for file in files:
        raw = read_raw(file)
        name = path_text(file)
        rows += ((name, *row) for row in _rows_of(raw))
        remarks += [f"{name}: {remark}" for remark in raw.remarks]
        on_progress(1)
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    if out is not None:
        write_table(table, out)
    return table, remarks


def path_text(path: Path) -> str:
    """Return a path as text; bytes in it that are no text become escapes."""
    return str(path).encode("utf-8", "backslashreplace").decode("utf-8")


def _rows_of(raw: RawSignals) -> Iterator[tuple[object, ...]]:
    for i, segment in enumerate(raw.segments, start=1):
        for channel in segment:
            # Differences of printed times end in noise of their own.
            step = float(f"{channel.dt_s:.12g}")
            yield i, channel.name, channel.unit, len(channel.values), step, *_readings(channel)


def _readings(channel: Channel) -> tuple[float, float, float, float, int]:
    """Return the first, last, least and greatest reading, and how many samples are none."""
    there = ~np.isnan(channel.values)
    readings = channel.values[there]
    missing = len(channel.values) - len(readings)
    if not len(readings):
        return (np.nan, np.nan, np.nan, np.nan, missing)
    return float(readings[0]), float(readings[-1]), float(readings.min()), float(readings.max()), missing
