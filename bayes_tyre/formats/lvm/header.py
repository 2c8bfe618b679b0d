"""Layout of an `.lvm` file: its header blocks, the names of its columns, the bytes of its tables.

A file is a file header, then segments, each a header, a line of names and rows; headers end with a marked line. The
printed sample and some recorders leave out the asterisks, the first line, or one of the headers.
"""

import re
from typing import NamedTuple

from bayes_tyre.formats.lvm.source import MOST_COLUMNS, Source, as_text
from bayes_tyre.plain_text import quoted

_END, _SPECIAL, _SPECIAL_END = b"End_of_Header", b"***Start_Special***", b"***End_Special***"
_FIRST = "LabVIEW Measurement"
SEPARATORS = "\t,;"
#: Tags that a file header has and a segment's has not, and the other way round.
_FILE_TAGS = {"Reader_Version", "Writer_Version", "Multi_Headings", "X_Columns", "Time_Pref", "Separator"}
_SEGMENT_TAGS = {"Channels", "Samples", "X0", "Delta_X", "Y_Unit_Label", "X_Dimension", "Notes"}
_OTHER_TAGS = {
    *(_FIRST, "Decimal_Separator", "Operator", "Description", "Project", "Date", "Time", "X_Unit_Label", "Y_Dimension"),
    *("Test_Name", "Test_Numbers", "Test_Series", "UUT_Name", "UUT_M/N", "UUT_S/N"),
}
TAGS = _FILE_TAGS | _SEGMENT_TAGS | _OTHER_TAGS
#: A row of a table: its first cell that is not blank is a number.
_ROW = re.compile(
    rb"[\t,; ]*[+-]?(?:\d[\d.eE+-]*|\.\d[\d.eE+-]*|nan|inf(?:inity)?|1[.,]#\w+)\s*(?:[\t,;]|$)", re.IGNORECASE
)
_VALID_FOR = re.compile(r"X values guaranteed valid only for ([^\t\r\n]+)")
_LONGEST_TAG_LINE = 200
#: Lines; notes may be long.
_LONGEST_HEADER = 10_000
_NOT_BLANK = re.compile(rb"[^\t,; \r\n]")
#: Bytes that are searched for the whole mark.
_NEAR = 1 << 16


class Section(NamedTuple):
    """One table and its header.

    Attributes
    ----------
    header:
        Tag -> its cells, the first of which stands above the second column.
    names:
        Of the columns; None where no line of names stands above the rows.
    start, stop:
        Bytes of the rows.
    separator:
        Of names and rows.
    valid_for:
        The channel whose X values the notes guarantee; empty where they name none.
    units:
        Of the columns, where a row of units stands below the names; empty where none does.
    """

    header: dict[str, list[str]]
    names: list[str] | None
    start: int
    stop: int
    separator: str
    valid_for: str
    units: tuple[str, ...] = ()


def is_row(line: bytes) -> bool:
    """Return whether a line is a row of a table: its first cell that is not blank is a number."""
    return _ROW.match(line) is not None


def is_blank(data: bytes, start: int, stop: int) -> bool:
    """Return whether there is nothing but blanks and separators between two bytes."""
    return _NOT_BLANK.search(data, start, stop) is None


def without_special_blocks(source: Source) -> Source:
    """Return the source with special blocks emptied; the lines keep their numbers."""
    at, pieces, done = _find(source.data, _SPECIAL, 0), [], 0
    while at >= 0:
        end = source.data.find(_SPECIAL_END, at)
        stop = len(source.data) if end < 0 else max(source.line(end)[1] - 1, end + len(_SPECIAL_END))
        pieces += [source.data[done:at], b"\n" * source.data.count(b"\n", at, stop)]
        done = stop
        at = _find(source.data, _SPECIAL, stop)
    return source._replace(data=b"".join([*pieces, source.data[done:]])) if pieces else source


def header_ends(data: bytes) -> list[tuple[int, int]]:
    """Return the bytes at which the lines that end a header begin and end."""
    positions, at = [], _find(data, _END, 0)
    while at >= 0:
        before = data[max(0, at - 16) : at].rpartition(b"\n")
        stop = data.find(b"\n", at)
        stop = len(data) if stop < 0 else stop + 1
        if not before[2].strip(b'* \t"') and (before[1] or at <= 16):
            positions.append((at - len(before[2]), stop))
        at = _find(data, _END, stop)
    return positions


def _find(data: bytes, mark: bytes, start: int) -> int:
    """Return what `data.find` does, for a mark with an underscore: no row of numbers holds one.

    Searching for one byte is ten times as fast as searching for the mark.
    """
    near = data.find(mark, start, start + _NEAR)
    if near >= 0:
        return near
    underscore = data.find(b"_", start + _NEAR - len(mark))
    return -1 if underscore < 0 else data.find(mark, max(start, underscore - len(mark)))


def find_sections(source: Source, ends: list[tuple[int, int]]) -> list[Section]:
    """Return the tables of a file whose headers end at these bytes, in order; one without rows has start == stop.

    Raises
    ------
    BadInput
        If a line has more columns than anything that is recorded, or is neither a row nor of a header.
    """
    sections: list[Section] = []
    file_header: dict[str, list[str]] = {}
    begin = 0
    for i, (mark, below) in enumerate(ends):
        is_last = i + 1 == len(ends)
        stop = len(source.data) if is_last else _header_start(source, below, ends[i + 1][0])
        if sections and begin > sections[-1].start:
            _check_begins(source, begin, mark)
        block = as_text(source.data[begin:mark])
        begin = stop
        header = _tags(block)
        opens_table = not _FILE_TAGS & header.keys() or bool(_SEGMENT_TAGS & header.keys())
        if not is_last and not opens_table and is_blank(source.data, below, stop):
            file_header = header
            continue
        valid = _VALID_FOR.search(block)
        sections.append(_section(source, file_header | header, below, stop, valid.group(1).strip() if valid else ""))
    return sections


def _check_begins(source: Source, begin: int, mark: int) -> None:
    """Refuse a header below rows that begins with no tag of one: the line may be a row that is damaged."""
    first = _NOT_BLANK.search(source.data, begin, mark)
    if first is not None:
        start = source.data.rfind(b"\n", 0, first.start()) + 1
        line = as_text(source.line(start)[0][:_LONGEST_TAG_LINE])
        if re.split(r"[\t,;]", line)[0].strip().strip('"') not in TAGS:
            raise source.fault(start, f"{quoted(line)} is neither a row nor of a header; mend the line")


def _section(source: Source, header: dict[str, list[str]], below: int, stop: int, valid_for: str) -> Section:
    at, line = below, b""
    while at < stop and not line.strip(b"\t,; \r"):
        first, (line, at) = at, source.line(at)
    if not line.strip(b"\t,; \r"):
        return Section(header, None, stop, stop, "\t", valid_for)
    separator = _separator(source, first, line)
    if is_row(line):
        return Section(header, None, first, stop, separator, valid_for)
    names = [name.strip().strip('"') for name in as_text(line).split(separator)]
    while names and not names[-1]:
        names.pop()
    return Section(header, names, min(at, stop), stop, separator, valid_for)


def _separator(source: Source, at: int, line: bytes) -> str:
    separator = next((one for one in SEPARATORS if one.encode() in line), "\t")
    if line.count(separator.encode()) >= MOST_COLUMNS:
        raise source.fault(at, f"has over {MOST_COLUMNS} columns; give a file with a column a channel")
    return separator


def _header_start(source: Source, low: int, high: int) -> int:
    """Return where the header that ends at `high` begins: behind the last row above it."""
    at = high
    for _ in range(_LONGEST_HEADER):
        if at <= low:
            break
        start = source.data.rfind(b"\n", low, at - 1) + 1
        start = max(start, low)
        if is_row(source.data[start:at]):
            return at
        at = start
    return at


def cut_header(source: Source, low: int, high: int) -> tuple[int, bool]:
    """Return where the rows between two bytes end, and whether an unfinished header follows them."""
    start = _header_start(source, low, high)
    first = _NOT_BLANK.search(source.data, start, high)
    unfinished = first is not None and any(source.data.startswith(tag.encode(), first.start()) for tag in TAGS)
    return (start, True) if unfinished else (high, False)


def _tags(block: str) -> dict[str, list[str]]:
    """Return tag -> cells of the lines of a header; a line below the notes that is no tag is one more cell of them."""
    header: dict[str, list[str]] = {}
    above = ""
    for line in block.split("\n"):
        tag = re.split(r"[\t,;]", line[:_LONGEST_TAG_LINE], maxsplit=1)[0]
        name = tag.strip().strip('"\ufeff')
        if name in TAGS:
            separator = line[len(tag) : len(tag) + 1] or "\t"
            header[name] = [cell.strip().strip('"') for cell in line.split(separator, MOST_COLUMNS + 1)[1:]]
            if name == "Decimal_Separator" and separator == "," and len(header[name]) > 1 and not any(header[name]):
                header[name] = [","]  # the comma itself, split off as if it separated cells
            above = name
        elif above == "Notes" and (text := line.strip("\t,; \r")):
            header["Notes"].append(text)
    return header
