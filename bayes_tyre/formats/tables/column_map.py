"""The column map of a lab (`--columns MAP.toml`): its names, units, values and constants, turned into ours."""

from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pandas as pd
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.structured_text import read_toml
from bayes_tyre.formats.tables.header import NOTES, UNITS, UNITS_ROW, Layout, unit_of_name
from bayes_tyre.plain_text import line_of, listed, quoted, reason
from bayes_tyre.record import ALLOWED_TEXTS, DIRECTIONS, NUMBER_COLUMNS, TEXT_COLUMNS

#: Units of the columns that have one.
OUR_UNITS = {
    **{"displacement_mm": "mm", "force_kN": "kN", "load_kN": "kN", "time_s": "s"},
    **{"initial_load_kN": "kN", "step_kN": "kN", "speed_km_h": "km/h"},
}
#: Columns of record tables and of load-deflection tables.
OUR_COLUMNS = (*TEXT_COLUMNS, "test", *NUMBER_COLUMNS, "load_kN")


def _known_column(name: str) -> str:
    if name not in OUR_COLUMNS:
        raise ValueError(f"is no column of ours, which are {', '.join(OUR_COLUMNS)}")
    return name


_OurColumn = Annotated[str, AfterValidator(_known_column)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class TheirColumn(_Strict):
    """A column of the file by its name, stripped of spaces around it.

    `unit` None: as the file says, or ours. `unsigned`: steps without a sign, which the direction gives them.
    """

    name: Annotated[str, AfterValidator(str.strip)]
    unit: str | None = None
    unsigned: bool = False


def _named(value: object) -> object:
    return {"name": value} if isinstance(value, str) else value


class Values(_Strict):
    """Our value by theirs."""

    direction: dict[str, Literal["loading", "unloading"]] = {}


class ColumnMap(_Strict):
    """What a lab calls our columns, in which units; values for all rows; and what it calls loading and unloading."""

    skip_rows: Annotated[int, Field(ge=0)] | None = None
    columns: dict[_OurColumn, Annotated[TheirColumn, BeforeValidator(_named)]] = {}
    constants: dict[_OurColumn, str | float] = {}
    values: Values = Values()

    @model_validator(mode="after")
    def _check(self) -> "ColumnMap":
        for ours, their in self.columns.items():
            _check_unit(ours, their.unit, f"columns.{ours}")
            if their.unsigned and ours != "step_kN":
                raise ValueError(f"columns.{ours}: unsigned is for step_kN alone")
        theirs = Counter(their.name for their in self.columns.values())
        if twice := [name for name, count in theirs.items() if count > 1]:
            raise ValueError(f"columns: {quoted(twice[0])} stands for two columns")
        for ours, value in self.constants.items():
            if ours in self.columns:
                raise ValueError(f"constants.{ours}: is a column of the file too")
            if isinstance(value, str) is (ours in NUMBER_COLUMNS or ours == "load_kN"):
                raise ValueError(f"constants.{ours}: {value!r} is no {'number' if isinstance(value, str) else 'text'}")
            if value not in ALLOWED_TEXTS.get(ours, (value,)):
                raise ValueError(f"constants.{ours}: {value!r} is none of {', '.join(ALLOWED_TEXTS[ours])}")
        return self

    @property
    def options(self) -> dict[str, object]:
        """What `run.json` says of it."""
        return self.model_dump(exclude_defaults=True)

    @property
    def layout(self) -> Layout:
        """What to look for in the header of a file, and how to rename its columns."""
        names = {their.name: ours for ours, their in self.columns.items()}
        sought = {*names, *OUR_COLUMNS} - self.columns.keys() | names.keys()
        return Layout(sought.__contains__, names, self.skip_rows)

    def applied(self, table: pd.DataFrame, path: Path) -> pd.DataFrame:
        """Return a table that was read with this layout in our units and values; its `attrs` note what was converted.

        Raises
        ------
        BadInput
            For a unit that is unknown, a direction that is neither, and a column that is also a constant.
        """
        notes = [*table.attrs.get(NOTES, ())]
        for column in (column for column in OUR_UNITS if column in table):
            table = self._in_our_unit(table, column, path, notes)
        if both := [name for name in self.constants if name in table]:
            raise BadInput(f"{path}: column {both[0]} is in the file and among the constants of the map; remove one")
        table = table.assign(**self.constants)
        if "direction" in table and self.values.direction:
            table["direction"] = self._directions(table, path)
        if "step_kN" in self.columns and self.columns["step_kN"].unsigned:
            table["step_kN"] = self._signed_steps(table, path)
        table.attrs[NOTES] = notes
        return table

    def _in_our_unit(self, table: pd.DataFrame, column: str, path: Path, notes: list[str]) -> pd.DataFrame:
        """Return the table with a column in our unit; the map's word on its unit counts more than the file's."""
        their = self.columns.get(column, TheirColumn(name=column))
        ours, in_name = OUR_UNITS[column], unit_of_name(their.name)
        in_row = table.attrs.get(UNITS_ROW, {}).get(column, "")
        unit = their.unit or in_row or ours
        if their.unit is None and not in_row and in_name not in ("", ours):
            raise BadInput(
                f"{path}: column {quoted(their.name)} is taken for {ours}, its name says {quoted(in_name)}; give its "
                f'unit in the map: {column} = {{ name = ..., unit = "..." }}'
            )
        try:
            divisor = _check_unit(column, unit, f"column {quoted(their.name)}")
        except ValueError as error:
            raise BadInput(f"{path}: {error}; convert it first") from None
        if in_row not in ("", unit):
            notes.append(
                f"column {quoted(their.name)} is read in {unit} as the map says; its row of units says {in_row}"
            )
        elif in_row not in ("", ours):
            notes.append(f"column {quoted(their.name)} is in {unit} by its row of units: converted to {ours}")
        return table if divisor == 1 else table.assign(**{column: _divided(table[column], divisor)})

    def _directions(self, table: pd.DataFrame, path: Path) -> pd.Series:
        theirs = table["direction"].map(lambda cell: "" if pd.isna(cell) else str(cell).strip())
        ours = theirs.replace(self.values.direction)
        wrong = np.flatnonzero(~ours.isin(DIRECTIONS))
        if len(wrong):
            row = int(wrong[0])
            line = line_of(table.attrs, row)
            raise BadInput(
                f"{path}: row {row + 1} (line {line}), column direction: {quoted(theirs.iloc[row])} is neither loading "
                "nor unloading; say in [values.direction] of the map which it is"
            )
        return ours

    def _signed_steps(self, table: pd.DataFrame, path: Path) -> pd.Series:
        """Return the steps with the sign that the direction gives them; what is no number stays, to be refused."""
        if not {"step_kN", "direction"} <= {*table}:
            raise BadInput(f"{path}: steps are unsigned by the map, and need a column direction; add it to the map")
        falls = table["direction"] == "unloading"
        return _divided(table["step_kN"], np.where(falls, -1.0, 1.0))


def _check_unit(column: str, unit: str | None, where: str) -> float:
    """Return the divisor that turns a unit of a column into ours."""
    accepted = UNITS.get(OUR_UNITS.get(column, ""), {})
    if unit is not None and unit not in accepted:
        raise ValueError(f"{where}: {quoted(unit)} is no unit of {column}; use {', '.join(accepted) or 'none'}")
    return 1.0 if unit is None else accepted[unit]


def _divided(cells: pd.Series, divisor: float | np.ndarray) -> pd.Series:
    """Return numbers divided, by one number or by one each; what is no number stays, to be refused by its own text."""
    # As objects, dates and durations are no numbers.
    numbers = pd.to_numeric(cells if cells.dtype.kind in "iuf" else cells.astype(object), errors="coerce")
    return (numbers / divisor).astype(object).where(numbers.notna(), cells) if numbers.hasnans else numbers / divisor


def read_column_map(path: Path | None) -> ColumnMap:
    """Return the column map in a TOML file; None: one that changes nothing.

    Raises
    ------
    BadInput
        For a file that is no TOML, and for a key, a unit or a value that cannot be; the message names file and key.
    """
    if path is None:
        return ColumnMap()
    try:
        return ColumnMap.model_validate(read_toml(path))
    except ValidationError as error:
        raise BadInput(f"--columns {path}: {_first_fault(error)}; mend the map") from None
    except (OSError, ValueError) as error:
        raise BadInput(f"--columns {path}: cannot be read as TOML: {reason(error)}; mend the map") from None


def _first_fault(error: ValidationError) -> str:
    fault, key = error.errors()[0], ""
    key = ".".join(str(part) for part in fault["loc"] if part != "[key]")
    sections = listed([*ColumnMap.model_fields])
    unknown = f"is unknown; the map has {sections}" if fault["type"] == "extra_forbidden" else ""
    return f"{key}: {unknown or fault['msg'].removeprefix('Value error, ')}".removeprefix(": ")
