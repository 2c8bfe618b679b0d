"""The tables of fits without a posterior (`lsq`, `load-deflection`) for the terminal."""

import math
from collections import Counter
from pathlib import Path

from rich.console import Console

from bayes_tyre.plain_text import one_line
from bayes_tyre.report.terminal.console import LoggedConsole, print_lines, print_table
from bayes_tyre.results.separate_fits import Column, FitTable

#: The most rows that are printed; those that follow are counted by status, of which the most frequent are named.
MOST_ROWS, MOST_REASONS = 20, 6
_LONGEST_STATUS = 300


def print_fits(tables: list[FitTable], folder: Path, console: Console) -> None:
    """Print the tables of a folder, and where they are."""
    print_tables(tables, console)
    print_lines([f"files: {one_line(folder, None)}"], console)


def print_tables(tables: list[FitTable], console: Console | None = None) -> None:
    """Print tables, value ± standard error; reasons why rows are not ok stand below, by number."""
    console = console or LoggedConsole()
    for table in tables:
        reasons = [status for status in dict.fromkeys(table.status[:MOST_ROWS]) if status != "ok"]
        rows = len(table.status)
        console.print()
        about = f"{table.caption} (data: {one_line(table.origin)}): {rows} rows, {table.not_ok} not ok"
        print_lines([about], console)
        _print_first_rows(table, reasons, console)
        lines = [f"({number}) {reason}" for number, reason in enumerate(reasons, start=1)]
        further = Counter(table.status[MOST_ROWS:]).most_common()
        lines += [
            f"of the {rows - MOST_ROWS} further rows {count}: {status}" for status, count in further[:MOST_REASONS]
        ]
        if len(further) > MOST_REASONS:
            others = sum(count for _, count in further[MOST_REASONS:])
            lines.append(f"of the {rows - MOST_ROWS} further rows {others}: other reasons")
        print_lines([one_line(line, _LONGEST_STATUS) for line in lines], console)


def _print_first_rows(table: FitTable, reasons: list[str], console: Console) -> None:
    headings = [
        (f"{column.name}, {column.unit}" if column.unit else column.name, "left" if column.is_text else "right")
        for column in table.columns
    ]
    status = [each if each == "ok" else f"({reasons.index(each) + 1})" for each in table.status[:MOST_ROWS]]
    rows = zip(*map(_cells, table.columns), status, strict=True)
    print_table([(name, {"justify": how}) for name, how in (*headings, ("status", "left"))], rows, console)


def _cells(column: Column) -> list[str]:
    values, errors = column.values[:MOST_ROWS], column.errors[:MOST_ROWS]
    if column.is_text:
        return [one_line(value) for value in values]
    return [_number(value, error) for value, error in zip(values, errors, strict=True)]


def _number(value: float, error: float) -> str:
    if math.isnan(value):
        return ""
    return f"{value:.4g}" if math.isnan(error) else f"{value:.4g} ± {error:.2g}"
