"""The table of a result beside the truth, for the terminal: record by record, then how far off it is."""

import math
from pathlib import Path

import pandas as pd
from rich.console import Console

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.structured_text import read_json
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.plain_text import one_line
from bayes_tyre.record import RECORD_UNITS
from bayes_tyre.report.terminal.console import LoggedConsole, print_lines, print_table
from bayes_tyre.results.recovery import (
    WHAT_IT_COMPARES,
    WHAT_MOTIONS_COMPARE,
    WHAT_NO_FRICTION_COMPARES,
    WHAT_OTHER_FRICTION_COMPARES,
    Recovery,
    of_least_squares,
    of_posterior,
)

FITS, REPEATS = "least_squares.csv", "repeats.csv"


def print_recovery(folders: list[Path], truth: Path, console: Console | None = None) -> None:
    """Print a table for each folder that `lsq` or `fit` wrote, beside the rows of `truth.csv`.

    Raises
    ------
    BadInput
        If a folder holds neither, or a table is not what these commands write; nothing is printed then.
    """
    true = read_table(truth)
    recoveries = [(folder, recover(folder, true)) for folder in folders]
    console = console or LoggedConsole()
    for folder, recovery in recoveries:
        console.print()
        print_lines([f"beside the truth: {_title(folder)}"], console)
        _print_table(recovery, console)
        print_lines(_sentences(recovery), console)
    for line in dict.fromkeys(_compared(recovery) for _, recovery in recoveries):
        console.print()
        print_lines([line], console)


def _compared(recovery: Recovery) -> str:
    if "m" not in recovery.parameters:
        return WHAT_IT_COMPARES
    if "x" in recovery.parameters:
        return WHAT_MOTIONS_COMPARE
    return WHAT_OTHER_FRICTION_COMPARES if "beta" in recovery.parameters else WHAT_NO_FRICTION_COMPARES


def recover(folder: Path, truth: pd.DataFrame) -> Recovery:
    """Return what a folder holds beside a table of truths: of `fit` if it has `repeats.csv`, else of `lsq`."""
    for name, compare in ((REPEATS, of_posterior), (FITS, of_least_squares)):
        if (folder / name).is_file():
            try:
                return compare(truth, read_table(folder / name))
            except BadInput as error:
                raise BadInput(f"{folder}: {error}" if str(folder) not in str(error) else str(error)) from None
    raise BadInput(f"{folder}: holds neither {REPEATS} nor {FITS}; name a folder that fit or lsq wrote")


def _title(folder: Path) -> str:
    """Return where a result lies, what made it, and its verdict with the reasons against it."""
    if not (folder / REPEATS).is_file():
        return f"{one_line(folder, None)} (least squares)"
    try:
        diagnostics = read_json(folder / "diagnostics.json")
        verdict = "; ".join([f"verdict: {diagnostics['verdict']}", *map(str, diagnostics["reasons"])])
    except (OSError, ValueError, KeyError, TypeError):
        verdict = "no verdict: diagnostics.json is missing or not what fit writes"
    return f"{one_line(folder, None)} (posterior medians; {one_line(verdict, 500)})"


def _print_table(recovery: Recovery, console: Console) -> None:
    with_interval = {name: bool(recovery.records[f"{name}_covered"].notna().any()) for name in recovery.parameters}
    with_status = not recovery.records["status"].isin(["ok", ""]).all()
    titles = [
        title
        for name in recovery.parameters
        for title in (f"{name} true, {RECORD_UNITS[name]}", name, "error, %", *(["in interval"] * with_interval[name]))
    ]
    rows = []
    for row in recovery.records.to_dict("records"):
        cells = [one_line(row["record"])]
        for name in recovery.parameters:
            cells += [_number(row[f"{name}_true"]), _number(row[name]), _percent(row[f"{name}_error"])]
            cells += [{1.0: "yes", 0.0: "no"}.get(row[f"{name}_covered"], "")] * with_interval[name]
        status = "lost" if pd.isna(row["status"]) else row["status"]
        rows.append([*cells, *([one_line(status)] if with_status else [])])
    of_numbers = [(title, {"justify": "right"}) for title in titles]
    print_table([("record", {}), *of_numbers, *([("status", {})] * with_status)], rows, console)


def _sentences(recovery: Recovery) -> list[str]:
    lines = []
    for row in recovery.summary.to_dict("records"):
        covered = ""
        if not math.isnan(row["covered"]):
            covered = f"; {100 * row['interval']:g} % intervals hold the truth in {100 * row['covered']:.0f} %"
        lines.append(
            f"{row['parameter']}: rms relative error {100 * row['rms']:.2f} %, median {100 * row['median']:+.2f} % "
            f"({row['records']} records){covered}"
        )
    if recovery.lost:
        lines.append(f"{recovery.lost} of {len(recovery.records)} records lost")
    if recovery.unknown:
        lines.append(f"{recovery.unknown} records of the result have no truth and are left out")
    return lines


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.4g}"


def _percent(value: float) -> str:
    return "" if math.isnan(value) else f"{100 * value:+.1f}"
