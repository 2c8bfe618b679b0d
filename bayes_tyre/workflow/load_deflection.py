"""Fits of slow load-deflection tests: lines, law, energies, a figure, and the stiffness pooled with step records."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.tables.table_files import read_table, write_table
from bayes_tyre.inference.load_deflection.pooled_stiffness import K_SE, K, shared_stiffness
from bayes_tyre.inference.load_deflection.table import fit_tests, law_loop
from bayes_tyre.record_table import carry_extras, origin_of, record_extras
from bayes_tyre.report.figures.load_deflection import LoopPanel, load_deflection_loops
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.layout import save
from bayes_tyre.rig.axle import EMBEDDED_RIGS, Rig, load_rig
from bayes_tyre.signals.load_deflection import (
    CASE_OF_TEST,
    FACTORS_OF_TEST,
    ON_LINE,
    averaged,
    check_load_deflection,
    with_deflection,
)
from bayes_tyre.workflow.record_tables import Kind
from bayes_tyre.workflow.result_names import REPORTS

TESTS, CASES, SHARED = "load_deflection.csv", "load_deflection_cases.csv", "shared_stiffness.csv"
FIGURE = "figures/load_deflection_loops.png"
NO_RIG = "none"
#: What `record_tables.read_given` checks these tables by.
SLOW_TESTS = Kind("test", check_load_deflection, "load_kN", "load")


@dataclass(frozen=True)
class Written:
    """What was written: a row a test, k pooled with steps if asked for, notes on averages, and all files."""

    tests: pd.DataFrame
    shared: pd.DataFrame | None
    notes: list[str]
    paths: list[Path]


def fit_load_deflection(
    table: pd.DataFrame, out: Path, *, rig: str | None = None, beta_mm: float | None = None, steps: Path | None = None
) -> Written:
    """Fit every test of a checked table and write the tables and the figure into `out`.

    Parameters
    ----------
    table:
        As `check_load_deflection` returns it.
    rig:
        Name or TOML file; ``none`` where the readings are of the tyre itself, on flat ground; None for the rig that
        the configuration names.
    beta_mm:
        beta known from other records, mm.
    steps:
        A `least_squares.csv` of the same tyres.

    Raises
    ------
    BadInput
        If rig, steps or `out` cannot be used; nothing is written then.
    """
    readings = with_deflection(table, _rigs(table, rig))
    estimates = _read_steps(steps) if steps is not None else None
    prepare_folder(out)
    means, notes = averaged(readings)
    tests, cases = _tests(readings, beta_mm), _cases(means, beta_mm)
    shared = shared_stiffness(tests, estimates) if estimates is not None else None
    for name in (CASES, SHARED, *REPORTS):
        (out / name).unlink(missing_ok=True)  # an older run's
    paths = [write_table(tests, out / TESTS)]
    paths += [write_table(cases, out / CASES)] if len(cases) else []
    paths += [write_table(shared, out / SHARED)] if shared is not None else []
    basis = "as given" if rig == NO_RIG else "as on flat ground"
    setting = Setting(origin_of(table), configurations=tuple(_configurations(table)))
    figure = load_deflection_loops(_panels(readings, tests, cases), setting, basis)
    paths.append(save(figure, out / FIGURE))
    return Written(tests, shared, notes, paths)


def _configurations(table: pd.DataFrame) -> list[str]:
    return list(table["configuration"].unique()) if "configuration" in table else [""]


def _rigs(table: pd.DataFrame, name: str | None) -> dict[str, Rig | None]:
    labels = _configurations(table)
    if name is not None:
        return dict.fromkeys(labels, None if name == NO_RIG else load_rig(name))
    unknown = next((label for label in labels if label not in EMBEDDED_RIGS), None)
    if unknown is not None:
        what = f"configuration {unknown[:60]!r} has no rig of its own" if unknown else "no column configuration"
        raise BadInput(
            f"{what} ({', '.join(EMBEDDED_RIGS)} have); give --rig: a TOML file, or {NO_RIG} where the readings are "
            "the tyre's own, on flat ground"
        )
    return {label: load_rig(label) for label in labels}


def _read_steps(path: Path) -> pd.DataFrame:
    steps = read_table(path)
    missing = [column for column in (K, K_SE) if column not in steps]
    if missing:
        raise BadInput(f"--steps {path}: missing column {', '.join(missing)}; name a least_squares.csv that lsq wrote")
    return steps


def _tests(readings: pd.DataFrame, beta_mm: float | None) -> pd.DataFrame:
    """Return the rows of `load_deflection.csv`: name, factors, fits, further columns, origin."""
    first = readings.drop_duplicates("test").reset_index(drop=True)
    factors = pd.DataFrame({"test": first["test"], **{name: first.get(name, "") for name in FACTORS_OF_TEST}})
    if "repeat" in first:
        factors["repeat"] = factors["repeat"].astype(int)
    rows = factors.merge(fit_tests(readings, beta_mm), on="test", validate="1:1").rename(columns={"test": "record"})
    ours = [*ON_LINE.values(), "load_kN", "flat_ground_mm", "flat_ground_kN", "wheel_centre_mm", "wheel_centre_kN"]
    as_records = readings.drop(columns=ours).rename(columns={"record": "given_record", "test": "record"})
    rows = carry_extras(rows, record_extras(as_records)).rename(columns={"record": "test"})
    return rows.assign(origin=first["origin"] if "origin" in first else origin_of(readings))


def _cases(means: pd.DataFrame, beta_mm: float | None) -> pd.DataFrame:
    """Return the rows of `load_deflection_cases.csv`: name, factors, number of tests, fits, origin."""
    if means.empty:
        return means
    factors = [name for name in (*CASE_OF_TEST, "repeats", "origin") if name in means]
    first = means.drop_duplicates("test")[["test", *factors]]
    rows = first.merge(fit_tests(means, beta_mm), on="test", validate="1:1")
    origin = rows.pop("origin") if "origin" in rows else origin_of(means)
    return rows.assign(origin=origin)


def _panels(readings: pd.DataFrame, tests: pd.DataFrame, cases: pd.DataFrame) -> Sequence[LoopPanel]:
    """Return the panels of the figure: every averaged case, and every test of the others."""
    factors = [name for name in CASE_OF_TEST if name in readings]
    panels, drawn = [], set()
    for _, fit in cases.iterrows():
        of_case = readings[(readings[factors] == fit[factors]).all(axis=1)]
        drawn |= set(of_case["test"])
        panels.append(_panel(of_case, fit))
    for _, fit in tests[~tests["test"].isin(drawn)].iterrows():
        panels.append(_panel(readings[readings["test"] == fit["test"]], fit))
    return panels


def _panel(readings: pd.DataFrame, fit: pd.Series) -> LoopPanel:
    d = readings["flat_ground_mm"]
    drawable = pd.notna(fit["k_kN_per_mm"]) and d.max() > d.min()
    row: dict[str, Any] = {str(column): value for column, value in fit.items()}
    loop = law_loop(row, float(d.min()), float(d.max())) if drawable else None
    return LoopPanel(str(fit["test"]), str(fit.get("configuration", "")), readings, row, loop)
