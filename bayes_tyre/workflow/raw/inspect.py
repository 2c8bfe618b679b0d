"""Inspection of raw files: a row a channel and segment, and notes on the files."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.plain_text import path_text
from bayes_tyre.record import Channel, RawSignals

COLUMNS = ("file", "segment", "channel", "unit", "samples", "dt_s", "first", "last", "min", "max", "missing")


def inspect_raw(
    files: Sequence[Path], out: Path | None, on_progress: Callable[[int], None]
) -> tuple[pd.DataFrame, list[str], list[str]]:
    """Return the channels of raw files; write the table to `out`, if given, where all files can be read.

    Parameters
    ----------
    files:
        As `bayes_tyre.formats.recordings.raw.raw_files` finds them.
    out:
        A `.csv` or `.parquet` file.
    on_progress:
        Called with 1 after each file.

    Returns
    -------
    A row a channel and segment of the files that can be read; notes on how these differ from what is usual, each with
    its file; and why the others cannot be read, a line each. In the table `samples` counts a channel's rows, `missing`
    those without a reading; `first`, `last`, `min`, `max` are readings in the unit of the file, `dt_s` the median step
    of X (s); NaN where there are none.

    Raises
    ------
    BadInput
        If `out` cannot be used.
    """
    if out is not None:
        if out.is_dir() or out.suffix.lower() not in (".csv", ".parquet"):
            raise BadInput(f"--out {out}: is no .csv or .parquet file; name one")
        check_folder(out.parent)
    rows: list[tuple[object, ...]] = []
    notes: list[str] = []
    faults: list[str] = []
    for file in files:
        name = path_text(file)
        try:
            raw = read_raw(file)
        except BadInput as error:
            faults.append(str(error))
        else:
            rows += ((name, *row) for row in _rows_of(raw))
            notes += [f"{name}: {text}" for text in raw.warnings]
        on_progress(1)
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    if out is not None and not faults:
        write_table(table, out)
    return table, notes, faults


def _rows_of(raw: RawSignals) -> Iterator[tuple[object, ...]]:
    for i, segment in enumerate(raw.segments, start=1):
        for channel in segment:
            # Differences of printed times have rounding noise in their last digits.
            step = float(f"{channel.dt_s:.12g}")
            yield i, channel.name, channel.unit, len(channel.values), step, *_readings(channel)


def _readings(channel: Channel) -> tuple[float, float, float, float, int]:
    """Return the first, last, least and greatest reading, and the number of missing samples."""
    present = ~np.isnan(channel.values)
    readings = channel.values[present]
    missing = len(channel.values) - len(readings)
    if not len(readings):
        return (np.nan, np.nan, np.nan, np.nan, missing)
    return float(readings[0]), float(readings[-1]), float(readings.min()), float(readings.max()), missing
