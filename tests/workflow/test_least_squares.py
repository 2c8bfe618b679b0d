"""Curves read for `lsq --loops`, and what a run without it removes."""

from pathlib import Path

import pandas as pd
import pytest
from helpers.command_line import tree_of, written

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.least_squares.table import FitSettings
from bayes_tyre.workflow import least_squares
from bayes_tyre.workflow.least_squares import fit_least_squares
from bayes_tyre.workflow.loops import read_loops

CURVE = pd.DataFrame({"displacement_mm": [0.0, 1, 2, 1, 0, 1, 2, 1, 0], "force_kN": [0.0, 3, 4, 1, 0, 3, 4, 1, 0]})


def read(path: Path) -> pd.DataFrame:
    branches, _ = read_loops([path], None, pytest.fail)
    return branches


def test_a_table_without_records_is_one_curve_named_as_its_file(tmp_path):
    branches = read(written(CURVE, tmp_path / "damper.csv"))
    assert list(branches["record"].unique()) == [f"damper {i}" for i in range(1, 5)]
    assert list(branches.drop_duplicates("record")["cycle"]) == [1, 1, 2, 2]


def test_directions_and_steps_of_a_curve_are_left_out(tmp_path):
    path = written(
        CURVE.assign(record="a", direction=["loading"] * 4 + ["unloading"] * 5, step_kN=1.0), tmp_path / "a.csv"
    )
    branches = read(path)
    assert "step_kN" not in branches
    assert list(branches.drop_duplicates("record")["direction"]) == ["loading", "unloading"] * 2


def test_a_fault_names_the_file_and_the_row(tmp_path):
    path = written(CURVE.astype(object).replace({"force_kN": {4.0: "x"}}), tmp_path / "a.csv")
    with pytest.raises(BadInput, match=r"a\.csv: row 3 \(line 4\), record 'a', column force_kN"):
        read(path)


def test_a_run_without_loops_removes_what_one_with_them_left(tmp_path, monkeypatch):
    for name in ("loops.csv", "backbone.csv", "report.html", "figures/loops.png", "figures/own.png"):
        Path(tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.setattr(least_squares, "fit_records", lambda *_: pd.DataFrame({"record": ["a"]}))
    fit_least_squares(CURVE.assign(record="a"), FitSettings(), tmp_path, lambda _: None)
    assert set(tree_of(tmp_path)) == {"least_squares.csv", "figures/", "figures/own.png"}
