"""Reader of LabVIEW measurement text files (`.lvm`), and of text files of numbers without a header.

The reader on PyPI, `lvm_read`, is not used: it unpickles a cache file that lies beside the data, and writes one there.

Strict about structure: a cell that is no number, a row with too many cells and a header without rows are errors that
name the line. Tolerant of dialects: separators, decimal signs, X columns, repeated headers, rows without a header.
Source of the format: NI, "Specification for the LabVIEW Measurement File (.lvm)", and files that deviate from it.
"""

from pathlib import Path

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.channel_header import channel_headers, last_digit
from bayes_tyre.formats.lvm.channels import build_channels, grouped_warnings, named_twice
from bayes_tyre.formats.lvm.commas import check_declared, check_rows
from bayes_tyre.formats.lvm.header import (
    Section,
    cut_header,
    find_sections,
    header_ends,
    is_blank,
    without_special_blocks,
)
from bayes_tyre.formats.lvm.plain import find_plain_table
from bayes_tyre.formats.lvm.roles import COMMENT, Roles, find_roles, is_x, last_channel, with_x_labels
from bayes_tyre.formats.lvm.source import Source, as_text
from bayes_tyre.formats.lvm.table import Numbers, Rows, read_numbers
from bayes_tyre.formats.lvm.tail import end_of_whole_rows
from bayes_tyre.formats.x_column import grows, is_time, seconds_per_unit, unit_in
from bayes_tyre.plain_text import quoted
from bayes_tyre.record import Channel, RawSignals

_UTF8_MARK = b"\xef\xbb\xbf"
#: A file with more is of another kind, or has to be cut in pieces.
_MOST_SEGMENTS = 10_000
_SIGNS = ".,"
_FIRST_ROWS = 50
_HEAD = 1 << 16


def read_lvm(path: Path) -> RawSignals:
    """Return what a LabVIEW measurement file holds, or a text file of numbers without a header.

    X comes from the X column (s), at the steps of Delta_X where that has more digits; in files without one, or with
    other rates than its own, from X0 and Delta_X. Channels of a table without names are `column 2` and so on.
    `warnings` says what differs from the header, and whether a half-written last row was left out.

    Raises
    ------
    BadInput
        If the file is no text, has no rows, a row with too many cells, or a cell that is no number.
    """
    source = without_special_blocks(_load(path))
    ends = header_ends(source.data)
    if not ends:
        section = find_plain_table(source)
        channels, warnings = _read(source, section, is_last=True)
        if not channels:
            raise BadInput(f"{path}: holds no whole row of numbers; the recording may have been cut short")
        return RawSignals((channels,), tuple(warnings))
    if len(ends) > 2 * _MOST_SEGMENTS:
        raise BadInput(f"{path}: has {len(ends)} headers, more than {2 * _MOST_SEGMENTS}; cut it in pieces")
    sections = find_sections(source, ends)
    segments, warnings = [], []
    for i, section in enumerate(sections, start=1):
        channels, own_warnings = _read(source, section, is_last=i == len(sections))
        warnings += [f"segment {i}: {text}" if len(sections) > 1 else text for text in own_warnings]
        segments += [channels] if channels else []
    if not segments:
        raise BadInput(f"{path}: a header and no rows below it; the recording may have been cut short")
    notes = [note for section in sections for note in section.header.get("Notes", []) if note]
    return RawSignals(tuple(segments), tuple(warnings), tuple(dict.fromkeys(notes)))


def _load(path: Path) -> Source:
    data = path.read_bytes()
    if data.find(b"\0", 0, _HEAD) >= 0:
        raise BadInput(f"{path}: holds zero bytes: no text, or UTF-16; save it as tab-separated text in UTF-8")
    if data.startswith(_UTF8_MARK):
        data = data[len(_UTF8_MARK) :]
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    return Source(path, data)


def _read(source: Source, section: Section, is_last: bool) -> tuple[tuple[Channel, ...], list[str]]:
    """Return the channels of one table, none if it has no rows, and warnings on it."""
    warnings: list[str] = []
    stop, names = section.stop, section.names
    if is_last:
        stop, unfinished = cut_header(source, section.start, stop)
        warnings += ["the file ends in an unfinished header: left out"] if unfinished else []
    if names is None and section.start < stop:
        names = _numbered(source, section.start, stop, section.separator)
    else:
        names = with_x_labels(names or [], section, [line for _, line in _first_rows(source, section.start, stop)])
    text_from = next((i for i in range(len(names) - 1, 0, -1) if names[i].lower() == COMMENT), None)
    if not warnings:
        stop, half = end_of_whole_rows(source, section.start, stop, section.separator, text_from)
        warnings += ["the last row is half written: left out"] if half else []
    last = len(names) if text_from is None else text_from
    if not last or is_blank(source.data, section.start, stop):
        return (), ["a header and no rows below it: left out"]
    check_declared(source, section.separator, _declared_sign(section))
    check_rows(source, _first_rows(source, section.start, stop), section.separator, text_from)
    signs = _signs(source, section, stop)
    numbers = read_numbers(
        Rows(source, section.start, stop, section.separator, len(names), [*range(last)], names, text_from, signs)
    )
    numbers = _without_blank_end(numbers)
    declared = _declared_sign(section)
    if declared in set(_SIGNS) and declared != numbers.decimal:
        warnings.append(f"the header says decimals have a {declared!r}, the rows have a {numbers.decimal!r}")
    last = last_channel([] if section.names is None else names[:last], numbers.columns)
    channels, more = _channels(source, section._replace(stop=stop), names[:last], numbers.columns[:last])
    return channels, warnings + more


def _numbered(source: Source, start: int, stop: int, separator: str) -> list[str]:
    """Return names for the columns of rows that have none above."""
    lines = [line for _, line in _first_rows(source, start, stop)]
    counts = [len(line.split()) if separator == " " else line.count(separator.encode()) + 1 for line in lines]
    most = max(counts, default=0)
    return [f"column {i}" for i in range(1, most + 1)]


def _first_rows(source: Source, start: int, stop: int) -> list[tuple[int, bytes]]:
    """Return the first lines between two bytes, each with the byte at which it begins."""
    lines, at = [], start
    while at < stop and len(lines) < _FIRST_ROWS:
        begin, (line, at) = at, source.line(at)
        lines.append((begin, line))
    return lines


def _last_cells(source: Source, section: Section, column: int) -> list[str]:
    """Return a column's cells in the last whole rows of a table."""
    whole_row = source.data.find(b"\n", max(0, section.stop - _HEAD)) + 1
    start = max(section.start, whole_row)
    lines = source.data[start : section.stop].split(b"\n")[-_FIRST_ROWS:]
    rows = [as_text(line).split(section.separator) for line in lines]
    return [row[column].strip() for row in rows if column < len(row)]


def _declared_sign(section: Section) -> str:
    return (section.header.get("Decimal_Separator") or [""])[0]


def _signs(source: Source, section: Section, stop: int) -> str:
    """Return the decimal signs to try: what the header says first, else what the first rows have."""
    if section.separator == ",":
        return "."
    sign = _declared_sign(section)
    if sign not in set(_SIGNS):
        start = source.data[section.start : min(stop, section.start + 1000)]
        sign = "," if b"," in start and b"." not in start else "."
    return sign + _SIGNS.replace(sign, "")


def _without_blank_end(numbers: Numbers) -> Numbers:
    """Return columns without the rows at their end that are blank in all of them."""
    rows = len(numbers.columns[0])
    if not rows or not all(np.isnan(column[-1]) for column in numbers.columns):
        return numbers
    blank = np.logical_and.reduce([np.isnan(column) for column in numbers.columns])
    keep = rows - int(np.argmin(blank[::-1])) if not blank.all() else 0
    return numbers._replace(columns=[column[:keep] for column in numbers.columns])


def _channels(
    source: Source, section: Section, names: list[str], columns: list[np.ndarray]
) -> tuple[tuple[Channel, ...], list[str]]:
    header, warnings = section.header, []
    if header:
        roles = find_roles(names, len(names), (header.get("X_Columns") or [""])[0])
    else:
        roles = _plain_roles(names, columns)
        if roles.x[:1] == (0,) and (factor := seconds_per_unit(names[0], "".join(section.units[:1]))) != 1:
            columns = [columns[0] * factor, *columns[1:]]
            warnings.append(f"X {quoted(names[0])} turned into seconds")
    if None in roles.x and is_x(names[0]) and not np.isnan(columns[0]).all():
        if np.isnan(columns[-1]).all() and len(columns) > 1:
            raise source.fault(section.start, "rows lack the blank X cell that the header promises; mend the file")
        warnings.append("the header says there is no X, yet its column holds numbers: time is from X0 and Delta_X")
    headers = channel_headers(header, roles)
    if not header:
        units = [*section.units, *[""] * len(names)]
        headers = [
            one._replace(unit=units[i] or unit_in(names[i])) for one, i in zip(headers, roles.channels, strict=True)
        ]
    x_digits = {x: last_digit(_last_cells(source, section, x)) for x in set(roles.x) if x is not None and header}
    channels, more = build_channels(names, roles, columns, headers, section.valid_for, x_digits)
    return channels, [*warnings, *more, *_against_header(header, channels)]


def _plain_roles(names: list[str], columns: list[np.ndarray]) -> Roles:
    """Return what the columns of a table without a header are: the first is X if it is named so, or grows."""
    if len(columns) > 1 and (is_time(names[0]) or grows(columns[0])):
        return find_roles(names, len(names), "One")
    none = find_roles(names, len(names), "No")
    if len(columns) > 1 and none.shift and np.isnan(columns[0]).all():
        return Roles(none.channels[1:], none.x[1:])
    return none


def _against_header(header: dict[str, list[str]], channels: tuple[Channel, ...]) -> list[str]:
    """Return warnings on where the table differs from its header."""
    promised = (header.get("Channels") or [""])[0]
    warnings = []
    if promised.isdigit() and promised != str(len(channels)):
        warnings.append(f"the header promises {promised} channels, the table has {len(channels)}")
    differ = [(one, one.declared_samples) for one in channels if one.declared_samples not in (None, len(one.values))]
    warnings += grouped_warnings(
        [(one.name, f"{len(one.values)} samples, the header promises {count}") for one, count in differ]
    )
    other = sorted({cell for cell in header.get("X_Dimension", []) if cell.lower() not in ("", "time")})
    warnings += [f"X is {', '.join(map(quoted, other[:3]))}, not time"] if other else []
    infinite = [(one.name, int(np.isinf(one.values).sum())) for one in channels]
    warnings += grouped_warnings([(name, f"infinite readings: {count}" if count else "") for name, count in infinite])
    return warnings + named_twice(channels)
