"""Entries of an `.lvm` header for each channel, and to how many digits its numbers are printed."""

import math
import re
from collections.abc import Iterable
from typing import NamedTuple

from bayes_tyre.formats.lvm.roles import Roles
from bayes_tyre.plain_text import number_in

_LONGEST_NUMBER = 60
_DIGITS = re.compile(r"[+-]?\d+(?:[.,](\d*))?(?:[eE]([+-]?\d{1,2}))?", re.ASCII)


class ChannelHeader(NamedTuple):
    """A header's entries for one channel; NaN or None where there is no entry.

    Attributes
    ----------
    unit, samples, x0, delta:
        `Y_Unit_Label`, `Samples`, `X0` (s), `Delta_X` (s).
    delta_digit:
        Value of the last printed digit of `Delta_X` (s).
    """

    unit: str
    samples: int | None
    x0: float
    delta: float
    delta_digit: float = math.nan


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
        ChannelHeader(unit, _count(samples), _number(x0), _step(delta), last_digit([delta]))
        for unit, samples, x0, delta in zip(*map(cells, tags), strict=True)
    ]


def _count(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 16 else None


def _number(text: str) -> float:
    number = number_in(text.replace(",", ".")) if len(text) <= _LONGEST_NUMBER else None
    return math.nan if number is None or math.isinf(number) else number


def _step(text: str) -> float:
    step = _number(text)
    return step if step > 0 else math.nan


def last_digit(texts: Iterable[str]) -> float:
    """Return the value of the last digit of printed numbers, the largest of them; NaN where none is a number.

    Examples
    --------
    >>> last_digit(["0.000039"]), last_digit(["3.906250E-5", "x"])
    (1e-06, 1e-11)
    """
    matches = [match for text in texts if len(text) <= _LONGEST_NUMBER and (match := _DIGITS.fullmatch(text.strip()))]
    return max((10.0 ** (int(match[2] or 0) - len(match[1] or "")) for match in matches), default=math.nan)
