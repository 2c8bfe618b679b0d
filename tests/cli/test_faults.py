"""Bad input and bad options as a user meets them: the exit code, one line, nothing written."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from helpers.command_line import ON_TABLES, assert_refused, here, installed, small, text_of, tree_of, with_cell, written

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


# Faults: what stands in the file, and what the line on stderr must name.
FAULTS: dict[str, tuple[Callable[[], bytes], tuple[str, ...]]] = {
    "empty file": (lambda: b"", ("is empty",)),
    "header alone": (lambda: text_of(small()[:0]), ("no rows",)),
    "wrong columns": (lambda: b"a,b\n1,2\n", ("missing column", "record, displacement_mm, force_kN", "a, b")),
    "one column missing": (lambda: text_of(small().drop(columns="force_kN")), ("missing column force_kN",)),
    "text": (lambda: text_of(with_cell(7, "force_kN", "n/a")), ("row 7 (line 8)", "force_kN", "'n/a'")),
    "decimal comma": (
        lambda: text_of(with_cell(5, "force_kN", "1,5")),
        ("row 5 (line 6)", "single (0)20-10(1)", "force_kN", "'1,5'", "put semicolons between the cells"),
    ),
    "points and commas": (
        lambda: text_of(with_cell(5, "force_kN", "1,5")).replace(b",", b";").replace(b'"1;5"', b"1,5"),
        ("row 5 (line 6)", "single (0)20-10(1)", "force_kN", "'1,5'", "write all decimals in one way"),
    ),
    "thousands": (
        lambda: text_of(with_cell(5, "force_kN", "1,234.5")),
        ("row 5 (line 6)", "single (0)20-10(1)", "force_kN", "'1,234.5'", "thousands separator"),
    ),
    "a cell too many": (
        lambda: text_of(small()).replace(b"simulated\n", b"simulated,7\n"),
        ("row 1 (line 2) holds 11 cells, the header 10",),
    ),
    "empty cell": (lambda: text_of(with_cell(9, "displacement_mm", "")), ("row 9", "displacement_mm", "is empty")),
    "NaN": (lambda: text_of(with_cell(2, "force_kN", "NaN")), ("row 2", "force_kN", "NaN")),
    "infinity": (lambda: text_of(with_cell(3, "displacement_mm", "inf")), ("row 3", "displacement_mm", "inf")),
    "text among words": (lambda: text_of(with_cell(4, "speed_km_h", "fast")), ("row 4", "speed_km_h", "'fast'")),
    "half a repeat": (lambda: text_of(small().assign(repeat=1.5)), ("repeat", "whole number")),
    "unknown direction": (lambda: text_of(small().assign(direction="up")), ("direction", "loading", "'up'")),
    "contradicting words": (
        lambda: text_of(with_cell(4, "speed_km_h", 35.0)),
        ("single (0)20-10(1)", "speed_km_h", "35.0", "contradicts"),
    ),
    "direction against step": (
        lambda: text_of(small().assign(direction="loading")),
        ("single (0)20-10(1)", "step_kN", "-10", "'loading'"),
    ),
    "no step": (
        lambda: text_of(small().assign(direction="unloading", step_kN=0.0)),
        ("single (0)20-10(1)", "step_kN", "0 contradicts", "'unloading'"),
    ),
    "time backwards": (
        lambda: text_of(small().assign(time_s=lambda t: -1.0 * t.index)),
        ("row 2 (line 3)", "time_s", "backwards"),
    ),
    "a name of two lines": (
        lambda: text_of(with_cell(7, "force_kN", "x").assign(record="two\nlines")),
        ("row 7", "force_kN"),
    ),
    "a workbook by another name": (lambda: b"PK\x03\x04\x14\x00", ("workbook", "save its sheet as CSV")),
    "no text at all": (lambda: bytes(range(256)) * 20, ("cannot be read as csv", "UTF-8")),
}


def faulty(name: str, folder: Path) -> tuple[Path, tuple[str, ...]]:
    content, said = FAULTS[name]
    path = folder / "records.csv"
    path.write_bytes(content())
    return path, (str(path), *said)


def statuses(folder: Path) -> dict[str, str]:
    fits = pd.read_csv(folder / "least_squares.csv", dtype=str)
    return dict(zip(fits["record"], fits["status"], strict=True))


def test_the_installed_command_refuses_bad_input_in_one_line_and_writes_nothing(tmp_path):
    path, said = faulty("infinity", tmp_path)
    before = tree_of(tmp_path)
    done = installed("lsq", path, "--out", tmp_path / "out", cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, *said)
    assert done.stdout == ""
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize("command", ON_TABLES)
@pytest.mark.parametrize("name", FAULTS)
def test_bad_input_is_refused_in_one_line_and_nothing_is_written(command, name, tmp_path):
    path, said = faulty(name, tmp_path)
    before = tree_of(tmp_path)
    done = here(command, path, "--out", tmp_path / "out", *ON_TABLES[command])
    assert_refused(done.exit_code, done.stderr, *said)
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), (";", "."), ("\t", ",")])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_spreadsheet_s_csv_gives_the_same_numbers_as_one_with_commas(separator, decimal, encoding, tmp_path):
    rows = {}
    for name, options in (("usual", {}), ("other", {"sep": separator, "decimal": decimal, "encoding": encoding})):
        small().to_csv(tmp_path / f"{name}.csv", index=False, **options)
        done = here("lsq", tmp_path / f"{name}.csv", "--out", tmp_path / name)
        assert (done.exit_code, done.stderr) == (0, "")
        rows[name] = (tmp_path / name / "least_squares.csv").read_bytes()
    assert rows["usual"] == rows["other"]


@pytest.mark.parametrize("column", ["force_kN", "displacement_mm"])
@pytest.mark.parametrize("value", [1e308, -1e308])
def test_a_number_that_no_square_holds_is_a_row_with_a_reason_in_lsq_and_refused_by_fit(column, value, tmp_path):
    path = written(with_cell(7, column, value), tmp_path / "records.csv")
    before = tree_of(tmp_path)
    refused = here("fit", path, "--out", tmp_path / "out")
    assert_refused(refused.exit_code, refused.stderr, str(path), "single (0)20-10(1)", column, "1e+308")
    assert tree_of(tmp_path) == before
    done = here("lsq", path, "--out", tmp_path / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    status = statuses(tmp_path / "out")
    assert "too large" in status.pop("single (0)20-10(1)")
    assert set(status.values()) == {"ok"}
    assert done.stdout.splitlines()[-1] == f"{len(status) + 1} records, 1 not ok"


@pytest.mark.parametrize(
    ("said", "change"),
    [
        ("too few points", lambda t: t.drop(index=range(1, 30))),
        ("no travel", lambda t: t.assign(displacement_mm=t["displacement_mm"].where(t.index >= 30, 1.0))),
    ],
)
def test_a_record_of_one_point_or_no_travel_is_a_row_with_a_reason_in_lsq(said, change, tmp_path):
    path = written(change(small()), tmp_path / "records.csv")
    done = here("lsq", path, "--out", tmp_path / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    status = statuses(tmp_path / "out")
    assert said in status.pop("single (0)20-10(1)")
    assert set(status.values()) == {"ok"}


@pytest.mark.parametrize(
    ("said", "change"),
    [
        ("points", lambda t: t.drop(index=range(3, 30))),
        ("points", lambda t: t.drop(index=range(1, 30))),
        ("displacement_mm", lambda t: t.assign(displacement_mm=1.0)),
        ("force_kN", lambda t: t.assign(force_kN=1.0)),
    ],
)
def test_fit_drops_no_record_and_refuses_one_that_cannot_be_fitted(said, change, tmp_path):
    path = written(change(small()), tmp_path / "records.csv")
    before = tree_of(tmp_path)
    done = here("fit", path, "--out", tmp_path / "out", "--units-checked")
    assert_refused(done.exit_code, done.stderr, str(path), "single (0)20-10(1)", said)
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("lsq", ["--region", "nonsense"], "--region"),
        ("lsq", ["--fix", "k"], "--fix"),
        ("lsq", ["--fix", "=1"], "--fix"),
        ("lsq", ["--fix", "k=much"], "--fix"),
        ("lsq", ["--fix", "k=nan"], "k=nan"),
        ("lsq", ["--fix", "nonsense=1"], "'nonsense'"),
        ("lsq", ["--free", "nonsense"], "'nonsense'"),
        ("lsq", ["--start", "beta=-1"], "beta=-1"),
        ("lsq", ["--start", "d_i=1"], "--free d_i"),
        ("lsq", ["--fix", "d_i=1", "--free", "d_i"], "d_i"),
        ("lsq", ["--fix", "k=1", "--fix", "C=1", "--fix", "beta=1"], "at least one"),
        ("fit", ["--chains", "0"], "--chains"),
        ("fit", ["--draws", "1"], "--draws"),
        ("fit", ["--seed", "-1"], "--seed"),
        ("fit", ["--seed", str(2**32)], "--seed"),
        ("fit", ["--interval", "1.5"], "--interval"),
        ("fit", ["--chains", "four"], "--chains"),
        ("fit", ["--nonsense"], "--nonsense"),
    ],
)
def test_an_option_that_cannot_be_is_a_usage_error(command, options, said, tmp_path):
    path = written(small(), tmp_path / "records.csv")
    before = tree_of(tmp_path)
    done = here(command, path, "--out", tmp_path / "out", *options)
    assert done.exit_code == 2
    assert said in done.stderr
    assert tree_of(tmp_path) == before


def test_the_installed_command_answers_usage_errors_with_code_2(tmp_path):
    path = written(small(), tmp_path / "records.csv")
    done = installed("fit", path, "--out", "out", "--chains", "0", cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert "--chains" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tree_of(tmp_path)) == ["records.csv"]
