"""Channels with a time for every sample, from columns of numbers and a header."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from bayes_tyre.formats.lvm.channel_header import ChannelHeader
from bayes_tyre.formats.lvm.roles import Roles
from bayes_tyre.formats.lvm.times import SampleRows, even_x, times_of
from bayes_tyre.plain_text import listed, quoted
from bayes_tyre.record import Channel


def build_channels(
    names: Sequence[str],
    roles: Roles,
    columns: Sequence[np.ndarray],
    headers: Sequence[ChannelHeader],
    valid_for: str = "",
    x_digits: Mapping[int, float] | None = None,
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
    x_digits:
        Value of the last printed digit of each X column (s), where it is known.
    """
    written = max((one.samples for one in headers if one.samples is not None), default=None)
    labels = [names[i] for i in roles.channels]
    x_columns = len(set(roles.x)) > 1
    shared = headers[labels.index(valid_for)] if valid_for in labels else None
    owners = {x: headers[roles.x.index(x)] if x_columns or shared is None else shared for x in roles.x}
    even = {x: even_x(columns[x], owners[x], (x_digits or {}).get(x, np.nan)) for x in owners if x is not None}
    channels, warnings = [], []
    for name, i, x, one in zip(labels, roles.channels, roles.x, headers, strict=True):
        times, other_dt_s = even[x] if x is not None else (None, None)
        rows = _rows_of(columns[i], times if x_columns else None, one.samples, written)
        time_s, warning = times_of(rows, times, one, one if x_columns else owners[x], written)
        channel = Channel(name, one.unit, time_s, columns[i][rows], one.samples, other_dt_s)
        warnings.append((name, warning))
        if other_dt_s is not None and len(time_s) > 1:
            warnings.append((name, f"X has steps of {channel.dt_s:.6g} s, but Delta_X is {other_dt_s:.6g} s"))
        channels.append(channel)
    return tuple(channels), grouped_warnings(warnings)


def _rows_of(values: np.ndarray, own_x: np.ndarray | None, declared: int | None, written: int | None) -> SampleRows:
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
