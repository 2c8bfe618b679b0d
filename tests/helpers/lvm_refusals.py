"""What the `.lvm` reader makes of a content: the signals, or the words of its refusal."""

from pathlib import Path

import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.reader import read_lvm
from bayes_tyre.record import RawSignals


def read(path: Path, content: str | bytes) -> RawSignals:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_lvm(path)


def refusal(path: Path, content: str | bytes) -> str:
    with pytest.raises(BadInput) as caught:
        read(path, content)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert message.isprintable()
    assert "; " in message
    return message
