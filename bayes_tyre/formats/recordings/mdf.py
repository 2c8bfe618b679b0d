"""Raw signals from ASAM MDF files (`.mf4`), read by asammdf: channel groups, each with the times of its master."""

import importlib.util
import io
import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.channels import grouped_warnings
from bayes_tyre.formats.recordings.channel_groups import segments_of
from bayes_tyre.plain_text import quoted, reason
from bayes_tyre.record import Channel, RawSignals

_PROGRAM = Path(__file__).with_name("mdf_program.py")
_LONGEST_S = 600
_NO_NUMBERS = "text, or several numbers a sample: left out"
#: What X is by the `sync_type` of a master channel; 1 is time.
_X = {
    None: "no master channel: its time counts samples, not seconds",
    2: "X is an angle, not time",
    3: "X is a distance, not time",
    4: "X counts samples, not seconds",
}


def read_mdf(path: Path) -> RawSignals:
    """Return what an MDF file holds, conversions applied; groups without samples are left out.

    Times (s) are those of a group's master channel. Samples that the file marks as invalid are missing. Groups are of
    one recording, and one segment, unless they repeat the names of channels.

    Raises
    ------
    BadInput
        If asammdf is not installed, or the file is no MDF file, damaged, or holds no numbers.
    """
    if importlib.util.find_spec("asammdf") is None:
        raise BadInput(f"{path}: MDF files need asammdf: pip install 'bayes-tyre[mdf]'; or save it as .csv or .tdms")
    command = [sys.executable, "-P", "-W", "ignore", str(_PROGRAM), str(path.absolute())]
    try:
        content = subprocess.run(command, capture_output=True, timeout=_LONGEST_S, check=True).stdout
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            texts, numbers = json.loads(arrays["texts"].tobytes()), {name: arrays[name] for name in arrays.files}
    except (subprocess.SubprocessError, ValueError, EOFError) as error:
        ended = "asammdf did not end" if isinstance(error, subprocess.TimeoutExpired) else "asammdf failed on it"
        raise BadInput(f"{path}: cannot be read as MDF: {ended}; it may be damaged") from None
    if "error" in texts:
        raise BadInput(f"{path}: cannot be read as MDF: {reason(texts['error'])}; it may be damaged, or not finished")
    read = [_group(i, group, numbers) for i, group in enumerate(texts["groups"])]
    segments = segments_of(channels for channels, _ in read)
    if not segments:
        raise BadInput(f"{path}: holds no channel of numbers; give a recording")
    logged = dict.fromkeys(map(reason, texts["logged"]))
    return RawSignals(segments, (*logged, *(text for _, texts_of_group in read for text in texts_of_group)))


def _group(i: int, group: Mapping[str, Any], numbers: Mapping[str, np.ndarray]) -> tuple[list[Channel], list[str]]:
    """Return the channels of a channel group, none if it has no samples, and warnings on them."""
    channels = [
        Channel(name, unit, numbers[f"time_{i}"], numbers[f"values_{i}_{k}"]) for k, name, unit in group["channels"]
    ]
    left_out = [(one.name, _X.get(group["master"], "")) for one in channels]
    left_out += [(name, _NO_NUMBERS) for name in group["left_out"]]
    return channels, [f"group {quoted(group['name'] or str(i + 1))}: {text}" for text in grouped_warnings(left_out)]
