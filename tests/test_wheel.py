"""The wheel, away from the checkout: it brings its data along and runs in an empty folder."""

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from helpers.command_line import FEW, FIT_FILES, environment, files_of, finish, small, tree_of, written

pytestmark = pytest.mark.slow

CHECKOUT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def installed_wheel(tmp_path_factory) -> Path:
    """Build the wheel and install it into a folder of its own; its dependencies are those of the tests."""
    away = tmp_path_factory.mktemp("wheel")
    build = ["hatchling", "build", "--target", "wheel", "--directory", str(away)]
    subprocess.run([sys.executable, "-m", *build], cwd=CHECKOUT, capture_output=True, check=True)
    (wheel,) = away.glob("*.whl")
    install = ["pip", "install", "--no-deps", "--no-index", "--no-compile", "--target", str(away / "site"), str(wheel)]
    subprocess.run([sys.executable, "-m", *install], cwd=away, capture_output=True, check=True)
    return away / "site"


def start(*command: object, site: Path, cwd: Path) -> subprocess.Popen[str]:
    """Start a command that finds the wheel before the checkout."""
    pipe, surroundings = subprocess.PIPE, environment() | {"PYTHONPATH": str(site)}
    return subprocess.Popen(list(map(str, command)), cwd=cwd, env=surroundings, text=True, stdout=pipe, stderr=pipe)


def test_code_and_data_come_from_the_wheel(installed_wheel, tmp_path):
    script = """
import json, bayes_tyre
from bayes_tyre.embedded import data_path
print(json.dumps([bayes_tyre.__file__, str(data_path("campaign/records.csv"))]))
"""
    done = finish(start(sys.executable, "-c", script, site=installed_wheel, cwd=tmp_path))
    assert done.returncode == 0, done.stderr
    for path in json.loads(done.stdout):
        assert Path(path).is_relative_to(installed_wheel / "bayes_tyre")


def test_the_wheel_holds_all_data_and_everything_that_is_no_module(installed_wheel):
    package = installed_wheel / "bayes_tyre"
    assert tree_of(package / "data") == tree_of(CHECKOUT / "data")
    ours = CHECKOUT / "bayes_tyre"
    beside = {path.relative_to(ours) for path in ours.rglob("*") if path.is_file() and path.suffix != ".pyc"}
    assert {Path("report/figures/page/style.mplstyle"), Path("py.typed")} <= beside
    assert all((package / path).is_file() for path in beside)


def test_the_wheel_runs_the_commands_in_an_empty_folder(installed_wheel, tmp_path):
    written(small(), tmp_path / "records.csv")
    command = installed_wheel / "bin" / "bayes-tyre"
    asked = {
        "published": (command, "published", "--out", "published"),
        "lsq": (sys.executable, "-m", "bayes_tyre", "lsq", "records.csv", "--out", "lsq"),
        "fit": (command, "fit", "records.csv", "--out", "fit", *FEW),
    }
    running = {name: start(*command, site=installed_wheel, cwd=tmp_path) for name, command in asked.items()}
    done = {name: finish(process) for name, process in running.items()}
    for name, code in {"published": 0, "lsq": 0, "fit": 4}.items():  # 4: so few draws are not to be trusted
        assert done[name].returncode == code, done[name].stderr
        assert "Traceback" not in done[name].stderr
    assert pd.read_csv(tmp_path / "published/published_check.csv")["agrees"].all()
    assert pd.read_csv(tmp_path / "lsq/least_squares.csv")["status"].tolist() == ["ok"] * small()["record"].nunique()
    assert files_of(tmp_path / "fit") >= FIT_FILES
    assert {path.name for path in tmp_path.iterdir()} == {"records.csv", "published", "lsq", "fit"}


def test_the_command_in_the_wheel_is_the_one_that_was_built(installed_wheel, tmp_path):
    run = start(installed_wheel / "bin" / "bayes-tyre", "--version", site=installed_wheel, cwd=tmp_path)
    built = [path.name for path in installed_wheel.glob("*.dist-info")]
    assert built == [f"bayes_tyre-{finish(run).stdout.strip()}.dist-info"]
