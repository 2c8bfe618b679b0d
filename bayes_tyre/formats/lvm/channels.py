"""Channels with a time for every sample, from columns of numbers and a header."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bayes_tyre.plain_text import listed, quoted
from bayes_tyre.record import Channel

_LONGEST_NUMBER = 60


class Roles(NamedTuple):
    """The role of each column of a table.

    Attributes
    ----------
    channels:
        Columns that are channels.
    x:
        The X column of each; None where there is none.
    shift:
        A channel's cell in a line of the header is that of its column number less 1, plus this.
    """

    channels: tuple[int, ...]
    x: tuple[int | None, ...]
    shift: int = 0


class ChannelHeader(NamedTuple):
    """A header's entries for one channel; NaN or None where there is no entry."""

    unit: str
    samples: int | None
    x0: float
    delta: float


def is_x(name: str) -> bool:
    """Return whether a column of this name holds X values."""
    return name.strip().lower().replace(" ", "_") == "x_value"


def find_roles(names: Sequence[str], last: int, x_columns: str) -> Roles:
    """Return the roles of the first `last` columns, from their names and the header's `X_Columns`."""
    at = [i for i in range(last) if is_x(names[i])]
    if len(at) > 1:
        channels = tuple(i for i in range(last) if i not in set(at))
        return Roles(channels, tuple(max((x for x in at if x < i), default=None) for i in channels))
    none = x_columns.strip().lower() == "no"
    if none and at != [0]:
        return Roles(tuple(range(last)), (None,) * last, shift=1)
    return Roles(tuple(range(1, last)), (None if none else 0,) * max(last - 1, 0))


def channel_headers(header: dict[str, list[str]], roles: Roles) -> list[ChannelHeader]:
    """Return the header's entries for each channel."""

    def cells(tag: str) -> list[str]:
        written = header.get(tag, [])
        at = [i - 1 + roles.shift for i in roles.channels]
        names = [written[i] if 0 <= i < len(written) else "" for i in at]
        given = [cell for cell in written if cell]
        # With an X column each, some recorders write the header without the blank cells above those columns.
        return given if not all(names) and len(set(roles.x)) > 1 and len(given) == len(names) else names

    tags = ("Y_Unit_Label", "Samples", "X0", "Delta_X")
    return [
        ChannelHeader(unit, _count(samples), _number(x0), _step(delta))
        for unit, samples, x0, delta in zip(*map(cells, tags), strict=True)
    ]


def _count(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 16 else None


def _number(text: str) -> float:
    try:
        number = float(text.replace(",", ".")) if len(text) <= _LONGEST_NUMBER else math.nan
    except ValueError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def _step(text: str) -> float:
    step = _number(text)
    return step if step > 0 else math.nan


def build_channels(
    names: Sequence[str], roles: Roles, columns: Sequence[np.ndarray], headers: Sequence[ChannelHeader], valid_for: str
) -> tuple[tuple[Channel, ...], list[str]]:
    """Return the channels of one table, and warnings on them.

    Parameters
    ----------
    names, columns:
        Of all columns; shape (rows,) each, NaN where a cell is blank.
    roles, headers:
        The roles of the columns, and the header's entries for each channel.
    valid_for:
        The only channel for which a single X column is valid; empty for the first.
    """
    written = max((one.samples for one in headers if one.samples is not None), default=None)
    labels = [names[i] for i in roles.channels]
    x_columns = len(set(roles.x)) > 1
    reference = headers[labels.index(valid_for)] if valid_for in labels else (headers[0] if headers else None)
    channels, warnings = [], []
    for name, i, x, one in zip(labels, roles.channels, roles.x, headers, strict=True):
        times = None if x is None or np.isnan(columns[x]).all() else columns[x]
        rows = _rows_of(columns[i], times if x_columns else None, one.samples, written)
        time_s, warning = _times(rows, times, one, one if x_columns or reference is None else reference, written)
        warnings.append((name, warning))
        channels.append(Channel(name, one.unit, time_s, columns[i][rows], one.samples))
    return tuple(channels), [*grouped_warnings(warnings), *_backwards(columns, roles)]


type _Rows = slice | np.ndarray


def _rows_of(values: np.ndarray, own_x: np.ndarray | None, declared: int | None, written: int | None) -> _Rows:
    """Return the rows of a table that are a channel's samples.

    Rows were written in blocks of `written` samples. A channel with fewer samples fills the first rows of each block.
    """
    if own_x is not None:  # a row blank in both belongs to a longer channel
        return np.flatnonzero(~(np.isnan(values) & np.isnan(own_x)))
    if declared is None or written is None:
        return slice(0, _last(~np.isnan(values)))
    if declared >= written:
        return slice(0, len(values))
    inside = np.arange(len(values)) % written < declared
    beyond = ~np.isnan(values) & ~inside
    if beyond.any():
        return slice(0, max(_last(beyond), min(declared, len(values))))
    return slice(0, min(declared, len(values))) if len(values) <= written else np.flatnonzero(inside)


def _last(readings: np.ndarray) -> int:
    return len(readings) - int(np.argmax(readings[::-1])) if readings.any() else 0


def _times(
    rows: _Rows, x: np.ndarray | None, header: ChannelHeader, reference: ChannelHeader, written: int | None
) -> tuple[np.ndarray, str]:
    """Return X of a channel's samples, and a warning on it, which may be empty."""
    if x is None:
        if math.isnan(header.delta):
            return _index(rows).astype(float), "no X and no Delta_X: its time counts samples, not seconds"
        return _counted(rows, header), ""
    delay = header.x0 - reference.x0
    delay = 0.0 if math.isnan(delay) else delay
    rates = (header.delta, reference.delta)
    if not any(map(math.isnan, rates)) and not math.isclose(*rates, rel_tol=1e-6):
        if written and len(x) > written:
            index = _index(rows)
            return x[index - index % written] + delay + (index % written) * header.delta, ""
        return _counted(rows, header), ""
    times = x[rows] + delay if delay else x[rows]
    blank = np.isnan(times)
    if not blank.any():
        return times, ""
    if math.isnan(header.delta):
        return times, f"X is blank in {int(blank.sum())} rows, and there is no Delta_X"
    return np.where(blank, _counted(rows, header), times), f"X is blank in {int(blank.sum())} rows: taken from Delta_X"


def _index(rows: _Rows) -> np.ndarray:
    return np.arange(rows.stop) if isinstance(rows, slice) else rows


def _counted(rows: _Rows, header: ChannelHeader) -> np.ndarray:
    return (0.0 if math.isnan(header.x0) else header.x0) + _index(rows) * header.delta


def _backwards(columns: Sequence[np.ndarray], roles: Roles) -> list[str]:
    """Return warnings on where X decreases: another table follows in the same rows, or the clock was set."""
    warnings = []
    for x in sorted({x for x in roles.x if x is not None}):
        back = np.flatnonzero(np.diff(columns[x]) < 0)
        if len(back):
            times = "once" if len(back) == 1 else f"{len(back)} times"
            warnings.append(f"X goes back {times}, first in row {back[0] + 2}")
    return warnings


def grouped_warnings(warnings: Sequence[tuple[str, str]]) -> list[str]:
    """Return each warning once, with the channels that share it, from pairs of a name and a text, perhaps empty."""
    by_text: dict[str, list[str]] = {}
    for name, text in warnings:
        if text:
            by_text.setdefault(text, []).append(name)
    return [f"{listed(names, 3, quoted)}: {text}" for text, names in by_text.items()]


def named_twice(channels: Sequence[Channel]) -> list[str]:
    """Return a warning on names that several channels have."""
    twice = sorted(name for name, count in Counter(one.name for one in channels).items() if count > 1)
    return [f"several channels have the name {', '.join(map(quoted, twice[:3]))}"] if twice else []
