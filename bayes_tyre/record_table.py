"""The record table: checks of a table from outside, and the factors and further columns of each record."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pandera.pandas as pa

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import REASON, line_of, one_line
from bayes_tyre.record import ALLOWED_TEXTS, FACTORS, NUMBER_COLUMNS, ORIGIN_UNKNOWN, REQUIRED, TEXT_COLUMNS

#: A median force above this looks like newtons, a median travel below this like metres.
NEWTON_LIKE_KN, METRE_LIKE_MM = 1000.0, 0.05
#: What is taken off before a label: spaces, typed or pasted. A tab is the label's own.
_BLANKS = " \N{NO-BREAK SPACE}"


def _finite(series: pd.Series) -> pd.Series:
    return pd.Series(np.isfinite(series.to_numpy(dtype=float)), index=series.index)


def _column(name: str) -> pa.Column:
    required = name in REQUIRED
    if name in TEXT_COLUMNS:
        checks = [pa.Check(lambda s: s.str.strip() != "", error="is empty")]
        if allowed := ALLOWED_TEXTS.get(name):
            checks.append(pa.Check.isin(allowed, error=f"is none of {', '.join(allowed)}"))
        return pa.Column(None, checks, required=required)
    checks = [pa.Check(_finite, error="is not a finite number")]
    if name == "speed_km_h":
        checks.append(pa.Check.ge(0.0, error="is below 0"))
    if name == "repeat":
        checks.append(pa.Check(lambda s: (s == s.round()) & (s.abs() < 2**53), error="is not a whole number"))
    return pa.Column(float, checks, required=required, nullable=True)


def _schema() -> pa.DataFrameSchema:
    return pa.DataFrameSchema({name: _column(name) for name in (*REQUIRED, "time_s", *FACTORS, "origin")})


def check_record_table(table: pd.DataFrame, name: str = "record table") -> pd.DataFrame:
    """Return the record table with its columns typed, or raise with the first fault.

    Parameters
    ----------
    table:
        Long form: `record`, `displacement_mm` (mm), `force_kN` (kN); optional `time_s` (s), the factors
        (`configuration`, `direction`, `speed_km_h`, `initial_load_kN`, `step_kN`, `repeat`), `origin`,
        and any further columns, which stay. Rows of a record are in measured order.
    name:
        Name of the table in messages: its file.

    Raises
    ------
    BadInput
        For missing columns, no rows, cells that are not finite numbers, factors that are empty or unknown,
        factors that contradict each other within a record, and time that runs backwards.
    """
    check_columns(table, name, "record", REQUIRED)
    typed = _typed(table, name)
    try:
        _schema().validate(typed, lazy=True, inplace=True)
    except pa.errors.SchemaErrors as error:
        raise BadInput(_first_failure(error.failure_cases, name, typed.attrs)) from None
    _check_factors(typed, name)
    _check_time(typed, name)
    return typed


def check_columns(table: pd.DataFrame, name: str, unit: str, required: Sequence[str]) -> None:
    """Refuse a long table that lacks a column, has one twice, or has no rows.

    Parameters
    ----------
    table, name:
        The table, and its name in messages.
    unit:
        What the rows belong to: `record`, `test`.
    required:
        The columns that it must have.

    Raises
    ------
    BadInput
        With the columns that are missing and those that are there.
    """
    missing = [column for column in required if column not in table.columns]
    if missing:
        present = one_line(", ".join(map(str, table.columns)), REASON)
        needs = f"a {unit} table needs {', '.join(required)}"
        raise BadInput(
            f"{name}: missing column {', '.join(missing)}; found {present}; {needs}: rename yours, or name them "
            "in a map (--columns), under [columns], or under [constants] what is the same in every row; `bayes-tyre "
            "columns FILE --out map.toml` proposes one"
        )
    repeated = table.columns[table.columns.duplicated()]
    if len(repeated):
        raise BadInput(f"{name}: column {one_line(repeated[0], REASON)} stands twice; keep one")
    if table.empty:
        raise BadInput(f"{name}: no rows below the header; give at least one {unit}")


def check_agreement(table: pd.DataFrame, name: str, unit: str, factors: Sequence[str]) -> None:
    """Refuse factors that vary within a `unit`: a `record` or a `test`.

    Raises
    ------
    BadInput
        With the first such record or test, the factor and two of its values.
    """
    groups = table.groupby(unit, sort=False)
    for factor in factors:
        levels = groups[factor].nunique()
        if levels.gt(1).any():
            label = str(levels.idxmax())
            one, other = (one_line(value, REASON) for value in table.loc[table[unit] == label, factor].unique()[:2])
            raise BadInput(
                f"{name}: {unit} {one_line(label, REASON)!r}, column {factor}: contradicts itself ({one} and {other}); "
                f"give every {unit} one value or a name of its own"
            )


def _typed(table: pd.DataFrame, name: str) -> pd.DataFrame:
    typed = table.reset_index(drop=True)  # copy on write: only columns that change take memory
    for column in TEXT_COLUMNS:
        if column in typed:
            texts = _as_text(typed[column])
            typed[column] = texts if column == "record" else texts.str.lstrip(_BLANKS).str.rstrip()
    for column in NUMBER_COLUMNS:
        if column not in typed:
            continue
        numbers = numbers_in(typed[column])
        wrong = numbers.isna().to_numpy()
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            cell = typed[column].iloc[row]
            what = "is empty" if pd.isna(cell) or str(cell).strip() == "" else f"holds {str(cell)[:40]!r}"
            raise BadInput(
                f"{_where(name, typed, row, column)} {what}: not a finite number; mend the cell or remove it"
            )
        typed[column] = numbers
    return typed


def numbers_in(column: pd.Series) -> pd.Series:
    """Return a column as numbers, NaN where a cell is none: dates, durations and truth values are no numbers."""
    if not _is_numeric(column):
        cells = [np.nan if isinstance(cell, (bool, np.bool_)) else cell for cell in column]
        column = pd.Series(cells, column.index, dtype=object)
    return pd.to_numeric(column, errors="coerce").astype(float)


def _as_text(column: pd.Series) -> pd.Series:
    """Return a column as text, empty where it is missing."""
    if isinstance(column.dtype, pd.StringDtype):
        return column.fillna("") if column.hasnans else column
    return column.astype(object).where(column.notna(), "").astype(str)


def _where(name: str, table: pd.DataFrame, row: int, column: str) -> str:
    record = str(table["record"].iloc[row])[:60]
    return f"{name}: row {row + 1} (line {line_of(table.attrs, row)}), record {record!r}, column {column}"


def _first_failure(failures: pd.DataFrame, name: str, attrs: Mapping[Any, Any]) -> str:
    failure = failures.sort_values("index", kind="stable").iloc[0]
    more = "" if len(failures) == 1 else f" (and {len(failures) - 1} more)"
    row = int(failure["index"])
    return (
        f"{name}: row {row + 1} (line {line_of(attrs, row)}), column {failure['column']}: "
        f"{str(failure['failure_case'])[:60]!r} {failure['check']}{more}; mend the cell or remove the row"
    )


def _check_factors(table: pd.DataFrame, name: str) -> None:
    present = [name for name in (*FACTORS, "origin") if name in table]
    if not present:
        return
    check_agreement(table, name, "record", present)
    if {"direction", "step_kN"} <= set(present):
        first = table.drop_duplicates("record")
        wrong = first["step_kN"].where(first["direction"] == "loading", -first["step_kN"]) <= 0
        if wrong.any():
            record, direction, step = first.loc[wrong, ["record", "direction", "step_kN"]].iloc[0]
            raise BadInput(
                f"{name}: record {record!r}, column step_kN: {step:g} contradicts direction {direction!r}; "
                "step_kN is signed, positive when loading: negate it where the load falls, or put step_kN = { name = "
                '"step_kN", unsigned = true } under [columns] of a column map (--columns)'
            )


def _check_time(table: pd.DataFrame, name: str) -> None:
    if "time_s" not in table:
        return
    steps = table.groupby("record", sort=False)["time_s"].diff()
    backwards = (steps < 0).to_numpy()
    if backwards.any():
        row = int(np.flatnonzero(backwards)[0])
        raise BadInput(f"{_where(name, table, row, 'time_s')}: time runs backwards; sort the record or split it in two")


def origin_of(table: pd.DataFrame) -> str:
    """Return the origin of a table's values, such as ``"reconstructed"``; several are joined by a plus."""
    if "origin" not in table:
        return ORIGIN_UNKNOWN
    return " + ".join(sorted(table["origin"].unique()))


def suspicious_units(
    table: pd.DataFrame, unit: str = "record", force: str = "force_kN", symbol: str = "F"
) -> list[str]:
    """Return why a checked table looks like N or m: a sentence each, with the conversion factor.

    `unit` is the column that names records or tests, `force` that of the forces or loads.
    """
    sentences = []
    size = float(table[force].abs().median())
    if size > NEWTON_LIKE_KN:
        sentences.append(f"column {force}: median |{symbol}| is {size:g}, which looks like N; divide by 1000")
    displacement = table.groupby(unit, sort=False)["displacement_mm"]
    travel = float((displacement.max() - displacement.min()).median())
    if 0 < travel < METRE_LIKE_MM:
        sentences.append(f"column displacement_mm: median travel is {travel:g}, which looks like m; multiply by 1000")
    return sentences


def record_factors(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a record, in order of first appearance: `record`, and the factors that the table has."""
    present = [name for name in FACTORS if name in table]
    factors = table.drop_duplicates("record")[["record", *present]].reset_index(drop=True)
    if "repeat" in factors:
        factors["repeat"] = factors["repeat"].astype(int)
    return factors


def record_extras(table: pd.DataFrame) -> pd.DataFrame:
    """Return further columns of each record, such as a pressure: one row a record, in order of appearance.

    Columns `record`, and each column that is no column of a record table. Numbers that vary within a record are
    averaged, blank cells among them left out; text that varies is left out.

    Warns
    -----
    UserWarning
        For columns that are left out.
    """
    standard = {*TEXT_COLUMNS, *NUMBER_COLUMNS}
    extras, varying = table[["record"]].drop_duplicates().reset_index(drop=True), []
    by_record = table.groupby("record", sort=False)
    for column in (column for column in table.columns if column not in standard):
        cells = table[column]
        texts = cells.map(str) if cells.dtype == object else cells  # lists and the like cannot be compared
        varies = texts.groupby(table["record"], sort=False).nunique(dropna=False).gt(1).any()
        if (varies and _blank_or_numbers(cells)) or _is_numeric(cells):
            extras[column] = numbers_in(cells).groupby(table["record"], sort=False).mean().to_numpy()
        elif varies:
            varying.append(str(column))
        else:
            extras[column] = by_record[column].first().to_numpy()
    if varying:
        warnings.warn(
            f"column{'s' * (len(varying) > 1)} {', '.join(varying)}: text that varies within a record, left out of the "
            "result; give each record one",
            stacklevel=3,
        )
    return extras


def _is_numeric(cells: pd.Series) -> bool:
    return pd.api.types.is_numeric_dtype(cells) and not pd.api.types.is_bool_dtype(cells)


def _blank_or_numbers(cells: pd.Series) -> bool:
    """Return whether cells are text only for want of a few numbers: some are blank, all others numbers."""
    if not isinstance(cells.dtype, pd.StringDtype):
        return False
    blank = cells.fillna("").str.strip() == ""
    return bool(blank.any() and (numbers_in(cells).notna() | blank).all())


def carry_extras(rows: pd.DataFrame, extras: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with the further columns of their `record`; one whose name is taken becomes ``given_<name>``."""
    taken = {*rows.columns, "origin", "verdict"}
    names = {"record": "record"}
    for column in map(str, extras.columns.drop("record")):
        name = column
        while name in taken or (name != column and name in extras):
            name = f"given_{name}"
        names[column] = name
    return rows.merge(extras.rename(columns=names), on="record", how="left", validate="m:1")
