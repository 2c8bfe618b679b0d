"""Decimal signs: with commas between cells a point; with semicolons or tabs a point or a comma, one for a whole file.

`pandas` takes one sign and no hint of a wrong one; here the sign is detected, and a mixture is an error.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import line_of
from bayes_tyre.record import NUMBER_COLUMNS, TEXT_COLUMNS

#: Columns of numbers by name, those of slow tests and natural frequencies too.
_NUMBERS = (*NUMBER_COLUMNS, "load_kN", "frequency_Hz")
_SIGN, _POWER = r"\s*[+-]?", r"(?:[eE][+-]?\d+)?\s*"
_POINT = rf"{_SIGN}(?:\d+\.\d*|\.\d+){_POWER}"
_COMMA = rf"{_SIGN}(?:\d+,\d*|,\d+){_POWER}"
_EITHER = rf"{_SIGN}(?:\d+[.,]?\d*|[.,]\d+){_POWER}"
# Groups of three digits, by any sign in use for it: points, commas, apostrophes, plain and unbroken spaces.
_BETWEEN = ".,' \u2019\u00a0\u202f"
_GROUPS = rf"{_SIGN}\d{{1,3}}(?:[{_BETWEEN}]\d{{3}})+(?:[.,]\d*)?{_POWER}"


#: Cells without a reading, in small letters.
NO_READING = ("", "nan")


class _Cell(NamedTuple):
    """Position of a cell, rows counted from 0, and its text."""

    row: int
    column: str
    text: str


def read_by_decimals(parse: Callable[[str], pd.DataFrame], path: Path, separator: str) -> pd.DataFrame:
    """Return a table, its numbers read by the decimal sign that the file uses.

    Parameters
    ----------
    parse:
        Reads the whole file by the decimal sign given; a column that holds anything else than such numbers
        comes back as text, cell by cell as written.
    path, separator:
        The file, for messages; what separates its cells.

    Raises
    ------
    BadInput
        For a comma in a number between commas, points and commas in the numbers of one file, thousands separators.
    """
    table = parse(".") if separator == "," else _by_either_sign(parse, path)
    wrong, unless = (f"(?:{_COMMA})|(?:{_GROUPS})", _POINT) if separator == "," else (_GROUPS, _EITHER)
    for cell in _first_cells(table, _NUMBERS, wrong, unless):
        if pd.Series(cell.text).str.fullmatch(_COMMA).all():
            what = "a comma in a number; write decimals with a point, or put semicolons between the cells"
        else:
            what = "a thousands separator; write the number without it"
        raise BadInput(f"{path}: {_where(table, cell)}: {what}")
    return table


def numbers_of_texts(table: pd.DataFrame, path: Path) -> pd.DataFrame:
    """Return a table from a sheet, its numbers that stand there as text with a decimal comma read as numbers.

    Raises
    ------
    BadInput
        For points and commas in such texts of one sheet, and for thousands separators.
    """
    names = [name for name in _NUMBERS if name in table and table[name].dtype.kind not in "biuf"]
    texts = table.assign(
        **{name: table[name].map(lambda cell: cell if isinstance(cell, str) else "") for name in names}
    )
    texts = texts.astype(dict.fromkeys(names, "str"))
    for cell in _first_cells(texts, names, _GROUPS, _EITHER):
        raise BadInput(f"{path}: {_where(table, cell)}: a thousands separator; write the number without it")
    commas, points = (list(_first_cells(texts, names, sign)) for sign in (_COMMA, _POINT))
    if commas and points:
        raise _mixed(table, path, min(points), min(commas))
    for name in {cell.column for cell in commas}:
        table[name] = pd.to_numeric(texts[name].str.replace(",", "."), errors="coerce").where(
            texts[name].str.fullmatch(_COMMA), table[name]
        )
    return table.infer_objects()


def _by_either_sign(parse: Callable[[str], pd.DataFrame], path: Path) -> pd.DataFrame:
    by_comma = parse(",")
    points = _first_decimals(by_comma, _POINT)
    if not points:
        return _with_points(by_comma)
    by_point = parse(".")
    commas = _first_decimals(by_point, _COMMA)
    if not commas:
        return by_point
    # A column that is not used, such as a version, may hold either sign: it stays text.
    our_points, our_commas = ([c for c in cells if c.column in _NUMBERS] for cells in (points, commas))
    if our_commas and not our_points:
        return _with_points(by_comma)
    if our_points and not our_commas:
        return by_point
    raise _mixed(by_comma, path, min(our_points or points), min(our_commas or commas))


def _mixed(table: pd.DataFrame, path: Path, *cells: _Cell) -> BadInput:
    """Return the error of a table with numbers by either sign, a cell of each given."""
    earlier, later = sorted(cells)
    other = f"row {earlier.row + 1}, column {earlier.column} {earlier.text[:40].strip()!r}"
    return BadInput(f"{path}: {_where(table, later)}, but {other}: points and commas; write all decimals in one way")


def _first_decimals(table: pd.DataFrame, decimal: str) -> list[_Cell]:
    """Return the first number by this decimal sign in each column of text that is or seems one of numbers."""
    return list(_first_cells(table, _numeric_columns(table), decimal))


def _numeric_columns(table: pd.DataFrame) -> list[str]:
    """Return the columns that are of numbers by their name, and those whose cells are numbers, blank or NaN."""

    def seems_numeric(cells: pd.Series) -> bool:
        return bool((cells.str.fullmatch(_EITHER) | cells.str.strip().str.lower().isin(NO_READING)).all())

    others = (name for name in table.columns if name not in (*_NUMBERS, *TEXT_COLUMNS) and _is_text(table[name]))
    return [*_NUMBERS, *(name for name in others if seems_numeric(table[name]))]


def _first_cells(table: pd.DataFrame, columns: Iterable[str], pattern: str, unless: str = "") -> Iterable[_Cell]:
    """Yield the first cell in each column of text that the pattern matches as a whole, and the other does not."""
    for name in columns:
        if name in table and _is_text(table[name]):
            cells = table[name]
            matches = (cells.str.fullmatch(pattern) & ~cells.str.fullmatch(unless)).to_numpy(dtype=bool)
            if matches.any():
                row = int(matches.argmax())
                yield _Cell(row, name, str(cells.iloc[row]))


def _with_points(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with points in columns that a bad, blank or NaN cell kept from being numbers."""
    for name in _numeric_columns(table):
        if name in table and _is_text(table[name]):
            commas = table[name].str.fullmatch(_COMMA)
            table[name] = table[name].where(~commas, table[name].str.replace(",", "."))
    return table


def _is_text(cells: pd.Series) -> bool:
    return isinstance(cells.dtype, pd.StringDtype)


def _where(table: pd.DataFrame, cell: _Cell) -> str:
    record = f", record {str(table['record'].iloc[cell.row])[:60]!r}" if "record" in table else ""
    line = line_of(table.attrs, cell.row)
    return f"row {cell.row + 1} (line {line}){record}, column {cell.column} holds {cell.text[:40].strip()!r}"
