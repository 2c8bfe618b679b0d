"""The tables of lsq and load-deflection in the terminal: units, errors, statuses, and rows beyond the twentieth."""

import io
from pathlib import Path

import pandas as pd
from rich.console import Console

from bayes_tyre.report.terminal.results_table import print_overview


def printed(folder: Path, status: list[str], width: int = 80) -> list[str]:
    fits = pd.DataFrame({"record": [f"r [red]{i}[/red]" for i in range(len(status))], "k_kN_per_mm": 1.23456})
    fits = fits.assign(k_kN_per_mm_se=0.0456, C_kN=None, beta_mm=0.1, rmse_kN=0.02, points=30, status=status)
    fits.assign(origin="simulated").to_csv(folder / "least_squares.csv", index=False)
    stream = io.StringIO()
    print_overview([folder], Console(file=stream, width=width, force_terminal=False))
    return [line.rstrip() for line in stream.getvalue().splitlines()]


def test_values_stand_with_units_and_errors_and_reasons_below(tmp_path):
    lines = printed(tmp_path, ["ok", "beta not determined", "ok", "no travel", "no travel"])
    assert lines[1] == "fits of Equation 2 (data: simulated): 5 rows, 3 not ok"
    assert " ".join(lines[3].split()) == "record k, kN/mm C, kN beta, mm rmse, kN points status"
    assert " ".join(lines[5].split()) == "r [red]0[/red] 1.235 ± 0.046 0.1 0.02 30 ok"
    assert [line.split()[-1] for line in lines[5:10]] == ["ok", "(1)", "ok", "(2)", "(2)"]
    assert lines[-3:] == ["(1) beta not determined", "(2) no travel", f"files: {tmp_path}"]


def test_rows_beyond_the_twentieth_are_counted_by_status(tmp_path):
    lines = printed(tmp_path, ["ok"] * 20 + ["ok"] * 30 + ["no travel"] * 2 + [f"reason {i}" for i in range(9)])
    assert sum(line.startswith("  r [red]") for line in lines) == 20
    assert lines[1].endswith("61 rows, 11 not ok")
    assert lines[-8:-6] == ["of the 41 further rows 30: ok", "of the 41 further rows 2: no travel"]
    assert lines[-2] == "of the 41 further rows 5: other reasons"
