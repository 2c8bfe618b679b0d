"""Bad input and bad options as a user meets them: the exit code, one line, nothing written."""

from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import assert_refused, finish, here, installed, small, start, text_of, tree_of, with_cell, written

from bayes_tyre import workflow

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


# Faults: what stands in the file, and what the line on stderr must name.
FAULTS: dict[str, tuple[Callable[[], bytes], tuple[str, ...]]] = {
    "empty file": (lambda: b"", ("is empty",)),
    "header alone": (lambda: text_of(small()[:0]), ("no rows",)),
    "wrong columns": (lambda: b"a,b\n1,2\n", ("missing column", "record, displacement_mm, force_kN", "a, b")),
    "one column missing": (lambda: text_of(small().drop(columns="force_kN")), ("missing column force_kN",)),
    "semicolons": (lambda: text_of(small()).replace(b",", b";"), ("missing column", "comma-separated")),
    "text": (lambda: text_of(with_cell(7, "force_kN", "n/a")), ("row 7 (line 8)", "force_kN", "'n/a'")),
    "decimal comma": (lambda: text_of(with_cell(5, "force_kN", "1,5")), ("row 5", "force_kN", "1,5")),
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
    "time backwards": (
        lambda: text_of(small().assign(time_s=lambda t: -1.0 * t.index)),
        ("row 2 (line 3)", "time_s", "backwards"),
    ),
    "a name of two lines": (
        lambda: text_of(with_cell(7, "force_kN", "x").assign(record="two\nlines")),
        ("row 7", "force_kN"),
    ),
    "no text at all": (lambda: bytes(range(256)) * 20, ("cannot be read as csv", "UTF-8")),
}
#: One of each family goes through the installed command; all go through the same code in this process.
FAMILIES = ("empty file", "wrong columns", "text", "infinity", "contradicting words")


def faulty(name: str, folder: Path) -> tuple[Path, tuple[str, ...]]:
    content, said = FAULTS[name]
    path = folder / "records.csv"
    path.write_bytes(content())
    return path, (str(path), *said)


@pytest.mark.parametrize("name", FAMILIES)
def test_the_installed_command_refuses_bad_input_in_one_line_and_writes_nothing(name, tmp_path):
    path, said = faulty(name, tmp_path)
    before = tree_of(tmp_path)
    done = installed("lsq", path, "--out", tmp_path / "out", cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, *said)
    assert done.stdout == ""
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize("command", ["lsq", "fit"])
@pytest.mark.parametrize("name", FAULTS)
def test_bad_input_is_refused_in_one_line_and_nothing_is_written(command, name, tmp_path):
    path, said = faulty(name, tmp_path)
    before = tree_of(tmp_path)
    done = here(command, path, "--out", tmp_path / "out")
    assert_refused(done.exit_code, done.stderr, *said)
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize("command", ["lsq", "fit"])
def test_what_is_no_table_on_disk_is_refused(command, tmp_path):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "records.xlsx").write_bytes(b"PK")
    (tmp_path / "records.parquet").write_bytes(b"PAR1, half of it")
    before = tree_of(tmp_path)
    said = {
        "missing.csv": "no such file",
        "folder.csv": "is a folder",
        "records.xlsx": "not a table format",
        "records.parquet": "cannot be read as parquet",
    }
    for name, what in said.items():
        done = here(command, tmp_path / name, "--out", tmp_path / "out")
        assert_refused(done.exit_code, done.stderr, str(tmp_path / name), what)
    assert tree_of(tmp_path) == before


def test_the_installed_command_refuses_a_missing_file_and_a_folder(tmp_path):
    (tmp_path / "records").mkdir()
    running = [start("fit", name, "--out", "out", cwd=tmp_path) for name in ("missing.csv", "records")]
    for process, what in zip(running, ("missing.csv: no such file", "records: is a folder"), strict=True):
        done = finish(process)
        assert_refused(done.returncode, done.stderr, what)
        assert done.stdout == ""
    assert tree_of(tmp_path) == {"records/": b""}


def test_the_installed_command_refuses_to_write_into_a_file(tmp_path):
    path = written(small(), tmp_path / "records.csv")
    before = tree_of(tmp_path)
    done = installed("fit", path, "--out", path, cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, f"--out {path}", "is a file", "name a folder")
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize("command", ["lsq", "fit", "published"])
@pytest.mark.parametrize("below", ["", "below/it"])
def test_a_file_in_the_place_of_a_folder_is_refused_before_any_work(command, below, tmp_path, monkeypatch):
    for work in ("fit_hierarchical", "fit_records", "fit_published"):
        monkeypatch.setattr(workflow, work, lambda *_: pytest.fail("worked first"))
    path = written(small(), tmp_path / "records.csv")
    before = tree_of(tmp_path)
    table = [path] if command in ("lsq", "fit") else []
    done = here(command, *table, "--out", path / below)
    assert_refused(done.exit_code, done.stderr, str(path))
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize(
    ("said", "change"),
    [("points", lambda t: t.drop(index=range(3, 30))), ("constant", lambda t: t.assign(displacement_mm=1.0))],
)
def test_fit_drops_no_record_and_refuses_one_that_cannot_be_fitted(said, change, tmp_path):
    path = written(change(small()), tmp_path / "records.csv")
    before = tree_of(tmp_path)
    done = here("fit", path, "--out", tmp_path / "out", "--units-checked")
    assert_refused(done.exit_code, done.stderr, "single (0)20-10(1)", said)
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
    wrong = {
        "--region": ["lsq", path, "--out", "out", "--region", "nonsense"],
        "--fix": ["lsq", path, "--out", "out", "--fix", "k"],
        "--chains": ["fit", path, "--out", "out", "--chains", "0"],
    }
    running = {said: start(*arguments, cwd=tmp_path) for said, arguments in wrong.items()}
    for said, process in running.items():
        done = finish(process)
        assert done.returncode == 2, done.stderr
        assert said in done.stderr
        assert "Traceback" not in done.stderr
    assert list(tree_of(tmp_path)) == ["records.csv"]
