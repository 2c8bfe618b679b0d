"""The commands as a user meets them: exit codes, one line for each fault, files whole or not at all."""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import jax
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hand_made_posteriors import posterior, scattered
from simulated_records import Plan, simulate
from typer.testing import CliRunner, Result

from bayes_tyre import workflow
from bayes_tyre.cli import app
from bayes_tyre.embedded import data_path
from bayes_tyre.record import record_words
from bayes_tyre.report import folder as result_folder

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

COMMAND = Path(sys.executable).parent / "bayes-tyre"
COMMANDS = ("published", "campaign", "lsq", "fit", "show")
WORDS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN", "repeat"]
FIT_FILES = {
    *("posterior.nc", "summary.csv", "cases.csv", "contrasts.csv", "repeats.csv", "diagnostics.json", "run.json"),
    *("figures/posteriors_by_direction.png", "figures/forest_of_cases.png"),
    *("figures/records_with_bands.png", "figures/outlier_probabilities.png"),
}
TABLES = ("summary.csv", "cases.csv", "contrasts.csv", "repeats.csv")
SMALL = Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), repeats=3, points=30)


def environment() -> dict[str, str]:
    """Return what a user's shell would hand on: without what conftest sets for tests in this process."""
    return {name: value for name, value in os.environ.items() if name not in ("XLA_FLAGS", "JAX_ENABLE_X64")}


def start(*arguments: object, cwd: Path) -> subprocess.Popen[str]:
    command = [str(COMMAND), *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=cwd, env=environment(), text=True, stdout=pipe, stderr=pipe)


def finish(process: subprocess.Popen[str]) -> subprocess.CompletedProcess[str]:
    try:
        out, err = process.communicate(timeout=400)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def installed(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the installed command."""
    return finish(start(*arguments, cwd=cwd))


def here(*arguments: object) -> Result:
    """Run the command in this process; JAX has started, so its devices stay those of the tests."""
    jax.devices()
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def tree_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()} | {
        f"{path.relative_to(folder)}/": b"" for path in folder.rglob("*") if path.is_dir()
    }


def assert_refused(code: int, stderr: str, *said: str) -> None:
    """Assert exit code 3 and one line on stderr that names all of `said` and ends with what to do."""
    assert code == 3, stderr
    assert stderr.startswith("bayes-tyre: ")
    assert stderr.count("\n") == 1
    assert stderr.endswith("\n")
    assert ";" in stderr
    for word in said:
        assert word in stderr


def small(seed: int = 1) -> pd.DataFrame:
    return simulate(SMALL, seed)[0]


def written(table: pd.DataFrame, path: Path) -> Path:
    table.to_csv(path, index=False)
    return path


def with_cell(row: int, column: str, cell: str | float) -> pd.DataFrame:
    """Return the small table with one cell replaced; rows count from 1 below the header."""
    table = small().astype({column: object})
    table.loc[row - 1, column] = cell
    return table


def text_of(table: pd.DataFrame) -> bytes:
    return table.to_csv(index=False).encode()


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


def test_help_names_units_and_an_example_and_waits_for_no_library(tmp_path):
    asked = [["--help"], *([command, "--help"] for command in COMMANDS)]
    script = f"""
import contextlib, io, json, sys
from bayes_tyre.cli import app
said = []
for arguments in {asked!r}:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            app(arguments, prog_name="bayes-tyre")
        except SystemExit as end:
            assert not end.code
    said.append(out.getvalue())
print(json.dumps([said, [name for name in ("jax", "numpyro", "pandas", "matplotlib") if name in sys.modules]]))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True
    )
    said, imported = json.loads(done.stdout)
    assert imported == []
    for command in COMMANDS:
        assert f"\n  {command} " in said[0]
    for command, text in zip(COMMANDS, said[1:], strict=True):
        assert f"Example: bayes-tyre {command} " in text
        assert any(unit in " ".join(text.split()) for unit in ("kN/mm", "(mm, kN)", "(kN, mm)"))


def test_the_installed_command_helps(tmp_path):
    running = {one: start(one, cwd=tmp_path) for one in ("--help", "--version")}
    done = {one: finish(process) for one, process in running.items()}
    assert all(one.returncode == 0 and one.stderr == "" for one in done.values())
    assert "Usage: bayes-tyre" in done["--help"].stdout
    assert done["--version"].stdout == f"{version('bayes-tyre')}\n"


def test_lsq_needs_only_the_required_columns_and_one_bad_record_stops_no_other(tmp_path):
    table, truth = simulate(
        Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=200), 2
    )
    required = table[["record", "displacement_mm", "force_kN"]]
    names = truth["record"].tolist()
    few = required[required["record"] == names[0]].head(3).assign(record="short")
    still = required[required["record"] == names[0]].assign(record="still", displacement_mm=5.0)
    written(pd.concat([few, required, still]), tmp_path / "records.csv")
    done = installed("lsq", "records.csv", "--out", "made/here", "--free", "F_i", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.splitlines()[-1] == "5 records, 2 not ok"
    assert str(Path("made/here/least_squares.csv")) in done.stdout
    assert {name for name in tree_of(tmp_path / "made") if not name.endswith("/")} == {"here/least_squares.csv"}
    fits = pd.read_csv(tmp_path / "made/here/least_squares.csv", keep_default_na=False, dtype=str)
    parameters = ("k_kN_per_mm", "C_kN", "beta_mm", "d_i_mm", "F_i_kN")
    numbers = [name for parameter in parameters for name in (parameter, f"{parameter}_se")]
    assert list(fits.columns) == ["record", *WORDS, *numbers, "rmse_kN", "points", "status", "origin"]
    assert (fits[WORDS] == "").all(axis=None)
    assert fits["record"].tolist() == ["short", *names, "still"]
    status = dict(zip(fits["record"], fits["status"], strict=True))
    assert "too few points" in status["short"]
    assert "no travel" in status["still"]
    assert fits.set_index("record").loc[["short", "still"], numbers].isin([""]).all(axis=None)
    good = fits[fits["record"].isin(names)]
    assert (good["status"] == "ok").all()
    assert (good["d_i_mm_se"] == "").all()
    assert (good["points"] == "200").all()
    distance = good["k_kN_per_mm"].astype(float).to_numpy() - truth["k"].to_numpy()
    assert (np.abs(distance) < 5 * good["k_kN_per_mm_se"].astype(float).to_numpy()).all()


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [("force_kN", 1000.0, "divide by 1000"), ("displacement_mm", 0.001, "multiply by 1000")],
)
def test_lsq_warns_of_newtons_and_metres_and_goes_on_while_fit_refuses(column, factor, said, tmp_path):
    table = small()
    table[column] *= factor
    path = written(table, tmp_path / "records.csv")
    before = tree_of(tmp_path)
    refused = here("fit", path, "--out", tmp_path / "fit")
    assert_refused(refused.exit_code, refused.stderr, str(path), column, said, "--units-checked")
    assert tree_of(tmp_path) == before
    warned = here("lsq", path, "--out", tmp_path / "lsq")
    assert warned.exit_code == 0
    assert warned.stderr.startswith("bayes-tyre: warning: ")
    assert warned.stderr.count("\n") == 1
    assert column in warned.stderr
    assert said in warned.stderr
    assert (tmp_path / "lsq" / "least_squares.csv").is_file()
    quiet = here("lsq", path, "--out", tmp_path / "lsq", "--quiet")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (0, "", warned.stderr)


@pytest.mark.slow
def test_a_certified_data_set_comes_back_to_eight_digits(tmp_path):
    """NIST StRD Misra1a, b1 (1 - exp(-b2 x)): Equation 2 without stiffness; from NIST's far start."""
    x = (77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0)
    y = (10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78)
    b1, b1_sd, b2, b2_sd, rest = 2.3894212918e02, 2.7070075241e00, 5.5015643181e-04, 7.2668688436e-06, 1.0187876330e-01
    written(pd.DataFrame({"record": "Misra1a", "displacement_mm": x, "force_kN": y}), tmp_path / "misra1a.csv")
    fixed = [text for name in ("k", "F_i", "d_i") for text in ("--fix", f"{name}=0")]
    far = ["--start", "C=500", "--start", "beta=10000"]
    done = installed("lsq", "misra1a.csv", "--out", ".", *fixed, *far, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "1 records, 0 not ok"
    row = pd.read_csv(tmp_path / "least_squares.csv").iloc[0]
    assert row["C_kN"] == pytest.approx(b1, rel=1e-8)
    assert row["beta_mm"] == pytest.approx(1 / b2, rel=1e-8)
    assert row["C_kN_se"] == pytest.approx(b1_sd, rel=1e-8)
    assert row["beta_mm_se"] == pytest.approx(b2_sd / b2**2, rel=1e-8)
    assert row["rmse_kN"] == pytest.approx(rest * np.sqrt(12 / 14), rel=1e-8)
    assert row[["k_kN_per_mm_se", "d_i_mm_se", "F_i_kN_se"]].isna().all()


def test_the_campaign_is_the_same_file_each_time_and_the_one_that_ships(tmp_path):
    done = installed("campaign", "--out", "one/records.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("reconstructed, not measured") == 2
    assert here("campaign", "--out", tmp_path / "two" / "records.csv").exit_code == 0
    for name in ("records.csv", "records_truth.csv"):
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert one == two == data_path(f"campaign/{name}").read_bytes()
    assert len(tree_of(tmp_path)) == 6


@pytest.mark.slow
def test_the_published_numbers_are_counted_apart_by_kind(tmp_path):
    done = installed("published", "--out", "checked", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    check = pd.read_csv(tmp_path / "checked" / "published_check.csv")
    assert list(check.columns) == ["quantity", "source", "kind", "published", "recomputed", "tolerance", "agrees"]
    counts = check["kind"].value_counts()
    assert set(counts.index) == {"recomputed", "round trip", "erratum"}
    for kind, count in counts.items():
        assert f"  {kind}: {count} of {count} agree\n" in done.stdout
    assert {"checked/", "checked/published_check.csv"} == set(tree_of(tmp_path))


def put_draws_for_the_sampler(monkeypatch, columns: list[str] | None = None) -> pd.DataFrame:
    """Put well-mixed draws about the truth in place of the sampler; give the records they belong to."""
    table, truth = simulate(Plan(configurations=("dual", "single"), speeds=(0.0,), loads=(20.0,), points=60), 3)
    table = table[columns] if columns else table
    words = record_words(table)
    draws = scattered(words, seed=4)
    for name in ("k", "beta", "J", "F_i", "sigma"):
        scatter = np.exp(0.001 * np.random.default_rng(5).normal(size=draws[name].shape))
        draws[name] = truth[name].to_numpy() * scatter
    monkeypatch.setattr(workflow, "fit_hierarchical", lambda *_: posterior(draws, words))
    return table


@pytest.fixture
def sampled(monkeypatch) -> pd.DataFrame:
    return put_draws_for_the_sampler(monkeypatch)


def test_fit_ends_with_0_and_says_pass_everywhere_when_it_may_be_trusted(sampled, tmp_path):
    path = written(sampled, tmp_path / "records.csv")
    done = here("fit", path, "--out", tmp_path / "out", "--interval", "0.8")
    assert (done.exit_code, done.stderr) == (0, "")
    assert {name for name in tree_of(tmp_path / "out") if not name.endswith("/")} == FIT_FILES
    for name in TABLES:
        table = pd.read_csv(tmp_path / "out" / name)
        assert set(table["verdict"]) == {"pass"}
        assert set(table["interval"]) == {0.8}
    diagnostics = json.loads((tmp_path / "out" / "diagnostics.json").read_text(encoding="utf-8"))
    assert (diagnostics["verdict"], diagnostics["reasons"]) == ("pass", [])
    assert "verdict pass" in done.stdout
    shown = here("show", tmp_path / "out")
    assert shown.exit_code == 0
    assert "80 % interval" in shown.stdout


def test_a_table_without_words_is_fitted_and_shown(tmp_path, monkeypatch):
    required = put_draws_for_the_sampler(monkeypatch, ["record", "displacement_mm", "force_kN"])
    path = written(required, tmp_path / "records.csv")
    done = here("fit", path, "--out", tmp_path / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    assert {name for name in tree_of(tmp_path / "out") if not name.endswith("/")} == FIT_FILES
    assert pd.read_csv(tmp_path / "out" / "contrasts.csv").empty
    assert len(pd.read_csv(tmp_path / "out" / "cases.csv")) == 2
    shown = here("show", tmp_path / "out")
    assert shown.exit_code == 0
    assert "k, kN/mm" in shown.stdout


def test_fit_that_fails_half_way_leaves_no_run_json_to_vouch_for_it(sampled, tmp_path, monkeypatch):
    path = written(sampled, tmp_path / "records.csv")
    monkeypatch.setattr(result_folder, "_write_figures", lambda *_: None)
    assert here("fit", path, "--out", tmp_path / "out").exit_code == 0
    assert (tmp_path / "out" / "run.json").is_file()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "figure.png")

    monkeypatch.setattr(result_folder, "_write_figures", full)
    done = here("fit", path, "--out", tmp_path / "out", "--quiet")
    assert_refused(done.exit_code, done.stderr, "figure.png", "No space left on device")
    assert not (tmp_path / "out" / "run.json").exists()
    assert not [name for name in tree_of(tmp_path / "out") if Path(name).name.startswith(".")]
    assert here("show", tmp_path / "out").exit_code == 3


def test_units_that_were_checked_are_fitted(sampled, tmp_path, monkeypatch):
    monkeypatch.setattr(result_folder, "_write_figures", lambda *_: None)
    path = written(sampled.assign(force_kN=sampled["force_kN"] * 1000), tmp_path / "records.csv")
    done = here("fit", path, "--out", tmp_path / "out", "--units-checked", "--quiet")
    assert done.exit_code in (0, 4)
    assert (tmp_path / "out" / "run.json").is_file()


@pytest.mark.parametrize(
    ("run_json", "said"),
    [(None, "holds no run.json"), ("{", "run.json"), ("[]", "run.json"), ('{"origin": "x"}', "summary.csv")],
)
def test_show_refuses_a_folder_without_a_result(run_json, said, tmp_path):
    if run_json is not None:
        (tmp_path / "run.json").write_text(run_json, encoding="utf-8")
    done = here("show", tmp_path)
    assert_refused(done.exit_code, done.stderr, str(tmp_path), said)
    assert done.stdout == ""


@pytest.fixture(scope="module")
def fits(tmp_path_factory) -> tuple[Path, list[subprocess.CompletedProcess[str]]]:
    """Run the installed `fit` twice side by side, same seed, far too few draws; give the folder and both ends."""
    folder = tmp_path_factory.mktemp("two fits")
    table, _ = simulate(Plan(speeds=(0.0,), loads=(20.0,), points=40), 1)
    written(table, folder / "the records.csv")
    few = ["--chains", 2, "--warmup", 60, "--draws", 60, "--seed", 7]
    running = [start("fit", "the records.csv", "--out", name, *few, cwd=folder) for name in ("one", "two")]
    return folder, [finish(process) for process in running]


@pytest.mark.slow
def test_too_few_draws_end_with_4_and_every_file_says_so(fits):
    folder, ends = fits
    for done in ends:
        assert done.returncode == 4, done.stderr
        assert "verdict fail" in done.stdout
    assert {name for name in tree_of(folder / "one") if not name.endswith("/")} == FIT_FILES
    for name in TABLES:
        table = pd.read_csv(folder / "one" / name)
        assert table.columns[-1] == "verdict"
        assert set(table["verdict"]) == {"fail"}
        assert set(table["origin"]) == {"simulated"}
    diagnostics = json.loads((folder / "one" / "diagnostics.json").read_text(encoding="utf-8"))
    assert diagnostics["verdict"] == "fail"
    assert (diagnostics["chains"], diagnostics["draws"]) == (2, 60)
    assert any("ESS" in reason for reason in diagnostics["reasons"])
    assert ends[0].stderr == "".join(f"bayes-tyre: {reason}\n" for reason in diagnostics["reasons"])


@pytest.mark.slow
def test_a_run_tells_how_it_was_made(fits):
    folder, _ = fits
    run = json.loads((folder / "one" / "run.json").read_text(encoding="utf-8"))
    few = "--chains 2 --warmup 60 --draws 60 --seed 7"
    assert run["command"] == f"bayes-tyre fit 'the records.csv' --out one {few}"
    assert run["options"] == {"chains": 2, "warmup": 60, "draws": 60, "interval": 0.95}
    assert run["seed"] == 7
    digest = hashlib.sha256((folder / "the records.csv").read_bytes()).hexdigest()
    assert run["inputs"] == {"the records.csv": digest}
    for library in ("bayes-tyre", "jax", "numpyro", "arviz", "numpy"):
        assert run["versions"][library] == version(library)
    assert run["versions"]["python"] == ".".join(map(str, sys.version_info[:3]))
    assert run["wall_time_s"] > 1
    others = [path for path in (folder / "one").rglob("*") if path.is_file() and path.name != "run.json"]
    assert all(path.stat().st_mtime_ns <= (folder / "one" / "run.json").stat().st_mtime_ns for path in others)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_tables_byte_for_byte(fits):
    folder, _ = fits
    for name in (*TABLES, "diagnostics.json"):
        assert (folder / "one" / name).read_bytes() == (folder / "two" / name).read_bytes()


@pytest.mark.slow
def test_the_posterior_on_disk_has_names_labels_and_units(fits):
    folder, _ = fits
    with xr.open_datatree(folder / "one" / "posterior.nc", engine="h5netcdf") as tree:
        posterior_of = tree["posterior"].to_dataset()
        assert posterior_of["k"].dims == ("chain", "draw", "record")
        assert posterior_of["k_case"].dims == ("chain", "draw", "case")
        assert posterior_of["k"].attrs["units"] == "kN/mm"
        assert posterior_of["beta_case"].attrs["units"] == "mm"
        assert all("units" in draws.attrs for draws in posterior_of.data_vars.values())
        assert set(posterior_of["record"].to_numpy()) == set(pd.read_csv(folder / "one" / "repeats.csv")["record"])
        assert tree["sample_stats"]["diverging"].shape == (2, 60)
        assert tree.attrs["origin"] == "simulated"


@pytest.mark.slow
def test_figures_are_pictures(fits):
    folder, _ = fits
    for path in (folder / "one" / "figures").iterdir():
        assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_show_prints_the_table_of_a_result_and_what_it_rests_on(fits):
    folder, _ = fits
    done = installed("show", "one", "two", cwd=folder)
    assert done.returncode == 0, done.stderr
    means = pd.read_csv(folder / "one" / "summary.csv").query("parameter in ('k_mean', 'beta_mean')")
    assert len(means) == 8
    for median in means["median"]:
        assert done.stdout.count(f"{median:.4g} ") == 2
    for word in ("single", "dual", "k, kN/mm", "beta, mm", "not measured", "verdict: fail", "95 % interval"):
        assert done.stdout.count(word) >= 2
    assert done.stdout.count("files: one\n") == done.stdout.count("files: two\n") == 1
