"""Files with a few bytes changed and some cut off: each is read or refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.record import RawSignals


def assert_read_or_refused(path: Path, read: Callable[[Path], RawSignals], times: int) -> None:
    """Assert that a recording, changed at random so many times, is read or refused in one short, printable line."""
    whole, rng, ends = path.read_bytes(), np.random.default_rng(4), set()
    for _ in range(times):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), size=rng.integers(1, 4)):
            data[at] = rng.integers(0, 256)
        path.write_bytes(data[: rng.integers(1, len(data))] if rng.random() < 0.2 else data)
        try:
            ends.add(bool(read(path).segments))
        except BadInput as error:
            ends.add(str(error))
    assert ends > {True}
    assert all(end is True or (end.isprintable() and len(end) < 400) for end in ends)
