"""TYDEX files read with tolerance: fields of any width, tabs, missing offsets, any letter case."""

import re
from pathlib import Path

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tydex.write import AS_MEASURED, DESCRIPTION, NAME, NUMBER, Constant, MeasuredChannel, Tydex
from bayes_tyre.plain_text import quoted

type _Lines = list[tuple[str, str]]
_UNIT, _VALUES = NAME + DESCRIPTION, NAME + DESCRIPTION + NUMBER


def read_tydex(path: Path) -> Tydex:
    """Return what a file holds; measured values are converted: (value + its offset) x factor + physical offset.

    Names come back in upper case. A missing factor is 1, a missing offset 0, a decimal comma is a point. Lines that
    begin with ``!`` are remarks. The end of the file is as good as **END.

    Raises
    ------
    BadInput
        With the line, for a file without header, channels or data, for lines that cannot be read, and for another
        number of rows than the file announces.
    """
    sections = _sections(path)
    heads = [(where, *_fields(where, text, len(AS_MEASURED))) for where, text in sections.get("MEASURCHANNELS", [])]
    if "HEADER" not in sections or not heads:
        raise BadInput(f"{path}: has no **HEADER, or no channel below **MEASURCHANNELS; give a whole TYDEX file")
    rows = sections.get("MEASURDATA", [])
    data = np.array([_row(where, text, [name for _, name, *_ in heads]) for where, text in rows])
    if not rows:
        raise BadInput(f"{path}: has no row below **MEASURDATA; give a file of measured data")
    channels = []
    for (where, name, description, unit, given), values in zip(heads, data.T, strict=True):
        numbers = [_float(where, cell, name) for cell in given]
        factor, offset, physical_offset = (*numbers, *AS_MEASURED[len(numbers) :])
        channels.append(MeasuredChannel(name, description, unit, (values + offset) * factor + physical_offset))
    constants = [_fields(where, text, 1) for where, text in sections.get("CONSTANTS", [])]
    return Tydex(
        dict(_entry(text) for _, text in sections["HEADER"]),
        channels,
        [Constant(name, description, unit, "".join(value)) for name, description, unit, value in constants],
        [text.strip() for _, text in sections.get("COMMENTS", [])],
    )


def _sections(path: Path) -> dict[str, _Lines]:
    """Return the lines of each section, each with the place that a message names."""
    sections: dict[str, _Lines] = {"": []}
    keyword, announced = "", ""
    for number, line in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), start=1):
        if line.startswith("**"):
            keyword, *count = line[2:].upper().split() or [""]
            sections.setdefault(keyword, [])
            announced = count[0] if count and keyword == "MEASURDATA" else announced
        elif line.strip() and not line.startswith("!"):
            sections[keyword].append((f"{path}: line {number}", line))
    rows = len(sections.get("MEASURDATA", []))
    if announced.isdigit() and int(announced) != rows:
        raise BadInput(f"{path}: announces {announced} rows and holds {rows}; copy the file again")
    return sections


def _entry(text: str) -> tuple[str, str]:
    """Return name and value of a line of the header: at their places, or the first and the last of wide fields."""
    name, *fields = re.split(r"\t+|\s{2,}", text.strip())
    in_place = "\t" not in text and text[:NAME].split() == [name] and text[_UNIT:].strip()
    return name.upper(), text[_UNIT:].strip() if in_place else "".join(fields[-1:])


def _fields(where: str, text: str, most: int) -> tuple[str, str, str, list[str]]:
    """Return name, description, unit and at most `most` values of a line, those at their places where they fit."""
    name, description, unit = text[:NAME].strip(), text[NAME:_UNIT].strip(), text[_UNIT:_VALUES].strip()
    values, places = text[_VALUES:].split(), [text[_VALUES + NUMBER * i :][:NUMBER].strip() for i in range(most)]
    if most == 1 and "\t" not in text and name and unit and values and not {" "} & {*name, *unit}:
        values = [text[_VALUES:].strip()]  # a text may hold spaces
    fit = most == 1 or (places == [*values, *[""] * (most - len(values))] and all(map(_is_number, values)))
    if "\t" not in text and fit and len(values) <= most and (unit or values) and not {" "} & {*name, *unit}:
        return name.upper(), description, unit, values
    words = [word.strip() for word in text.split("\t") if word.strip()] if "\t" in text else text.split()
    end = len(words) - (most == 1)
    while most > 1 and 0 < end > len(words) - most and _is_number(words[end - 1]):
        end -= 1
    if end < 2:
        raise BadInput(f"{where}: {quoted(text.strip())} lacks a name, a unit or a value; mend the line")
    return words[0].upper(), " ".join(words[1 : end - 1]), words[end - 1], words[end:]


def _row(where: str, text: str, names: list[str]) -> list[float]:
    cells = text.split()
    places = [text[i : i + NUMBER].strip() for i in range(0, len(text.rstrip()), NUMBER)]
    if len(cells) < len(names) == len(places):  # numbers that fill their fields touch each other
        cells = places
    if len(cells) != len(names):
        raise BadInput(f"{where}: has {len(cells)} values for {len(names)} channels; mend the line")
    return [_float(where, cell, name) for cell, name in zip(cells, names, strict=True)]


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?", text, re.IGNORECASE) is not None


def _float(where: str, text: str, name: str) -> float:
    if not _is_number(text):
        raise BadInput(f"{where}, {name}: {quoted(text)} is no number; mend the cell")
    return float(text.replace(",", "."))
