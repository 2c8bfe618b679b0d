"""Writer of `.lvm` files in LabVIEW's format, in the layout of the source's appendix B1."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from bayes_tyre.formats.files import whole_file
from bayes_tyre.formats.lvm.roles import is_x
from bayes_tyre.record import Channel, RawSignals

DECIMALS = 6
#: A step is written exactly if it can be, with as many decimals at most.
_MOST_DECIMALS = 12
_SCALE = 10**DECIMALS
#: Above it a number times the scale is no int64; such columns are written number by number.
_LARGEST = 9e12
_FIXED = {"Writer_Version": "2", "Reader_Version": "2", "Separator": "Tab", "Decimal_Separator": "."}
#: Date and time are LabVIEW's epoch: nothing that could be taken for a time of recording.
_HEADER = {"Time_Pref": "Relative", "Operator": "bayes-tyre", "Date": "1904/01/01", "Time": "00:00:00"}
_END = "***End_of_Header***"


def write_lvm(raw: RawSignals, path: Path, notes: str = "") -> Path:
    """Write raw signals as an `.lvm` file, whole or not at all; return the path.

    Parameters
    ----------
    raw:
        Segments whose channels can share one X column: each begins with the times of the longest, or has times of
        its own at equal steps.
    path:
        The file; tab separated, one X column, six decimals; NaN is written as such.
    notes:
        One line that every segment's header carries, such as where simulated signals come from.

    Raises
    ------
    ValueError
        If there is no channel, or channels cannot share an X column.
    """
    layout = {**_FIXED, "Multi_Headings": "Yes" if len(raw.segments) > 1 else "No", "X_Columns": "One"}
    if not raw.segments or not all(raw.segments):
        raise ValueError("a segment without a channel cannot be written")
    lines = ["LabVIEW Measurement\t", *(f"{tag}\t{text}" for tag, text in (layout | _HEADER).items())]
    with whole_file(path) as beside, beside.open("wb") as file:
        file.write("\n".join([*lines, f"{_END}\t", "\t", ""]).encode())
        for i, segment in enumerate(raw.segments):
            file.write(b"\t\n" if i else b"")
            _write_segment(file, segment, notes)
    return path


def _line(text: str) -> str:
    """Return text without what would end its cell or its line."""
    return " ".join(text.split())


def _write_segment(file: BinaryIO, segment: Sequence[Channel], notes: str) -> None:
    longest = max(segment, key=lambda channel: len(channel.values))
    rows = len(longest.values)
    base = longest.dt_s if rows > 1 else 1.0
    steps = [_step(channel, longest, base) for channel in segment]
    columns = [_x_column(longest.time_s, base), *(_value_column(channel.values, rows) for channel in segment)]
    file.write("\n".join(_header_lines(segment, longest, steps, notes)).encode())
    if rows:
        table = pa.table(columns, names=[str(i) for i in range(len(columns))])
        options = pa_csv.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
        pa_csv.write_csv(table, file, options)


def _step(channel: Channel, longest: Channel, base: float) -> float:
    """Return the step of a channel's times (s); refuse what would not come back from X, X0 and Delta_X."""
    times, x = channel.time_s, longest.time_s[: len(channel.time_s)]
    if is_x(channel.name):
        raise ValueError(f"a channel named {channel.name!r} would be taken for X")
    if not np.isfinite(times).all():
        raise ValueError(f"channel {channel.name!r} has a time that is no number")
    if np.array_equal(times, x):
        return base if len(times) != 1 or len(longest.time_s) == 1 else 1.0
    step = channel.dt_s if len(times) > 1 else 1.0
    same = math.isclose(step, base, rel_tol=1e-6)
    course = x - x[0] if same else step * np.arange(len(times))
    if step <= 0 or not np.allclose(times - times[0], course, rtol=0, atol=1e-3 * step):
        raise ValueError(f"channel {channel.name!r} has times that one X column cannot hold")
    return step


def _header_lines(segment: Sequence[Channel], longest: Channel, steps: Sequence[float], notes: str) -> Iterator[str]:
    texts = [_line(notes)] if notes.strip() else []
    if any(len(channel.values) != len(longest.values) for channel in segment):
        texts.append(f"X values guaranteed valid only for {_line(longest.name)}")
    cells = {
        **({"Notes": ["; ".join(texts), *[""] * (len(segment) - 1)]} if texts else {}),
        "Channels": [str(len(segment)), *[""] * (len(segment) - 1)],
        "Samples": [str(len(channel.values)) for channel in segment],
        "Date": [_HEADER["Date"]] * len(segment),
        "Time": [_HEADER["Time"]] * len(segment),
        "Y_Unit_Label": [_line(channel.unit) for channel in segment],
        "X_Dimension": ["Time"] * len(segment),
        "X0": [f"{channel.time_s[0] if len(channel.time_s) else 0.0:.16E}" for channel in segment],
        "Delta_X": [_written(step) for step in steps],
        _END: [""] * len(segment),
    }
    for tag, texts in cells.items():
        yield "\t".join([tag, *texts, ""])
    yield "\t".join(["X_Value", *(_line(channel.name) for channel in segment), "Comment"])
    yield ""


def _decimals(step: float) -> int:
    """Return with how many decimals times at this step are written: six, or more if that is not the step."""
    exact = (n for n in range(DECIMALS, _MOST_DECIMALS) if math.isclose(round(step, n), step, rel_tol=1e-6))
    return next(exact, _MOST_DECIMALS)


def _written(step: float) -> str:
    return f"{step:.{DECIMALS}f}" if _decimals(step) == DECIMALS else f"{step:.16E}"


def _x_column(times: np.ndarray, step: float) -> pa.Array:
    decimals = _decimals(step)
    if decimals == DECIMALS and np.abs(times).max(initial=0.0) < _LARGEST:
        return _as_decimals(times)
    return pa.array([f"{time:.{decimals}f}" for time in times.tolist()], type=pa.string())


def _value_column(values: np.ndarray, rows: int) -> pa.Array:
    """Return a column of six decimals, blank below the channel's last sample."""
    if np.isfinite(values).all() and np.abs(values).max(initial=0.0) < _LARGEST:
        column = _as_decimals(np.asarray(values, dtype=float))
    else:
        column = pa.array([_text(value) for value in values.tolist()], type=pa.string())
    short = rows - len(values)
    return pa.concat_arrays([column, pa.nulls(short, column.type)]) if short else column


def _text(value: float) -> str:
    return f"{value:.{DECIMALS}f}" if math.isfinite(value) else {"nan": "NaN", "inf": "Inf", "-inf": "-Inf"}[str(value)]


def _as_decimals(numbers: np.ndarray) -> pa.Array:
    """Return numbers as Arrow's decimals of six places, which it writes ten times as fast as Python writes floats."""
    low = np.rint(numbers * _SCALE).astype(np.int64)
    words = np.column_stack([low, low >> 63])  # 128 bits: the upper 64 repeat the sign
    return pa.Array.from_buffers(
        pa.decimal128(25, DECIMALS), len(numbers), [None, pa.py_buffer(np.ascontiguousarray(words))]
    )
