"""Mutations of small files of every dialect: the reader must give raw signals or its one error, and nothing else.

As a program (`make fuzz`) it tries many more than the tests do: ``python tests/formats/fuzz_lvm.py 100000``.
"""

import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from helpers.fuzz_settings import examples
from helpers.lvm_dialects import BAD, FILES
from hypothesis import given, seed
from hypothesis import strategies as st

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.reader import read_lvm
from bayes_tyre.record import RawSignals

SEEDS = [*FILES.values(), *(text.encode() for text in BAD.values()), data_path("sample/appendix_b1.lvm").read_bytes()]
TOKENS = [
    *(b"NaN", b"-", b"1e999", b"\xff\xfe", b"\x00", b"\t\t\t\t", b",", b";", b" ", b"\r", b"\n", b"\n\n", b'"', b"#"),
    *(b"***End_of_Header***\n", b"\nEnd_of_Header\t\n", b"***Start_Special***\n", b"***End_Special***\n"),
    *(b"LabVIEW Measurement\n", b"X_Columns\tMulti\n", b"X_Columns\tNo\n", b"Decimal_Separator\t,\n", b"Channels\t9\n"),
    *(b"Samples\t0\t1\n", b"Samples\t99999999999999999999\n", b"Delta_X\t-1\t1e-320\n", b"X_Value\tX_Value\tComment\n"),
    *(b"9" * 70, b"0.000000\t", b"X0\t1e308\tnan\n", "\N{ARABIC-INDIC DIGIT ONE}\N{LINE SEPARATOR}\x85".encode()),
    *(b"Notes\tX values guaranteed valid only for load\n", b"Separator\n"),
]
EXCHANGES = [
    (b"\t", b","),
    (b",", b"\t"),
    (b"\t", b" "),
    (b".", b","),
    (b"\n", b"\r\n"),
    (b"\n", b"\r"),
    (b"\t", b"\t\t"),
]


@st.composite
def mutated(draw: st.DrawFn, seeds: Sequence[bytes] = SEEDS, tokens: Sequence[bytes] = TOKENS) -> bytes:
    """Draw one of the files, changed in one to four ways."""
    data = draw(st.sampled_from(seeds))
    for _ in range(draw(st.integers(1, 4))):
        data = _changed(data, draw, seeds, tokens)
    return data


def _changed(data: bytes, draw: st.DrawFn, seeds: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    way = draw(st.integers(0, 8))
    at, to = sorted((draw(st.integers(0, len(data))), draw(st.integers(0, len(data)))))
    if way == 0:
        return data[:at] + bytes([draw(st.integers(0, 255))]) + data[at + 1 :]
    if way == 1:
        return data[:at] + data[to:]
    if way == 2:
        return data[:at]
    if way == 3:
        return data[:at] + draw(st.sampled_from(tokens)) + data[at:]
    if way == 4:
        before, after = draw(st.sampled_from(EXCHANGES))
        return data.replace(before, after)
    if way == 5:
        other = draw(st.sampled_from(seeds))
        return data[:at] + other[draw(st.integers(0, len(other))) :]
    lines = data.split(b"\n")
    i, j = draw(st.integers(0, len(lines) - 1)), draw(st.integers(0, len(lines) - 1))
    if way == 6:
        lines.insert(j, lines[i])
    elif way == 7:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        del lines[i]
    return b"\n".join(lines)


def outcome(data: bytes, path: Path) -> str:
    """Read the bytes as a file, and assert that they are raw signals or refused in one line; return which."""
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            raw, message = read_lvm(path), ""
        except BadInput as error:
            raw, message = None, str(error)
    if raw is None:
        assert message.startswith(f"{path}: ")
        assert message.removeprefix(str(path)).isprintable(), message
        assert "; " in message, message
        return "refused"
    assert isinstance(raw, RawSignals)
    assert raw.segments
    for channel in (channel for segment in raw.segments for channel in segment):
        assert channel.values.dtype == channel.time_s.dtype == np.float64
        assert channel.values.shape == channel.time_s.shape == (len(channel.values),)
    assert all(warning.isprintable() and warning for warning in raw.warnings), raw.warnings
    return "read"


def fuzz(count: int, path: Path, start: int = 0) -> Counter[str]:
    """Try so many mutated files; return how many were read and how many refused."""
    counts: Counter[str] = Counter()

    @seed(start)
    @examples(count)
    @given(mutated())
    def check(data: bytes) -> None:
        counts[outcome(data, path)] += 1

    check()
    return counts


def main() -> None:
    """Fuzz as often as the command line says, and print what came out."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        counts = fuzz(count, Path(folder) / "mutated.lvm")
    seconds = time.monotonic() - began
    print(f"{counts.total()} mutated files in {seconds:.0f} s: {counts['read']} read, {counts['refused']} refused")


if __name__ == "__main__":
    main()
