"""The factors of a record: from its file's name by the source's pattern, or from a table of cases."""

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import number_in
from bayes_tyre.record import DIRECTIONS, Case

_NUMBER = r"(\d+(?:[.,]\d+)?)"
_PATTERN = re.compile(rf"(?:dynamic)?\s*([sd])\s*\({_NUMBER}\)\s*{_NUMBER}\s*-\s*{_NUMBER}\s*\((\d+)\)", re.IGNORECASE)
_CONFIGURATIONS = {"s": "single", "d": "dual"}
_PREFIX = re.compile(r"^dynamic\s*", re.IGNORECASE)
#: Required columns of a table of cases; the direction follows from the step.
CASES_NEED = ("file", "configuration", "speed_km_h", "initial_load_kN", "step_kN", "repeat")


class RecordFactors(NamedTuple):
    """The name of a record, what was tested, and which time."""

    record: str
    case: Case
    repeat: int

    def row(self) -> dict[str, object]:
        """Return the factors as columns of a record table."""
        return {"record": self.record, **self.case._asdict(), "repeat": self.repeat}


def record_name(file_name: str) -> str:
    """Return a record's name: the file's without folder, suffix and the word Dynamic.

    Examples
    --------
    >>> record_name("DynamicS(0)30-20(1).lvm")
    'S(0)30-20(1)'
    """
    stem = re.sub(r"\.[A-Za-z][A-Za-z0-9]*$", "", file_name)
    return _PREFIX.sub("", stem).strip() or file_name


def factors_from_name(file_name: str) -> RecordFactors:
    """Return the factors in a name such as ``DynamicS(0)30-20(1).lvm``: single, 0 km/h, 30 to 20 kN, repeat 1.

    D stands for dual; speed and loads may have decimals.

    Raises
    ------
    BadInput
        If the name is not of this pattern, or both loads are the same.
    """
    name = record_name(file_name)
    match = _PATTERN.fullmatch(name)
    if match is None:
        raise BadInput(
            "its name does not say what was tested; name it as DynamicS(0)30-20(1).lvm, or give --cases with a row "
            "for the file"
        )
    letter, repeat = match.group(1).lower(), int(match.group(5))
    speed, before, after = (float(text.replace(",", ".")) for text in match.group(2, 3, 4))
    return RecordFactors(name, _case(_CONFIGURATIONS[letter], speed, before, after - before), repeat)


def factors_from_row(row: Mapping[str, object], file_name: str) -> RecordFactors:
    """Return the factors of a file from its row of a table of cases.

    Parameters
    ----------
    row:
        `configuration`, `speed_km_h`, `initial_load_kN`, `step_kN` (signed), `repeat`; `direction` and `record` if
        given.
    file_name:
        Of the raw file; the record is named after it where the row gives no name.

    Raises
    ------
    BadInput
        If a factor is missing, is not a number where one is needed, or contradicts another.
    """
    configuration = _text(row, "configuration")
    if not configuration:
        raise BadInput("--cases, column configuration: is empty; fill the cell")
    speed, before, step, repeat = (
        _number(row, name) for name in ("speed_km_h", "initial_load_kN", "step_kN", "repeat")
    )
    if repeat != round(repeat):
        raise BadInput(f"--cases, column repeat: {repeat:g} is not a whole number; mend the cell")
    case = _case(configuration, speed, before, round(step, 9))
    direction = _text(row, "direction")
    if direction and direction != case.direction:
        raise BadInput(
            f"--cases, column direction: {direction!r} where step_kN {step:+g} is {case.direction}; use one of "
            f"{', '.join(DIRECTIONS)}, step_kN positive when loading"
        )
    return RecordFactors(_text(row, "record") or record_name(file_name), case, int(repeat))


def _case(configuration: str, speed: float, before: float, step: float) -> Case:
    if speed < 0:
        raise BadInput(f"its factors say a speed of {speed:g} km/h; give 0 or more in name or --cases")
    if step == 0:
        raise BadInput(f"its factors say a step from {before:g} to {before:g} kN, which is none; mend name or --cases")
    return Case(configuration, "loading" if step > 0 else "unloading", speed, before, round(step, 9))


def _text(row: Mapping[str, object], name: str) -> str:
    value = row.get(name)
    return "" if value is None or value != value else str(value).strip()


def _number(row: Mapping[str, object], name: str) -> float:
    text = _text(row, name)
    value = number_in(text)
    if value is None or not math.isfinite(value):
        raise BadInput(f"--cases, column {name}: {text[:40]!r} is no number; mend the cell")
    return value
