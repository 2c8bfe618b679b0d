"""Program that reads an MDF file with asammdf and writes its channels to standard output, as `mdf.py` takes them.

It runs in a process of its own: on a damaged file asammdf may print, or end the process in its C code.

Usage: python -P mdf_program.py FILE
"""

import contextlib
import io
import json
import logging
import sys
from typing import Any

import numpy as np
from asammdf import MDF

#: Bytes of a channel group, unpacked: a damaged file may promise any number of samples.
_MOST_BYTES = 1 << 32


def read(path: str) -> tuple[dict[str, object], dict[str, np.ndarray]]:
    """Return what is text, and arrays by name: `time_GROUP`, `values_GROUP_CHANNEL`, both counted from 0."""
    logged: list[str] = []
    logging.getLogger("asammdf").addFilter(lambda record: bool(logged.append(record.getMessage())))
    groups, arrays = [], {}
    try:
        with MDF(path) as file:
            for i, group in enumerate(file.groups):
                groups.append(_group(file, i, group, arrays))
    except Exception as error:  # the library raises many kinds of error
        return {"error": str(error) or type(error).__name__}, {}
    return {"groups": groups, "logged": logged}, arrays


def _group(file: MDF, i: int, group: Any, arrays: dict[str, np.ndarray]) -> dict[str, object]:
    """Return what is text of a channel group, and put its numbers among the arrays."""
    samples, record = group.channel_group.cycles_nr, group.channel_group.samples_byte_nr
    if samples * max(record, 1) > _MOST_BYTES:
        raise ValueError(f"group {i + 1} promises {samples} samples of {record} bytes")
    master = file.masters_db.get(i)
    wanted = [(None, i, k) for k in range(len(group.channels)) if k != master] if samples else []
    channels, left_out = [], []
    for k, signal in enumerate(file.select(wanted, ignore_value2text_conversions=True) if wanted else []):
        if signal.samples.dtype.kind not in "buif" or signal.samples.ndim != 1:
            left_out.append(signal.name)
            continue
        values = signal.samples.astype(float)
        if signal.invalidation_bits is not None:
            values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
        arrays |= {f"time_{i}": signal.timestamps.astype(float), f"values_{i}_{k}": values}
        channels.append([k, signal.name, signal.unit or ""])
    kind = None if master is None else int(group.channels[master].sync_type)
    return {"name": group.channel_group.acq_name or "", "master": kind, "channels": channels, "left_out": left_out}


if __name__ == "__main__":
    with contextlib.redirect_stdout(sys.stderr):
        texts, numbers = read(sys.argv[1])
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, texts=np.frombuffer(json.dumps(texts).encode(), dtype=np.uint8), **numbers)
    sys.stdout.buffer.write(content.getbuffer())
