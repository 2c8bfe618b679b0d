"""Disks that fill and folders that cannot be written to: one line, exit code 3, nothing half-written left."""

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers import slow_tests
from helpers.audit_made_up import audited, blind
from helpers.command_line import (
    COMMAND,
    COMMANDS,
    ON_RESULTS,
    ON_TABLES,
    assert_refused,
    environment,
    files_of,
    finish,
    here,
    installed,
    small,
    start,
    start_as,
    tree_of,
    written,
)
from helpers.coverage_studies import estimated
from helpers.law_rankings import ranked
from helpers.left_out import made_up
from helpers.motion_studies import motion_rows
from helpers.permissions import permissions
from helpers.quick_fits import once, put_draws_for_the_sampler, write_result
from helpers.quick_motions import put_draws_for_the_motions

from bayes_tyre.embedded import data_path
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import LeaveOneOut
from bayes_tyre.report.figures import audit as audit_figures
from bayes_tyre.report.figures import catalogue
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.plan import PLANS
from bayes_tyre.studies.coverage import CoverageFit
from bayes_tyre.studies.motion_study import MotionFit
from bayes_tyre.workflow import fit, least_squares, load_deflection, loops, modes, published, studies
from bayes_tyre.workflow.from_results import compare
from bayes_tyre.workflow.raw import motion as raw_motion
from bayes_tyre.workflow.raw.simulate import write_simulated

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


def of_a_table(command: str) -> Callable[[Path, Path], list[object]]:
    return lambda given, out: [command, given / "records.csv", "--out", out, *ON_TABLES[command]]


#: How each command is told to write into a folder, from what `given` holds; a further command is one more row.
WRITERS: dict[str, Callable[[Path, Path], list[object]]] = {
    "lsq": of_a_table("lsq"),
    "lsq --loops": lambda given, out: ["lsq", given / "records.csv", "--loops", "--out", out],
    "load-deflection": lambda given, out: ["load-deflection", given / "slow.csv", "--out", out],
    "modes": lambda given, out: ["modes", given / "modes.csv", "--out", out],
    "fit": of_a_table("fit"),
    "published": lambda given, out: ["published", "--out", out],
    "campaign": lambda given, out: ["campaign", "--out", out / "campaign.csv"],
    "compare": lambda given, out: ["compare", given / "fit", given / "other", "--out", out],
    "predict": lambda given, out: ["predict", given / "fit", "--case", "direction=unloading", "--out", out],
    "export": lambda given, out: ["export", given / "fit", "--to", "tir", "--out", out],
    "next": lambda given, out: ["next", given / "fit", *ON_RESULTS["next"][:-1], out],
    "report": lambda given, out: ["report", given / "fit", "--out", out / "report.html"],
    "inspect": lambda given, out: ["inspect", data_path("sample/appendix_b1.lvm"), "--out", out / "channels.csv"],
    "calibrate": lambda given, out: ["calibrate", data_path("sample/appendix_b1.lvm"), "--out", out / "lines.toml"],
    "columns": lambda given, out: ["columns", given / "records.csv", "--out", out / "map.toml"],
    "process": lambda given, out: ["process", given / "raw", "--out", out / "records.csv", "--workers", "1"],
    "motion": lambda given, out: ["motion", given / "raw", "--out", out, "--workers", "1"],
    "simulate": lambda given, out: ["simulate", "--out", out, "--rate", "1000"],
    "audit": lambda given, out: ["audit", "--out", out],
    "study motion": lambda given, out: ["study", "motion", "--out", out, "--stationary", "1", "--rolling", "0"],
    "study coverage": lambda given, out: ["study", "coverage", "--out", out, "--kinds", "clean", "--sets", "2"],
    "study laws": lambda given, out: ["study", "laws", "--out", out, "--law", "fancher", "--records", "2"],
}
RIGS = {name: load_rig(name) for name in ("single", "dual")}
SILENT = ("show",)
#: Made-up draws are not those of the records: what is said of them is not to be trusted.
NOT_TRUSTED = ("fit", "compare", "predict", "next", "export", "report")


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> Path:
    """Return a folder with a record table, one of slow tests, one of modes, what `fit` wrote, and two raw files."""
    folder = tmp_path_factory.mktemp("given")
    written(small(), folder / "records.csv")
    written(slow_tests.campaign(repeats=2), folder / "slow.csv")
    written(pd.DataFrame({"mode": [1, 2], "frequency_Hz": [60.0, 88.0]}), folder / "modes.csv")
    for name in ("fit", "other"):
        write_result(folder / name)
    write_simulated(PLANS["quick"](2000.0)[:2], RIGS, 0, folder / "raw", lambda _: None)
    (folder / "raw" / "truth.csv").unlink()
    return folder


@pytest.fixture
def quick(monkeypatch) -> None:
    """Put quick stand-ins where commands compute for long; what they write passes the same code."""
    check = pd.DataFrame({"quantity": ["k"], "kind": ["recomputed"], "agrees": [True]})
    put_draws_for_the_sampler(monkeypatch)
    put_draws_for_the_motions(monkeypatch)
    for module, work in (
        *((module, "judge") for module in (fit, raw_motion)),
        *((load_deflection, work) for work in ("_tests", "_cases", "law_loop")),
        (modes, "fit_ring"),
        *((published.campaign, "reconstruct"), (least_squares, "fit_records"), (loops, "fit_records")),
    ):
        monkeypatch.setattr(module, work, once(getattr(module, work)))
    monkeypatch.setattr(compare, "leave_one_record_out", partial(left_out, "record"))
    monkeypatch.setattr(compare, "leave_one_case_out", partial(left_out, "case"))
    monkeypatch.setattr(published, "fit_records", lambda *_: None)
    monkeypatch.setattr(published.campaign, "case_means", lambda _: None)
    monkeypatch.setattr(published.checks, "published_check", lambda _: check)
    every_figure, every_audit_figure = catalogue.drawings, audit_figures.draw
    monkeypatch.setattr(catalogue, "drawings", lambda *of: islice(every_figure(*of), 2))
    monkeypatch.setattr(studies, "study_audit", lambda *_: audited(blind, replicates=1))
    monkeypatch.setattr(MotionFit, "rows", lambda _, record: motion_rows([record]))
    monkeypatch.setattr(CoverageFit, "estimate", estimated)
    monkeypatch.setattr(studies, "rank_laws", lambda true_laws, **_: ranked(true_laws))
    monkeypatch.setattr(audit_figures, "draw", lambda *of: islice(every_audit_figure(*of), 1))
    whole_plan = PLANS["quick"]
    monkeypatch.setitem(PLANS, "quick", lambda rate: whole_plan(rate)[:2])


def left_out(unit: str, tree: xr.DataTree, *_: object) -> LeaveOneOut:
    """Return a made-up leave-one-out of each record, or case, of a posterior."""
    units = tree["posterior"][unit].to_numpy()
    return made_up(np.random.default_rng(0).normal(50.0, 1.0, len(units)), list(units))


def fill_the_disk_after(files: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let so many files be finished, and refuse the next as a full disk does; give the names of those finished."""
    finish_file, finished = Path.replace, []

    def replace(self: Path, target: Path) -> Path:
        if len(finished) == files:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))
        finished.append(Path(target).name)
        return finish_file(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    return finished


def test_every_command_that_writes_stands_in_the_table():
    commands = {name.split(" --")[0] for name in WRITERS if not name.startswith("study ")}
    assert commands | set(SILENT) == set(COMMANDS)


@pytest.mark.parametrize("command", WRITERS)
def test_a_disk_that_fills_is_told_in_one_line_and_nothing_half_written_is_left(command, given, quick, tmp_path):
    with pytest.MonkeyPatch.context() as whole_run:
        names = fill_the_disk_after(1000, whole_run)
        assert here(*WRITERS[command](given, tmp_path / "whole")).exit_code == (4 if command in NOT_TRUSTED else 0)
    before = tree_of(given)
    for files in {0, len(names) - 1}:  # the first cannot be written; the last, which vouches for the others
        out = tmp_path / f"after {files}"
        with pytest.MonkeyPatch.context() as filling:
            finished = fill_the_disk_after(files, filling)
            done = here(*WRITERS[command](given, out), "--quiet")
        assert_refused(done.exit_code, done.stderr, str(out), os.strerror(errno.ENOSPC), "check the path and the disk")
        left = {Path(name).name for name in files_of(out)} if out.exists() else set()
        assert left <= set(finished)
        assert not [name for name in left if name.startswith(".")]
        assert "run.json" not in left
        assert tree_of(given) == before


def test_the_installed_lsq_ends_in_one_line_where_the_disk_takes_no_more(given, tmp_path):
    env = {name: value for name, value in environment().items() if name != "JAX_COMPILATION_CACHE_DIR"}
    command = [str(COMMAND), *map(str, WRITERS["lsq"](given, tmp_path / "out"))]
    done = finish(start_as(command, tmp_path, env, most_bytes=500))
    assert_refused(done.returncode, done.stderr, "least_squares.csv", os.strerror(errno.EFBIG))
    assert done.stdout == ""
    assert tree_of(tmp_path) == {"out/": b""}


@pytest.mark.parametrize("command", ["campaign", "predict"])
def test_other_installed_commands_end_in_one_line_where_the_disk_takes_no_more(command, given, tmp_path):
    arguments = [str(COMMAND), *map(str, WRITERS[command](given, tmp_path / "out"))]
    before = tree_of(given)
    done = finish(start_as(arguments, tmp_path, most_bytes=100))
    assert_refused(done.returncode, done.stderr, str(tmp_path / "out"), os.strerror(errno.EFBIG))
    assert files_of(tmp_path) == set()
    assert tree_of(given) == before


@pytest.mark.parametrize("most_bytes", [1_000, 40_000])
def test_fit_ends_in_one_line_where_the_disk_takes_no_more_and_no_library_crashes(most_bytes, given, tmp_path):
    script = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from helpers.quick_fits import drawn
from bayes_tyre.cli import app
from bayes_tyre.embedded import data_path
from bayes_tyre.report import figures
from bayes_tyre.simulate.plan import PLANS
from bayes_tyre.workflow import fit
fit.fit_hierarchical = drawn
app(prog_name="bayes-tyre")
"""
    env = {name: value for name, value in environment().items() if name != "JAX_COMPILATION_CACHE_DIR"}
    arguments = map(str, WRITERS["fit"](given, tmp_path / "out"))
    command = [sys.executable, "-c", script, str(Path(__file__).parents[1]), *arguments, "--quiet"]
    done = finish(start_as(command, tmp_path, env, most_bytes=most_bytes))
    assert_refused(done.returncode, done.stderr, str(tmp_path / "out"), os.strerror(errno.EFBIG))
    left = [Path(name).name for name in tree_of(tmp_path)]
    assert "run.json" not in left
    assert not [name for name in left if name.startswith(".")]


@pytest.mark.parametrize("command", WRITERS)
@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no /proc: not Linux")
def test_a_place_where_nobody_may_write_is_refused_before_the_work(command, given, quick, monkeypatch, tmp_path):
    for module, work in ((fit, "fit_hierarchical"), (least_squares, "fit_records"), (published, "fit_records")):
        monkeypatch.setattr(module, work, lambda *_: pytest.fail("worked first"))
    done = here(*WRITERS[command](given, Path("/proc/x")))
    assert_refused(done.exit_code, done.stderr, "/proc/x")


@permissions
@pytest.mark.parametrize("command", WRITERS)
def test_a_folder_without_the_permission_to_write_is_refused(command, given, quick, tmp_path):
    tmp_path.chmod(0o500)
    done = here(*WRITERS[command](given, tmp_path / "out"))
    tmp_path.chmod(0o700)
    assert_refused(done.exit_code, done.stderr, str(tmp_path / "out"))
    assert tree_of(tmp_path) == {}


@pytest.mark.parametrize("command", WRITERS)
@pytest.mark.parametrize("below", ["", "below/it"])
def test_a_file_in_the_place_of_a_folder_is_refused_before_the_work(command, below, given, monkeypatch, tmp_path):
    for module, work in ((fit, "fit_hierarchical"), (least_squares, "fit_records"), (published, "fit_records")):
        monkeypatch.setattr(module, work, lambda *_: pytest.fail("worked first"))
    path = tmp_path / "file"
    path.write_text("mine")
    done = here(*WRITERS[command](given, path / below))
    assert_refused(done.exit_code, done.stderr, str(path))
    assert path.read_text() == "mine"
    assert list(tree_of(tmp_path)) == ["file"]


def test_the_installed_commands_refuse_to_write_into_a_file(given, tmp_path):
    files = {name: tmp_path / name for name in ("fit", "predict")}
    for file in files.values():
        file.write_text("mine")
    running = {name: start(*WRITERS[name](given, file), cwd=tmp_path) for name, file in files.items()}
    for name, process in running.items():
        done = finish(process)
        assert_refused(done.returncode, done.stderr, f"--out {files[name]}", "is a file", "name a folder")
    assert tree_of(tmp_path) == {"fit": b"mine", "predict": b"mine"}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full: not Linux")
def test_a_full_disk_behind_stdout_is_told_too(tmp_path):
    with Path("/dev/full").open("w") as full:
        command = [str(COMMAND), "campaign", "--out", str(tmp_path / "records.csv")]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=environment())
    assert_refused(done.returncode, done.stderr, os.strerror(errno.ENOSPC))


def test_a_name_too_long_for_the_disk_is_refused(given, tmp_path):
    done = installed(*WRITERS["lsq"](given, tmp_path / ("x" * 300)), cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, os.strerror(errno.ENAMETOOLONG))
    assert tree_of(tmp_path) == {}
