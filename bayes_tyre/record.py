"""The vocabulary: the words that name a record, the record table checked, and records padded into a batch."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
import pandera.pandas as pa
from jaxtyping import Bool, Float

from bayes_tyre.errors import BadInput

REQUIRED = ("record", "displacement_mm", "force_kN")
CASE_WORDS = ("configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN")
WORDS = (*CASE_WORDS, "repeat")
DIRECTIONS = ("loading", "unloading")
#: Where the numbers of a table come from; a table that does not say is shown as `origin not stated`.
ORIGINS = ("measured", "published", "reconstructed", "simulated")
ORIGIN_UNKNOWN = "origin not stated"
#: A median force above this is taken for newtons, a median travel below this for metres.
NEWTON_LIKE_KN, METRE_LIKE_MM = 1000.0, 0.05
TEXT_COLUMNS = ("record", "configuration", "direction", "origin")
NUMBER_COLUMNS = ("displacement_mm", "force_kN", "time_s", "speed_km_h", "initial_load_kN", "step_kN", "repeat")


class Case(NamedTuple):
    """What was tested: everything that names a record but its repeat (km/h, kN; `step_kN` is signed)."""

    configuration: str
    direction: str
    speed_km_h: float
    initial_load_kN: float
    step_kN: float

    @property
    def label(self) -> str:
        """The source's way of writing a case, such as ``single (0)30-20``, as far as the words are known."""
        known = {name: value for name, value in self._asdict().items() if value == value and value is not None}
        parts = [self.configuration] if self.configuration else []
        if "step_kN" not in known and self.direction:
            parts.append(self.direction)
        speed = f"({self.speed_km_h:g})" if "speed_km_h" in known else ""
        if {"initial_load_kN", "step_kN"} <= known.keys():
            loads = f"{self.initial_load_kN:g}-{self.initial_load_kN + self.step_kN:g}"
        else:
            loads = " ".join(f"{name} {known[name]:g}" for name in ("initial_load_kN", "step_kN") if name in known)
        return " ".join([*parts, *([speed + loads] if speed + loads else [])]) or "all records"


@dataclass(frozen=True)
class Batch:
    """Records of unlike length side by side, padded behind their last point.

    Attributes
    ----------
    records:
        Names, in the order of the rows.
    displacement_mm, force_kN:
        Shape (records, points), float64; padding repeats the record's first point.
    present:
        Shape (records, points); False on padding.
    """

    records: tuple[str, ...]
    displacement_mm: Float[np.ndarray, "records points"]
    force_kN: Float[np.ndarray, "records points"]
    present: Bool[np.ndarray, "records points"]

    @property
    def points(self) -> np.ndarray:
        """Number of measured points a record, shape (records,)."""
        return self.present.sum(axis=1)


def _finite(series: pd.Series) -> pd.Series:
    return pd.Series(np.isfinite(series.to_numpy(dtype=float)), index=series.index)


def _number(required: bool, whole: bool = False) -> pa.Column:
    checks = [pa.Check(_finite, error="is not a finite number")]
    if whole:
        checks.append(pa.Check(lambda s: (s == s.round()) & (s.abs() < 2**53), error="is not a whole number"))
    return pa.Column(float, checks, required=required, nullable=True)


def _text(required: bool, allowed: tuple[str, ...] = ()) -> pa.Column:
    checks = [pa.Check(lambda s: s.str.strip() != "", error="is empty")]
    if allowed:
        checks.append(pa.Check.isin(allowed, error=f"is none of {', '.join(allowed)}"))
    return pa.Column(None, checks, required=required)


def _schema() -> pa.DataFrameSchema:
    return pa.DataFrameSchema(
        {
            "record": _text(required=True),
            "displacement_mm": _number(required=True),
            "force_kN": _number(required=True),
            "time_s": _number(required=False),
            "configuration": _text(required=False),
            "direction": _text(required=False, allowed=DIRECTIONS),
            "speed_km_h": _number(required=False),
            "initial_load_kN": _number(required=False),
            "step_kN": _number(required=False),
            "repeat": _number(required=False, whole=True),
            "origin": _text(required=False, allowed=ORIGINS),
        }
    )


def check_record_table(table: pd.DataFrame, name: str = "record table") -> pd.DataFrame:
    """Return the record table with its columns typed, or say what is wrong with it.

    Parameters
    ----------
    table:
        Long form: `record`, `displacement_mm` (mm), `force_kN` (kN); optional `time_s` (s), the words
        (`configuration`, `direction`, `speed_km_h`, `initial_load_kN`, `step_kN`, `repeat`), `origin`,
        and any further columns, which are kept. Rows of a record are in measured order.
    name:
        What to call the table in messages: its file.

    Raises
    ------
    BadInput
        For missing columns, no rows, cells that are not finite numbers, words that are empty or unknown,
        words that contradict each other within a record, and time that runs backwards.
    """
    missing = [column for column in REQUIRED if column not in table.columns]
    if missing:
        raise BadInput(
            f"{name}: missing column {', '.join(missing)}; found {_one_line(', '.join(map(str, table.columns)))}; "
            f"a record table is comma-separated and needs {', '.join(REQUIRED)}"
        )
    repeated = table.columns[table.columns.duplicated()]
    if len(repeated):
        raise BadInput(f"{name}: column {_one_line(repeated[0])} stands twice; keep one")
    if table.empty:
        raise BadInput(f"{name}: no rows below the header; give at least one record")
    typed = _typed(table, name)
    try:
        _schema().validate(typed, lazy=True)
    except pa.errors.SchemaErrors as error:
        raise BadInput(_first_failure(error.failure_cases, name)) from None
    _check_words(typed, name)
    _check_time(typed, name)
    return typed


def _typed(table: pd.DataFrame, name: str) -> pd.DataFrame:
    typed = table.reset_index(drop=True).copy()
    for column in TEXT_COLUMNS:
        if column in typed:
            typed[column] = typed[column].astype(object).where(typed[column].notna(), "").astype(str)
    for column in NUMBER_COLUMNS:
        if column not in typed:
            continue
        numbers = pd.to_numeric(typed[column], errors="coerce").astype(float)
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


def _one_line(text: object) -> str:
    return " ".join(str(text).split())[:200]


def _where(name: str, table: pd.DataFrame, row: int, column: str) -> str:
    return f"{name}: row {row + 1} (line {row + 2}), record {str(table['record'].iloc[row])[:60]!r}, column {column}"


def _first_failure(failures: pd.DataFrame, name: str) -> str:
    first = failures.sort_values("index", kind="stable").iloc[0]
    more = "" if len(failures) == 1 else f" (and {len(failures) - 1} more)"
    row = int(first["index"])
    return (
        f"{name}: row {row + 1} (line {row + 2}), column {first['column']}: "
        f"{str(first['failure_case'])[:60]!r} {first['check']}{more}; mend the cell or remove the row"
    )


def _check_words(table: pd.DataFrame, name: str) -> None:
    present = [word for word in (*WORDS, "origin") if word in table]
    if not present:
        return
    by_record = table.groupby("record", sort=False)
    for word in present:
        unlike = by_record[word].nunique()
        if unlike.gt(1).any():
            record = str(unlike.idxmax())
            one, other = map(_one_line, table.loc[table["record"] == record, word].unique()[:2])
            raise BadInput(
                f"{name}: record {record!r}, column {word}: contradicts itself ({one} and {other}); "
                "give every record one value or a name of its own"
            )
    if {"direction", "step_kN"} <= set(present):
        first = table.drop_duplicates("record")
        wrong = (first["direction"] == "loading") != (first["step_kN"] > 0)
        if wrong.any():
            record, direction, step = first.loc[wrong, ["record", "direction", "step_kN"]].iloc[0]
            raise BadInput(
                f"{name}: record {record!r}, column step_kN: {step:g} contradicts direction {direction!r}; "
                "step_kN is signed, positive when loading"
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
    """Return where the numbers come from, such as ``"reconstructed"``; several are joined by a plus."""
    if "origin" not in table:
        return ORIGIN_UNKNOWN
    return " + ".join(sorted(table["origin"].unique()))


def suspicious_units(table: pd.DataFrame) -> list[str]:
    """Return what suggests that a checked table is in N or m: a sentence each, with the factor."""
    found = []
    force = float(table["force_kN"].abs().median())
    if force > NEWTON_LIKE_KN:
        found.append(f"column force_kN: median |F| is {force:g}, which looks like N; divide by 1000")
    displacement = table.groupby("record", sort=False)["displacement_mm"]
    travel = float((displacement.max() - displacement.min()).median())
    if 0 < travel < METRE_LIKE_MM:
        found.append(f"column displacement_mm: median travel is {travel:g}, which looks like m; multiply by 1000")
    return found


def record_words(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a record, in order of first appearance: `record`, and those words the table has."""
    present = [word for word in WORDS if word in table]
    words = table.drop_duplicates("record")[["record", *present]].reset_index(drop=True)
    if "repeat" in words:
        words["repeat"] = words["repeat"].astype(int)
    return words


def batches(table: pd.DataFrame, cells: int = 131_072) -> Iterator[Batch]:
    """Yield the records of a checked table in batches of like length, so that memory stays bounded.

    Parameters
    ----------
    table:
        A checked record table.
    cells:
        Most padded points in a batch (a longer record is a batch of its own). Lengths are padded to the
        next power of two (at least 32): the number of shapes, and with it of compilations, grows only with
        the logarithm of the longest record.
    """
    groups = {str(record): rows for record, rows in table.groupby("record", sort=False).indices.items()}
    displacement = table["displacement_mm"].to_numpy(dtype=float)
    force = table["force_kN"].to_numpy(dtype=float)
    by_width: dict[int, list[str]] = {}
    for record, rows in groups.items():
        by_width.setdefault(max(32, 1 << (len(rows) - 1).bit_length()), []).append(record)
    for width, records in sorted(by_width.items()):
        size = max(1, cells // width)
        for start in range(0, len(records), size):
            names = records[start : start + size]
            rows = [groups[record] for record in names]
            yield pad(tuple(names), [displacement[r] for r in rows], [force[r] for r in rows], width)


def pad(
    records: tuple[str, ...], displacement: list[np.ndarray], force: list[np.ndarray], width: int | None = None
) -> Batch:
    """Return the records (mm, kN; one array each) as a batch of the given width (default: the longest)."""
    width = width or max(len(d) for d in displacement)
    shape = (len(records), width)
    present = np.zeros(shape, dtype=bool)
    padded_d, padded_f = np.empty(shape), np.empty(shape)
    for i, (d, f) in enumerate(zip(displacement, force, strict=True)):
        present[i, : len(d)] = True
        padded_d[i], padded_f[i] = d[0], f[0]
        padded_d[i, : len(d)], padded_f[i, : len(d)] = d, f
    return Batch(records, padded_d, padded_f, present)
