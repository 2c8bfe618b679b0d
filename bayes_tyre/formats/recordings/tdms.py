"""Raw signals from LabVIEW's binary files (`.tdms`), read by npTDMS: a group is a segment."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from nptdms import TdmsChannel, TdmsFile, TdmsGroup
from nptdms.log import log_manager

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.channels import grouped_warnings
from bayes_tyre.formats.x_column import is_time, seconds_per_unit
from bayes_tyre.plain_text import quoted, reason
from bayes_tyre.record import Channel, RawSignals

_INCREMENT, _OFFSET = "wf_increment", "wf_start_offset"
_NO_NUMBERS = "text or time stamps: left out"
_UNITS = ("unit_string", "NI_UnitDescription")


def read_tdms(path: Path) -> RawSignals:
    """Return what a TDMS file holds; groups without numbers are left out.

    Times come from the waveform properties (`wf_start_offset`, `wf_increment`); in a group without them from its
    channel named as X is, else they count samples, and `warnings` says so.

    Raises
    ------
    BadInput
        If the file is no TDMS file, promises more samples than it has bytes, or holds no numbers.
    """
    try:
        # By an open file: with a path npTDMS would believe an index beside it, and leave a damaged file open.
        with path.open("rb") as opened, _logged_warnings() as logged, TdmsFile.open(opened) as file:
            groups = file.groups()
            promised = sum(len(channel) for group in groups for channel in group.channels())
            if promised > path.stat().st_size:
                raise BadInput(f"{path}: promises {promised} samples, more than it has bytes; it may be damaged")
            read = [_segment(group) for group in groups]
    except (BadInput, MemoryError):
        raise
    except Exception as error:  # the library raises many kinds of error
        raise BadInput(
            f"{path}: cannot be read as TDMS: {reason(error)}; it may be damaged, or not finished"
        ) from error
    segments = tuple(channels for channels, _ in read if channels)
    if not segments:
        raise BadInput(f"{path}: holds no channel of numbers; give a recording")
    return RawSignals(segments, (*dict.fromkeys(logged), *(text for _, warnings in read for text in warnings)))


@contextmanager
def _logged_warnings() -> Iterator[list[str]]:
    """Yield the list of warnings that npTDMS logs within the block, instead of printing them."""
    logged: list[str] = []

    def take(record: logging.LogRecord) -> bool:
        logged.append(reason(record.getMessage()))
        return False

    log_manager.console_handler.addFilter(take)
    try:
        yield logged
    finally:
        log_manager.console_handler.removeFilter(take)


def _segment(group: TdmsGroup) -> tuple[tuple[Channel, ...], list[str]]:
    numbers: list[tuple[TdmsChannel, np.ndarray]] = []
    warnings: list[tuple[str, str]] = []
    for channel in group.channels():
        values = _values(channel)
        if values is None:
            warnings.append((channel.name, _NO_NUMBERS))
        else:
            numbers.append((channel, values))
    x = next((i for i, (channel, _) in enumerate(numbers) if is_time(channel.name)), None)
    times = None if x is None else _as_seconds(*numbers[x])
    channels = []
    for i, (channel, values) in enumerate(numbers):
        if i != x and np.issubdtype(values.dtype, np.datetime64):
            warnings.append((channel.name, _NO_NUMBERS))
        elif i != x:
            time_s, warning = _times(channel, len(values), times)
            warnings.append((channel.name, warning))
            channels.append(Channel(channel.name, _unit(channel), time_s, values.astype(float), None))
    return tuple(channels), [f"group {quoted(group.name)}: {text}" for text in grouped_warnings(warnings)]


def _values(channel: TdmsChannel) -> np.ndarray | None:
    """Return a channel's readings, or its time stamps; None if it holds text."""
    kind = np.dtype(channel.dtype)
    if len(channel) and not (np.issubdtype(kind, np.number) or np.issubdtype(kind, np.datetime64)):
        return None
    readings = np.asarray(channel[:]) if len(channel) else np.empty(0)
    return None if np.iscomplexobj(readings) else readings


def _unit(channel: TdmsChannel) -> str:
    return next((str(channel.properties[key]) for key in _UNITS if key in channel.properties), "")


def _as_seconds(channel: TdmsChannel, values: np.ndarray) -> np.ndarray:
    if np.issubdtype(values.dtype, np.datetime64):
        return (values - values[:1]) / np.timedelta64(1, "s")
    return values.astype(float) * seconds_per_unit(channel.name, _unit(channel))


def _times(channel: TdmsChannel, samples: int, x: np.ndarray | None) -> tuple[np.ndarray, str]:
    try:
        increment = float(channel.properties[_INCREMENT])
        offset = float(channel.properties.get(_OFFSET, 0.0))
    except (KeyError, TypeError, ValueError):
        increment = offset = np.nan
    if increment > 0 and np.isfinite(increment) and np.isfinite(offset):
        return offset + increment * np.arange(samples), ""
    if x is not None and len(x) == samples:
        return x, ""
    return np.arange(samples, dtype=float), "no wf_increment: its time counts samples, not seconds"
