"""Raw signals from named columns of numbers in a CSV or Parquet file or a sheet; one column is X."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm.channel_header import ChannelHeader
from bayes_tyre.formats.lvm.channels import build_channels, named_twice
from bayes_tyre.formats.lvm.reader import read_lvm
from bayes_tyre.formats.lvm.roles import COMMENT, Roles, last_channel
from bayes_tyre.formats.tables.decimals import NO_READING
from bayes_tyre.formats.tables.header import UNITS_ROW, Layout
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.formats.x_column import grows, is_time, seconds_per_unit, unit_in
from bayes_tyre.plain_text import NAME, number_in, one_line, quoted
from bayes_tyre.record import RawSignals

_HEAD = 4096


def signals_of(
    columns: Sequence[tuple[str, np.ndarray]], warnings: Sequence[str], units: Sequence[str] = ()
) -> RawSignals:
    """Return columns of equal length as one segment.

    X is the first column with a name such as `time`, else the first column if it grows; a unit of time in its name is
    turned into seconds. Units of channels stand in brackets at the end of their names, unless `units` gives them, one
    a column, empty where there is none.
    """
    last = last_channel(*map(list, zip(*columns, strict=True)))
    names, values, texts = (
        [name for name, _ in columns[:last]],
        [column for _, column in columns[:last]],
        list(warnings),
    )
    given = units or [""] * last
    x = next((i for i, name in enumerate(names) if is_time(name)), None)
    if x is None and last > 1 and grows(values[0]):
        x = 0
    channels = tuple(i for i in range(last) if i != x)
    if x is not None:
        factor = seconds_per_unit(names[x], given[x])
        if factor != 1:
            values[x] = values[x] * factor
            texts.append(f"X {quoted(names[x])} turned into seconds")
    roles = Roles(channels, (x,) * len(channels))
    of_channels = [ChannelHeader(given[i] or unit_in(names[i]), None, np.nan, np.nan) for i in channels]
    segment, more = build_channels(names, roles, values, of_channels)
    return RawSignals((segment,), (*texts, *more, *named_twice(segment)))


def named_by_number(columns: Mapping[str, int], names: Mapping[int, str]) -> list[tuple[int, str]]:
    """Return the columns, counted from 0, that a mapping counts from 1, and what to call each.

    That is what the mapping calls it; X has the unit that its name in the file has.
    """
    return [(at - 1, _called(name, names.get(at - 1, ""))) for name, at in columns.items()]


def _called(name: str, in_file: str) -> str:
    """Return what to call a column; X keeps its name in the file where that is one of X."""
    if not is_time(name):
        return name
    if is_time(in_file):
        return in_file
    return f"{name} ({unit_in(in_file)})" if seconds_per_unit(in_file) != 1 else name


def numbered(raw: RawSignals, columns: Mapping[str, int] | None, path: Path) -> RawSignals:
    """Return the channels that a reader called `column 2` and so on by the names that a mapping gives them.

    Raises
    ------
    BadInput
        If the file gives its channels names, or the column that the mapping calls X is a channel.
    """
    if columns is None:
        return raw
    names = {f"column {at}": name for name, at in columns.items()}
    x_names = {names[one.name] for segment in raw.segments for one in segment if one.name in names}
    if not x_names:
        raise BadInput(
            f"{path}: its channels have names, and no numbers: those are for sheets and tables; take the names that "
            "`bayes-tyre inspect` lists"
        )
    if x := next((name for name in x_names if is_time(name)), None):
        raise BadInput(f"{path}: column {columns[x]} does not hold its time; put the time in the first column, in s")
    segments = [[replace(one, name=names.get(one.name, one.name)) for one in segment] for segment in raw.segments]
    return replace(raw, segments=tuple(map(tuple, segments)))


def read_columns(path: Path, columns: Mapping[str, int] | None = None) -> RawSignals:
    """Return the raw signals in a `.csv` or `.parquet` file: a column a channel, X among them, names above.

    A `.csv` file that is a LabVIEW file, or has no line of names, is read as such; lines of preamble may stand above
    the names, and a row of units below. A column of text is left out with a warning; blank and NaN cells are missing.

    Parameters
    ----------
    path:
        The file.
    columns:
        Channel name -> column, counted from 1, for those alone; None for all.

    Raises
    ------
    BadInput
        If the file cannot be read, holds no numbers, or a cell among numbers is none.
    """
    if path.suffix.lower() == ".csv" and _is_lvm_or_plain(path):
        return numbered(read_lvm(path), columns, path)
    table = read_table(path, Layout(is_time, any_units=True))
    in_row = table.attrs.get(UNITS_ROW, {})
    own = dict(enumerate(map(str, table.columns)))
    if columns is not None and (most := max(columns.values())) > len(own):
        raise BadInput(f"{path}: has {len(own)} columns, no column {most}; mend the number")
    numeric, units, warnings = [], [], []
    for i, name in own.items() if columns is None else named_by_number(columns, own):
        numbers = _numbers(table.iloc[:, i], name, path)
        if numbers is None and name.strip().lower() != COMMENT:
            warnings.append(f"column {quoted(name)} is text: left out")
        elif numbers is not None:
            numeric.append((name, numbers))
            units.append(in_row.get(own[i], ""))
    if not len(table) or not any(not np.isnan(numbers).all() for _, numbers in numeric):
        raise BadInput(f"{path}: holds no numbers; give a column a channel, and the time in the first")
    return signals_of(numeric, warnings, units)


def _is_lvm_or_plain(path: Path) -> bool:
    """Return whether a file begins as a LabVIEW file does, or with numbers where names should stand."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(_HEAD).lstrip(b"\xef\xbb\xbf")
    first = head.split(b"\n")[0].strip().replace(b"\t", b",").replace(b";", b",").split(b",")
    numbers = all(not cell or number_in(cell) is not None for cell in first)
    return head.startswith(b"LabVIEW Measurement") or b"End_of_Header" in head or numbers


def _numbers(column: pd.Series, name: str, path: Path) -> np.ndarray | None:
    """Return a column as numbers, NaN where a cell is blank; None if it holds no number."""
    if pd.api.types.is_datetime64_any_dtype(column) or pd.api.types.is_timedelta64_dtype(column):
        return ((column - column.min()) / pd.Timedelta(seconds=1)).to_numpy(dtype=float) if is_time(name) else None
    if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
        return column.to_numpy(dtype=float, na_value=np.nan)
    texts = column.astype(str).where(column.notna(), "").str.strip()
    numbers = pd.to_numeric(texts, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    wrong = np.flatnonzero(np.isnan(numbers) & ~texts.str.lower().isin(NO_READING).to_numpy())
    if len(wrong) and np.isnan(numbers).all():
        return None
    if len(wrong):
        cell = quoted(texts.iloc[int(wrong[0])])
        where = f"row {wrong[0] + 1}, column {one_line(name, NAME)}"
        raise BadInput(f"{path}: {where}: {cell} is no number; mend the cell")
    return numbers
