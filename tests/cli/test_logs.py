"""--verbose and --log-file: stages with their time, all that was printed, and where an error arose."""

import re

import pytest
from typer.testing import CliRunner

from bayes_tyre.cli import app

RECORDS = "record,displacement_mm,force_kN\n" + "".join(f"one,{0.1 * i},{1.0 + 0.2 * i}\n" for i in range(20))


@pytest.fixture
def records(tmp_path):
    path = tmp_path / "records.csv"
    path.write_text(RECORDS)
    return path


def test_verbose_prints_stages_and_the_end_with_their_time(records, tmp_path):
    done = CliRunner().invoke(app, ["lsq", str(records), "--out", str(tmp_path / "out"), "--verbose"])
    assert done.exit_code == 0
    lines = [line for line in done.stderr.splitlines() if re.match(r"bayes-tyre: +\d+\.\d s  ", line)]
    assert lines[0].endswith("least squares")
    assert "ended with code 0" in lines[-1]


def test_without_it_neither_is_printed(records, tmp_path):
    done = CliRunner().invoke(app, ["lsq", str(records), "--out", str(tmp_path / "out")])
    assert "least squares" not in done.stderr
    assert "ended with" not in done.stderr


def test_a_log_file_has_two_runs_with_what_they_printed(records, tmp_path):
    log, command = tmp_path / "log.txt", ["lsq", str(records), "--out", str(tmp_path / "out")]
    for _ in range(2):
        CliRunner().invoke(app, [*command, "--log-file", str(log)])
    text = log.read_text()
    assert text.count("ended with code 0") == text.count("least squares") == 2
    assert "wrote" in text
    assert "fits of Equation 2" in text
    assert "k, kN/mm" in text
    assert all(re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d", line) for line in text.splitlines())


def test_an_error_is_one_line_on_stderr_and_its_origin_in_the_file(tmp_path):
    log = tmp_path / "log.txt"
    missing = [str(tmp_path / "missing.csv"), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, ["lsq", *missing, "--log-file", str(log)])
    assert done.exit_code == 3
    assert len(done.stderr.splitlines()) == 1
    text = log.read_text()
    assert "Traceback" in text
    assert "BadInput" in text
    assert "ended with code 3" in text


def test_a_file_that_cannot_be_written_ends_the_command_before_it_begins(records, tmp_path):
    command = ["lsq", str(records), "--out", str(tmp_path / "out"), "--log-file", str(tmp_path)]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 3
    assert str(tmp_path) in done.stderr
    assert "name a file" in done.stderr
    assert not (tmp_path / "out").exists()
