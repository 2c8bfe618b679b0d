"""The table of slow load-deflection tests: checked, its readings on a loading or an unloading branch, and averaged.

A test is one cycle: load up in steps, then down, a reading after each. Rows of a test are in measured order. A curve of
several cycles without directions is cut into tests of one cycle.
"""

import warnings
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import NAME, line_of, one_line
from bayes_tyre.record import ALLOWED_TEXTS
from bayes_tyre.record_table import check_agreement, check_columns, numbers_in
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.load_deflection import Deflection, deflection_of
from bayes_tyre.signals.reversals import cut_at_reversals, direction_of, is_closed

REQUIRED = ("test", "load_kN", "displacement_mm")
#: What names a test but its repeat, and all factors of a test.
CASE_OF_TEST = ("configuration", "speed_km_h")
FACTORS_OF_TEST = (*CASE_OF_TEST, "repeat")
#: Whether a reading is one of those that the loading (unloading) line is fitted to.
ON_LINE = {"loading": "on_loading_line", "unloading": "on_unloading_line"}
_NUMBERS = ("load_kN", "displacement_mm", "speed_km_h", "repeat")
_TEXTS = ("test", "configuration", "direction", "origin")
#: Part of the range of a test's loads by which load may run back, by noise, within a branch.
RUNS_BACK = 0.1


def check_load_deflection(table: pd.DataFrame, name: str = "load-deflection table") -> pd.DataFrame:
    """Return the table with its columns typed and `direction` filled in, or say what is wrong with it.

    Parameters
    ----------
    table:
        Long form, a row a reading: `test`, `load_kN` (kN), `displacement_mm` (mm); optional `configuration`,
        `speed_km_h` (km/h), `repeat`, `direction` (`loading` or `unloading`), `origin`, and further columns, which are
        kept.
    name:
        What to call the table in messages: its file.

    Returns
    -------
    The table, with `direction`, `on_loading_line` and `on_unloading_line`. Where it gives no directions, load grows up
    to the first reading of a test's greatest load and falls from there: this reading ends the loading and begins the
    unloading, and is on both lines, as the source has its readings at 40 kN. Directions given are followed to the
    letter. A test without directions whose load reverses more than once is cut at its reversals (`RUNS_BACK`): each
    closed cycle, up and down, becomes a test, its name followed by ``, cycle 1`` and so on. A reading where one cycle
    ends and the next begins is in both: it was reached by unloading, and is on both lines.

    Raises
    ------
    BadInput
        For missing columns, no rows, cells that are not finite numbers, factors that are empty, unknown or contradict
        each other within a test, and load that does not go up once and down once, or holds no closed cycle.

    Warns
    -----
    UserWarning
        For readings of a test that is cut which belong to no closed cycle: they are left out.
    """
    check_columns(table, name, "test", REQUIRED)
    typed = table.reset_index(drop=True)
    for column in (column for column in _TEXTS if column in typed):
        typed[column] = _texts(typed, column, name)
    for column in (column for column in _NUMBERS if column in typed):
        typed[column] = _finite(typed, column, name)
    check_agreement(typed, name, "test", [factor for factor in (*FACTORS_OF_TEST, "origin") if factor in typed])
    if "direction" in typed:
        return _with_directions(typed, name)
    cut, behind_unloading = _cut_into_cycles(typed, name)
    return _with_directions(cut, name, behind_unloading).reset_index(drop=True)


def with_deflection(table: pd.DataFrame, rigs: Mapping[str, Rig | None]) -> pd.DataFrame:
    """Return the checked table with the columns of `Deflection` (mm, kN).

    Parameters
    ----------
    table:
        As `check_load_deflection` returns it.
    rigs:
        The rig of each configuration (``""``: of a table without); None where the readings are the tyre's already, on
        flat ground.
    """
    converted = table.copy()
    configuration = table["configuration"] if "configuration" in table else pd.Series("", index=table.index)
    for column in Deflection._fields:
        converted[column] = np.nan
    for label, rows in table.groupby(configuration, sort=False).groups.items():
        load, mm = (table.loc[rows, column].to_numpy(float) for column in ("load_kN", "displacement_mm"))
        rig = rigs[str(label)]
        deflection = Deflection(mm, load, mm, load) if rig is None else deflection_of(rig, load, mm)
        converted.loc[rows, list(Deflection._fields)] = np.stack(deflection, axis=1)
    return converted


def averaged(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Return the tests of each case averaged reading by reading, as the source does, and why others are not.

    Parameters
    ----------
    table:
        As `with_deflection` returns it.

    Returns
    -------
    pandas.DataFrame
        A test a case: `test` (a name), the factors but `repeat`, `repeats` (how many were averaged), `direction`, the
        lines its readings are on, and the means of load, displacement and the columns of `Deflection`. Empty without
        factors to tell a case by.
    warnings : list of str
        A sentence for each case whose tests were not read at the same loads.
    """
    factors = [factor for factor in CASE_OF_TEST if factor in table]
    means: list[pd.DataFrame] = []
    warnings: list[str] = []
    for case, tests in table.groupby(factors, sort=False) if factors else ():
        label = ", ".join(f"{factor:g} km/h" if isinstance(factor, float) else str(factor) for factor in case)
        each = [test.reset_index(drop=True) for _, test in tests.groupby("test", sort=False)]
        if any(not test["direction"].equals(each[0]["direction"]) for test in each) or _loads_part(each):
            warnings.append(f"{label}: its {len(each)} tests were not read at the same loads, so no average of them")
            continue
        numbers = ["load_kN", "displacement_mm", *Deflection._fields]
        mean = each[0][[*factors, "direction", *ON_LINE.values()]].copy()
        mean[numbers] = np.mean([test[numbers].to_numpy(float) for test in each], axis=0)
        mean.insert(0, "test", f"{label}, mean of {len(each)}")
        mean.insert(1 + len(factors), "repeats", len(each))
        if "origin" in tests:
            mean["origin"] = " + ".join(sorted(tests["origin"].unique()))
        means.append(mean)
    return (pd.concat(means, ignore_index=True) if means else table.iloc[:0].assign(repeats=0)), warnings


def _loads_part(tests: list[pd.DataFrame]) -> bool:
    """Return whether loads that should be alike lie further apart than neighbouring loads of a test do."""
    loads = np.array([test["load_kN"].to_numpy(float) for test in tests])
    steps = np.abs(np.diff(loads[0]))
    return bool(len(steps) and np.ptp(loads, axis=0).max() > np.median(steps))


def _texts(table: pd.DataFrame, column: str, name: str) -> pd.Series:
    cells = table[column]
    texts = cells.astype(object).where(cells.notna(), "").astype(str).str.strip()
    allowed = ALLOWED_TEXTS.get(column)
    wrong = (texts == "") | (~texts.isin(allowed) if allowed else False)
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        what = "is empty" if texts[row] == "" else f"{texts[row][:40]!r} is none of {', '.join(allowed or ())}"
        raise BadInput(f"{_where(name, table, row, column)} {what}; mend the cell or remove the row")
    return texts


def _finite(table: pd.DataFrame, column: str, name: str) -> pd.Series:
    numbers = numbers_in(table[column])
    fine = np.isfinite(numbers.to_numpy())
    if column == "repeat":
        fine &= (numbers == numbers.round()).to_numpy()
    if not fine.all():
        row = int(np.flatnonzero(~fine)[0])
        cell = table[column].iloc[row]
        what = "is empty" if pd.isna(cell) or str(cell).strip() == "" else f"holds {str(cell)[:40]!r}"
        kind = "whole" if column == "repeat" else "finite"
        raise BadInput(
            f"{_where(name, table, row, column)} {what}: not a {kind} number; mend the cell or remove the row"
        )
    return numbers


def _cut_into_cycles(table: pd.DataFrame, name: str) -> tuple[pd.DataFrame, dict[str, bool]]:
    """Return the table, tests of several cycles cut into tests of one, and of these whether unloading led to them.

    Rows keep their index.
    """
    tests: list[pd.DataFrame] = []
    behind_unloading: dict[str, bool] = {}
    for test, readings in table.groupby("test", sort=False):
        cycles = _closed_cycles(readings["load_kN"].to_numpy(float))
        names = [f"{test}, cycle {number + 1}" for number in range(len(cycles))]
        if table["test"].isin(names).any():
            raise BadInput(f"{name}: test {names[0]!r} is there beside {test!r}, which is cut into cycles; rename one")
        parts = [readings.iloc[rows].assign(test=cycle) for rows, cycle in zip(cycles, names, strict=True)]
        left_out = len(readings) - pd.concat(parts).index.nunique() if parts else 0
        if left_out:
            warnings.warn(
                f"{name}: test {one_line(test, NAME)!r}: cut into closed cycles ({len(cycles)}); {left_out} of its "
                f"{len(readings)} readings belong to none and are left out",
                stacklevel=3,
            )
        tests += parts or [readings]
        behind_unloading |= {cycle: rows.start > 0 for rows, cycle in zip(cycles, names, strict=True)}
    return (pd.concat(tests) if behind_unloading else table), behind_unloading


def _closed_cycles(load: np.ndarray) -> list[slice]:
    """Return the closed cycles, up and down, of a load that reverses more than once; none of others."""
    branches = cut_at_reversals(load, RUNS_BACK * float(np.ptp(load)))
    cycles = [slice(up.start, down.stop) for up, down in pairwise(branches) if direction_of(load[up]) == "loading"]
    return [cycle for cycle in cycles if is_closed(load[cycle])] if len(branches) > 2 else []


def _with_directions(table: pd.DataFrame, name: str, cycles: Mapping[str, bool] | None = None) -> pd.DataFrame:
    """Return the table with directions and lines; `cycles`: tests that were cut, and whether unloading led to them."""
    cycles = cycles or {}
    given = table["direction"].to_numpy() == "unloading" if "direction" in table else None
    unloading, lowest, turning = (np.zeros(len(table), bool) for _ in range(3))
    places = table.groupby("test", sort=False).ngroup().to_numpy()
    for test in range(places.max() + 1):
        rows = np.flatnonzero(places == test)
        label = table["test"].iloc[rows[0]]
        load = table["load_kN"].to_numpy(float)[rows]
        if given is None:
            top = int(load.argmax())
            turning[rows[top]] = top + 1 < len(rows)
        else:
            top = int(given[rows].argmax()) - 1 if given[rows].any() else len(rows) - 1
            back = np.flatnonzero(~given[rows[top + 1 :]])
            if len(back):
                where = _where(name, table, int(rows[top + 1 + back[0]]), "direction")
                raise BadInput(f"{where} is loading after unloading; {_ONE_CYCLE}")
        unloading[rows[top + 1 :]] = True
        lowest[rows[0]] = cycles.get(label, False)
        for branch, sign in ((rows[: top + 1], 1.0), (rows[max(top, 0) :], -1.0)):
            if label not in cycles:  # those cut have branches that run one way
                _check_branch(table, branch, sign, float(np.ptp(load)), name)
    lines = {ON_LINE["loading"]: ~unloading, ON_LINE["unloading"]: unloading | turning | lowest}
    return table.assign(direction=np.where(unloading | lowest, "unloading", "loading"), **lines)


_ONE_CYCLE = "a test is one cycle, up and then down, rows in measured order: give each cycle a name of its own"


def _check_branch(table: pd.DataFrame, rows: np.ndarray, sign: float, span: float, name: str) -> None:
    """Refuse load that runs back on its branch by more than noise would take it."""
    load = sign * table["load_kN"].to_numpy(float)[rows]
    if not len(load):
        return
    back = np.maximum.accumulate(load) - load
    wrong = np.flatnonzero(back > RUNS_BACK * span)
    if len(wrong):
        moves = "falls while loading" if sign > 0 else "rises while unloading"
        where = _where(name, table, int(rows[wrong[0]]), "load_kN")
        raise BadInput(f"{where} {moves} (to {sign * load[wrong[0]]:g} kN); {_ONE_CYCLE}")


def _where(name: str, table: pd.DataFrame, row: int, column: str) -> str:
    test = one_line(table["test"].iloc[row], NAME)
    row = int(table.index[row])
    return f"{name}: row {row + 1} (line {line_of(table.attrs, row)}), test {test!r}, column {column}"
