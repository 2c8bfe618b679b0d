"""What a TYDEX file holds, and its text: lines of fixed width."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.plain_text import ascii_line, comments

#: Characters of a name, a description, and a unit or a number.
NAME, DESCRIPTION, NUMBER = 10, 30, 10
#: Conversion factor, offset of the measured and of the physical value, where a channel needs none.
AS_MEASURED = (1.0, 0.0, 0.0)


class Constant(NamedTuple):
    """A quantity that does not change during the measurement; its value is text."""

    name: str
    description: str
    unit: str
    value: str


class MeasuredChannel(NamedTuple):
    """A measured quantity: its physical values, shape (rows,), in `unit`."""

    name: str
    description: str
    unit: str
    values: Float[np.ndarray, " rows"]


class Tydex(NamedTuple):
    """What a file holds: header entries by name, channels of equal length, constants and comments."""

    header: Mapping[str, str]
    channels: Sequence[MeasuredChannel]
    constants: Sequence[Constant] = ()
    comments: Sequence[str] = ()


def tydex_text(file: Tydex) -> str:
    """Return the text of a file: ASCII, conversion factors 1, offsets 0, numbers of 9 characters after a blank.

    Raises
    ------
    ValueError
        For a name or unit that its field cannot hold, and for a value that is not finite.
    """
    lines = ["**HEADER", *(_word(name, NAME) + " " * DESCRIPTION + ascii_line(of) for name, of in file.header.items())]
    lines += ["**COMMENTS", *comments(file.comments, " ")]  # after a blank no line is a keyword
    lines += ["**CONSTANTS", *(_head(one) + ascii_line(one.value) for one in file.constants)]
    unconverted = "".join(map(_number, AS_MEASURED))
    lines += ["**MEASURCHANNELS", *(_head(channel) + unconverted for channel in file.channels)]
    rows = np.stack([channel.values for channel in file.channels], axis=1).tolist()
    lines += [f"**MEASURDATA {len(rows)}", *("".join(map(_number, row)) for row in rows), "**END"]
    return "\n".join(lines) + "\n"


def _head(one: Constant | MeasuredChannel) -> str:
    description = ascii_line(one.description)[: DESCRIPTION - 1]
    return _word(one.name, NAME) + description.ljust(DESCRIPTION) + _word(one.unit, NUMBER)


def _word(text: str, width: int) -> str:
    if not text or len(text) > width or ascii_line(text) != text or " " in text:
        raise ValueError(f"{text!r} is no ASCII word of at most {width} characters")
    return text.ljust(width)


def _number(value: float) -> str:
    if not np.isfinite(value):
        raise ValueError(f"{value} is not finite")
    texts = (f"{value:.{digits}G}" for digits in range(NUMBER - 1, 0, -1))
    return next(text for text in texts if len(text) < NUMBER).rjust(NUMBER)
