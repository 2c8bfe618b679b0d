"""Which column of a table without a header of its own holds X, and in what unit of time."""

import re

import numpy as np

_TIME = re.compile(
    r"(?:x[ _]?values?|x|t|time|seconds?)(?:[ _]*[\[(]?(?P<unit>s|sec|seconds|ms|us|µs|μs|min|h)?[\])]?)", re.IGNORECASE
)
#: Of microseconds the micro sign, and the Greek letter.
_SECONDS = {"ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6, "\u03bcs": 1e-6, "min": 60.0, "h": 3600.0}
_UNIT = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
#: The share of steps that must go forward: a table may hold several writes, each of which begins again.
_FORWARD = 0.9


def is_time(name: str) -> bool:
    """Return whether a column of this name holds X."""
    return _TIME.fullmatch(name.strip()) is not None


def seconds_per_unit(name: str, unit: str = "") -> float:
    """Return how many seconds the unit of an X column has: that stated, else that in its name; 1 where there is none.

    Examples
    --------
    >>> seconds_per_unit("time_ms"), seconds_per_unit("Zeit [ms]"), seconds_per_unit("X_Value")
    (0.001, 0.001, 1.0)
    >>> seconds_per_unit("t", "ms")
    0.001
    """
    match = _TIME.fullmatch(name.strip())
    in_name = unit_in(name) or (match["unit"] or "" if match else "")
    return _SECONDS.get((unit.strip() or in_name).lower(), 1.0)


def unit_in(name: str) -> str:
    """Return the unit that stands in brackets at the end of a name; empty where none does."""
    match = _UNIT.search(name[-100:])
    return match[1].strip() if match else ""


def grows(values: np.ndarray) -> bool:
    """Return whether values are such as X has: there, and nearly always greater than the one before."""
    if not len(values) or np.isnan(values).any():
        return False
    return len(values) == 1 or float(np.mean(np.diff(values) > 0)) >= _FORWARD
