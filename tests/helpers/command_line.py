"""The command line as tests call it: the installed command in a process of its own, or the app in this one."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from unittest import mock

import jax
import pandas as pd
from helpers.simulated_records import Plan, simulate
from typer.testing import CliRunner, Result

from bayes_tyre.cli import app

COMMAND = Path(sys.executable).parent / "bayes-tyre"
#: s; the longest that a command may take: far beyond what any needs where a machine is several times slower than usual.
LONGEST = 1200
COMMANDS = tuple(
    str(command.callback.__name__).replace("_", "-") for command in app.registered_commands if command.callback
)
#: Commands by what they read, each with the options it cannot do without; a further command is one more row.
ON_TABLES: dict[str, tuple[str, ...]] = {"lsq": (), "fit": ()}
ON_RESULTS: dict[str, tuple[str, ...]] = {
    "show": (),
    "predict": ("--case", "direction=unloading"),
    "next": ("--goal", "k single (0)20-30", "--precision", "2%", "--out", "out"),
    "export": ("--to", "tir", "--out", "never_written"),
    "report": (),
}
FACTORS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN", "repeat"]
#: Drawn where cases match; and where a record can be judged.
CONTRASTS_PNG, OUTLIERS_PNG = "figures/contrasts.png", "figures/outlier_probabilities.png"
FIT_FILES = {
    *("posterior.nc", "summary.csv", "cases.csv", "contrasts.csv", "repeats.csv", "diagnostics.json", "run.json"),
    *("figures/posteriors_by_direction.png", "figures/forest_of_cases.png", CONTRASTS_PNG),
    *("figures/records_with_bands.png", OUTLIERS_PNG),
    *("figures/prior_predictive_curves.png", "figures/residuals_against_displacement.png"),
    *("figures/prior_and_posterior_of_scales.png", "figures/rank_plot.png", "figures/pair_plot.png"),
}
TABLES = ("summary.csv", "cases.csv", "contrasts.csv", "repeats.csv")
#: Far too few draws, the same wherever a fit is only run: the length of the warmup is part of what is compiled. A
#: stated acceptance keeps a run with divergences from being repeated.
FEW = ("--chains", 2, "--warmup", 130, "--draws", 170, "--target-accept", 0.65)
SMALL = Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), repeats=3, points=30)


def environment() -> dict[str, str]:
    """Return what a user's shell would hand on: without what conftest sets for tests in this process.

    But with its settings of the compiler, so that commands share the run's compilation cache.
    """
    return {name: value for name, value in os.environ.items() if name != "JAX_ENABLE_X64"}


def start(*arguments: object, cwd: Path) -> subprocess.Popen[str]:
    return start_as([str(COMMAND), *map(str, arguments)], cwd)


def start_as(
    command: list[str], cwd: Path, env: dict[str, str] | None = None, most_bytes: int | None = None
) -> subprocess.Popen[str]:
    """Start a process; with `most_bytes`, the disk takes no more than that of any file."""
    if most_bytes is not None:
        # Not between fork and exec, where JAX warns of its threads.
        limit = f"import os, resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, ({most_bytes}, {most_bytes}))"
        command = [sys.executable, "-c", f"{limit}; os.execv(sys.argv[1], sys.argv[1:])", *command]
    pipe, env = subprocess.PIPE, env or environment()
    if most_bytes is not None:
        env = {**env, "PYTHONDONTWRITEBYTECODE": "1"}  # it would be torn, and break what imports it next
        if "JAX_COMPILATION_CACHE_DIR" in env:  # entries would be truncated, and other tests read them
            env["JAX_ENABLE_COMPILATION_CACHE"] = "0"
    return subprocess.Popen(command, cwd=cwd, env=env, text=True, stdout=pipe, stderr=pipe)


def finish(process: subprocess.Popen[str]) -> subprocess.CompletedProcess[str]:
    try:
        out, err = process.communicate(timeout=LONGEST)
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
    given = [str(argument) for argument in arguments]
    # What a run.json calls its command; there is no other way to know it.
    with mock.patch.object(sys, "argv", ["bayes-tyre", *given]):
        return CliRunner().invoke(app, given, catch_exceptions=False)


def printed_and_imported(
    commands: Sequence[Sequence[str]], libraries: Sequence[str], cwd: Path
) -> tuple[list[str], list[str]]:
    """Return what each command prints, all run in one fresh process, and which of the libraries that then has."""
    script = """
import contextlib, io, json, sys
from bayes_tyre.cli import app
said = []
for words in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            app(words, prog_name="bayes-tyre")
        except SystemExit as end:
            assert not end.code
    said.append(out.getvalue())
print(json.dumps([said, [name for name in json.loads(sys.argv[2]) if name in sys.modules]]))
"""
    command = [sys.executable, "-c", script, json.dumps(commands), json.dumps(libraries)]
    done = subprocess.run(command, cwd=cwd, env=environment(), capture_output=True, text=True, check=True)
    said, imported = json.loads(done.stdout)
    return said, imported


def tree_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()} | {
        f"{path.relative_to(folder)}/": b"" for path in folder.rglob("*") if path.is_dir()
    }


def files_of(folder: Path) -> set[str]:
    """Return the files below a folder, by their paths in it."""
    return {name for name in tree_of(folder) if not name.endswith("/")}


def assert_refused(code: int, stderr: str, *said: str) -> None:
    """Assert exit code 3 and one line on stderr that names all of `said` and ends with what to do."""
    assert code == 3, stderr
    assert stderr.startswith("bayes-tyre: ")
    assert stderr.endswith("\n")
    assert stderr.removesuffix("\n").isprintable()
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
