"""Files that are missing, broken or of another kind: each command says which and what to do, and writes nothing."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from helpers.command_line import ON_RESULTS, ON_TABLES, assert_refused, here, installed, small, text_of, tree_of
from helpers.permissions import permissions
from helpers.quick_fits import write_result

from bayes_tyre.formats.tables.table_files import write_table

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

BINARY = bytes(range(256)) * 20
#: What is no table on disk: the file's name, how it is made, and what the line on stderr must name.
NO_TABLES: dict[str, tuple[str, Callable[[Path], object], tuple[str, ...]]] = {
    "missing": ("records.csv", lambda path: None, ("no such file",)),
    "empty": ("records.csv", lambda path: path.touch(), ("is empty",)),
    "empty parquet": ("records.parquet", lambda path: path.touch(), ("is empty",)),
    "binary": ("records.csv", lambda path: path.write_bytes(BINARY), ("cannot be read as csv", "UTF-8")),
    "a folder": ("records.csv", lambda path: path.mkdir(), ("is a folder",)),
    "a workbook": ("records.xlsx", lambda path: path.write_bytes(b"PK\x03\x04"), ("is no workbook", "as .xlsx")),
    "a workbook by another name": ("records.csv", lambda path: path.write_bytes(b"PK\x03\x04"), ("workbook",)),
    "half a parquet": ("records.parquet", lambda path: half_of(parquet(path)), ("cannot be read as parquet",)),
    "a parquet of text": ("records.parquet", lambda path: path.write_bytes(text_of(small())), ("parquet",)),
    "another table": ("records.parquet", lambda path: parquet(path, ["force_kN"]), ("missing column record",)),
    "no suffix": ("records", lambda path: path.write_bytes(text_of(small())), ("no suffix", ".mat or .tdx")),
}

#: What is no finished result: which commands read it, how it is spoilt, and what the line on stderr must name.
NO_RESULTS: dict[str, tuple[tuple[str, ...], Callable[[Path], object], tuple[str, ...]]] = {
    "missing": (tuple(ON_RESULTS), shutil.rmtree, ("run.json",)),
    "a file": (tuple(ON_RESULTS), lambda folder: (shutil.rmtree(folder), folder.touch()), ("run.json",)),
    "an empty folder": (tuple(ON_RESULTS), lambda folder: (shutil.rmtree(folder), folder.mkdir()), ("run.json",)),
    "no run.json": (tuple(ON_RESULTS), lambda folder: (folder / "run.json").unlink(), ("run.json",)),
    "half a run.json": (("show",), lambda folder: half_of(folder / "run.json"), ("run.json", "run fit again")),
    "a binary run.json": (("show",), lambda folder: (folder / "run.json").write_bytes(b"\xff\0"), ("run.json",)),
    "a deep run.json": (("show",), lambda folder: (folder / "run.json").write_text("[" * 100_000), ("run.json",)),
    "another run.json": (("show",), lambda folder: (folder / "run.json").write_text("[1]"), ("run.json",)),
    "no summary": (("show",), lambda folder: (folder / "summary.csv").unlink(), ("summary.csv", "no such file")),
    "half a summary": (("show",), lambda folder: half_of(folder / "summary.csv", 0.02), ("summary.csv",)),
    "another summary": (
        ("show",),
        lambda folder: (folder / "summary.csv").write_text("mean,sd\n1,2\n"),
        ("summary.csv", "not what fit writes"),
    ),
    "no posterior": (("predict",), lambda folder: (folder / "posterior.nc").unlink(), ("posterior.nc", "no such file")),
    "half a posterior": (("predict",), lambda folder: half_of(folder / "posterior.nc"), ("posterior.nc", "netCDF")),
    "a binary posterior": (
        ("predict",),
        lambda folder: (folder / "posterior.nc").write_bytes(BINARY),
        ("posterior.nc", "cannot be read as netCDF", "run fit again"),
    ),
    "no diagnostics": (("predict",), lambda folder: (folder / "diagnostics.json").unlink(), ("diagnostics.json",)),
    "half the diagnostics": (("predict",), lambda folder: half_of(folder / "diagnostics.json"), ("diagnostics.json",)),
}


def parquet(path: Path, columns: list[str] | None = None) -> Path:
    return write_table(small()[columns or list(small())], path)


def half_of(path: Path, share: float = 0.5) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])


@pytest.fixture(scope="module")
def a_result(tmp_path_factory) -> Path:
    return write_result(tmp_path_factory.mktemp("results") / "fit")


@pytest.mark.parametrize("command", ON_TABLES)
@pytest.mark.parametrize("what", NO_TABLES)
def test_what_is_no_table_on_disk_is_refused(what, command, tmp_path):
    name, make, said = NO_TABLES[what]
    make(tmp_path / name)
    before = tree_of(tmp_path)
    done = here(command, tmp_path / name, "--out", tmp_path / "out", *ON_TABLES[command])
    assert_refused(done.exit_code, done.stderr, str(tmp_path / name), *said)
    assert done.stdout == ""
    assert tree_of(tmp_path) == before


@pytest.mark.parametrize(
    ("what", "command"), [(what, command) for what, (commands, *_) in NO_RESULTS.items() for command in commands]
)
def test_what_is_no_result_is_refused(what, command, a_result, tmp_path):
    _, spoil, said = NO_RESULTS[what]
    folder = tmp_path / "fit"
    shutil.copytree(a_result, folder)
    spoil(folder)
    before = tree_of(tmp_path)
    done = here(command, folder, *ON_RESULTS[command])
    assert_refused(done.exit_code, done.stderr, str(folder), *said)
    assert done.stdout == ""
    assert tree_of(tmp_path) == before


def test_the_installed_command_refuses_what_is_no_table(tmp_path):
    name, make, said = NO_TABLES["binary"]
    make(tmp_path / name)
    before = tree_of(tmp_path)
    done = installed("fit", name, "--out", "out", cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, *said)
    assert done.stdout == ""
    assert tree_of(tmp_path) == before


def test_the_installed_command_refuses_what_is_no_result(a_result, tmp_path):
    _, spoil, said = NO_RESULTS["half a posterior"]
    shutil.copytree(a_result, tmp_path / "result")
    spoil(tmp_path / "result")
    before = tree_of(tmp_path)
    done = installed("predict", "result", *ON_RESULTS["predict"], cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, "result", *said)
    assert done.stdout == ""
    assert tree_of(tmp_path) == before


@permissions
@pytest.mark.parametrize("command", ON_TABLES)
def test_a_table_without_the_permission_to_read_is_refused(command, tmp_path):
    path = tmp_path / "records.csv"
    path.write_bytes(text_of(small()))
    path.chmod(0)
    done = here(command, path, "--out", tmp_path / "out", *ON_TABLES[command])
    assert_refused(done.exit_code, done.stderr, str(path), "may not be read")


def test_a_result_that_came_through_a_spreadsheet_is_shown_all_the_same(a_result, tmp_path):
    shutil.copytree(a_result, tmp_path / "fit")
    table = pd.read_csv(a_result / "summary.csv")
    table.to_csv(tmp_path / "fit" / "summary.csv", index=False, sep=";", decimal=",", encoding="utf-8-sig")
    assert json.loads((tmp_path / "fit" / "run.json").read_text())["origin"] == "simulated"
    shown, as_written = here("show", tmp_path / "fit"), here("show", a_result)
    assert (shown.exit_code, shown.stderr) == (0, "")
    # The last two lines name the folder.
    assert shown.stdout.splitlines()[:-2] == as_written.stdout.splitlines()[:-2]
