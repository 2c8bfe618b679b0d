"""Tables of records, or of slow tests, from one file or many, through a lab's column map, checked."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.column_map import OUR_COLUMNS, ColumnMap, read_column_map
from bayes_tyre.formats.tables.header import NOTES
from bayes_tyre.formats.tables.table_files import READERS, read_table
from bayes_tyre.formats.tables.workbook import split_sheet
from bayes_tyre.plain_text import quoted
from bayes_tyre.record_table import check_record_table, suspicious_units

#: Tables that commands write beside records, skipped in a folder: by name, and by the end of the name.
_REJECTED, _TRUTH = "rejected", "truth"


class Kind(NamedTuple):
    """A kind of table: the column that says what rows belong to, its check, and its force in messages."""

    unit: str
    check: Callable[[pd.DataFrame, str], pd.DataFrame]
    force: str
    symbol: str


RECORDS = Kind("record", check_record_table, "force_kN", "F")


class Given(NamedTuple):
    """A checked table; sentences on units that look wrong, and on what was converted or left out, each with a file."""

    table: pd.DataFrame
    suspicions: list[str]
    notes: list[str]


def read_given(paths: Sequence[Path], columns: Path | None = None, kind: Kind = RECORDS) -> Given:
    """Return the tables in files and folders under one another, read through a column map.

    Parameters
    ----------
    paths:
        Files, ``FILE.xlsx#Sheet`` among them; of a folder, all tables in it, but not below it.
    columns:
        A column map in TOML; None: the columns are ours.
    kind:
        What to check. Of several files, one without a column `record` (or `test`) is one record, named by its file.

    Raises
    ------
    BadInput
        For a file or map that cannot be used, a name that stands in two files, and a column that some files lack.
    """
    column_map, (files, notes) = read_column_map(columns), table_files(paths)
    if not files:
        raise BadInput(f"no file to read {kind.unit}s from; give the path of a table at least")
    each = [read_one(file, column_map, len(files) > 1, kind) for file in files]
    tables = [given.table for given in each]
    check_columns(files, [our_columns(table) for table in tables])
    check_names(files, tables, kind.unit)
    suspicions = of_files(files, [given.suspicions for given in each], together=False)
    notes += of_files(files, [given.notes for given in each])
    return Given(tables[0] if len(tables) == 1 else pd.concat(tables, ignore_index=True), suspicions, notes)


def read_one(file: Path, column_map: ColumnMap, several: bool, kind: Kind = RECORDS) -> Given:
    """Return the table in one file, or one of `several`; its sentences do not name the file."""
    table = column_map.applied(read_table(file, column_map.layout), file)
    if several and kind.unit not in table:
        path, sheet = split_sheet(file)
        table[kind.unit] = path.stem if sheet is None else f"{path.stem} {sheet}"
    table = kind.check(table, str(file))
    notes = list(table.attrs.pop(NOTES, ()))
    table.attrs.clear()
    return Given(table, suspicious_units(table, kind.unit, kind.force, kind.symbol), notes)


def of_files(files: Sequence[Path], sentences: Sequence[Sequence[str]], *, together: bool = True) -> list[str]:
    """Return the sentences on each file with the file before them; one on several files once, if `together`."""
    if not together:
        return [f"{file}: {text}" for file, texts in zip(files, sentences, strict=True) for text in texts]
    of_each: dict[str, list[Path]] = {}
    for file, texts in zip(files, sentences, strict=True):
        for text in texts:
            of_each.setdefault(text, []).append(file)
    return [f"{names(of)}: {text}" for text, of in of_each.items()]


def names(paths: Sequence[Path]) -> str:
    """Return the first path as text, and how many more there are."""
    return f"{paths[0]}" + (f" and {len(paths) - 1} more" if len(paths) > 1 else "")


def table_files(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files that paths name, and a sentence on each folder of which tables were skipped.

    Raises
    ------
    BadInput
        If a folder holds no table.
    """
    files: list[Path] = []
    notes: list[str] = []
    for path in paths:
        if not path.is_dir():
            files.append(path)
            continue
        there = sorted(one for one in path.iterdir() if one.suffix.lower() in READERS and one.name[0] not in ".~")
        of_folder = [one for one in there if one.stem != _REJECTED and one.stem.rpartition("_")[2] != _TRUTH]
        if not of_folder:
            raise BadInput(f"{path}: is a folder without a table ({', '.join(READERS)}); name the files")
        notes += [f"{one}: no table of records: skipped" for one in there if one not in of_folder]
        files += of_folder
    return list(dict.fromkeys(files)), notes


def our_columns(table: pd.DataFrame) -> list[str]:
    """Return the columns of a table that mean something here."""
    return sorted({*table.columns} & {*OUR_COLUMNS})


def check_columns(files: Sequence[Path], ours: Sequence[Sequence[str]]) -> None:
    """Refuse a column of ours that only some of the files have.

    Raises
    ------
    BadInput
        With the column, a file that has it and one that does not.
    """
    for file, columns in zip(files, ours, strict=True):
        if lacks := sorted({*ours[0]} ^ {*columns}):
            has, has_not = (file, files[0]) if lacks[0] in columns else (files[0], file)
            raise BadInput(f"{has_not}: has no column {lacks[0]}, which {has} has; add it, or fit them apart")


def check_names(files: Sequence[Path], tables: Sequence[pd.DataFrame], unit: str = RECORDS.unit) -> None:
    """Refuse a name that stands in two files.

    Raises
    ------
    BadInput
        With the name and both files.
    """
    seen: dict[str, Path] = {}
    for file, table in zip(files, tables, strict=True):
        for name in table[unit].unique():
            if name in seen:
                raise BadInput(
                    f"{file}: {unit} {quoted(name)} stands in {seen[name]} too; rename one, or leave the column out "
                    f"where a file is one {unit}: then it is named by its file"
                )
            seen[name] = file
