"""What else reaches stderr: warnings in one line each, nothing unasked, and Ctrl-C."""

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.command_line import COMMAND, LONGEST, environment, finish, small, start, start_as, tree_of, written

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

INTERRUPTED = "bayes-tyre: interrupted; nothing half-written is left, run the command again\n"
#: Puts something into a command's work, then runs the command as the installed one does.
RUN = """
import sys
from bayes_tyre.cli import app
from bayes_tyre.formats.tables import table_files as tables
read = tables.read_table
def disturbed(*given):
    {disturbance}
    return read(*given)
tables.read_table = disturbed
app(prog_name="bayes-tyre")
"""
WARNINGS = """
    import logging, warnings
    import numpy as np
    warnings.warn("two\\nlines \\x1b[31m")
    for i in range(3):
        warnings.warn("said once", RuntimeWarning)
    np.float64(1e308) * np.full(2, 1e10)
    for category in (DeprecationWarning, PendingDeprecationWarning, FutureWarning):
        warnings.warn("about code", category)
    logging.getLogger("jax._src.xla_bridge").warning("a GPU may be present")
    logging.getLogger("matplotlib.font_manager").warning("no font\\nlike %s", "this")
    logging.getLogger("matplotlib").info("chatter")
"""


@pytest.fixture
def records(tmp_path) -> Path:
    return written(small(), tmp_path / "records.csv")


def test_warnings_are_told_once_and_in_one_line_each_and_those_about_code_not_at_all(records, tmp_path):
    command = [sys.executable, "-c", RUN.format(disturbance=WARNINGS), "lsq", str(records), "--out", "out", "--quiet"]
    done = finish(start_as(command, tmp_path))
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.splitlines() == [
        "bayes-tyre: warning: two lines \N{REPLACEMENT CHARACTER}[31m",
        "bayes-tyre: warning: said once",
        "bayes-tyre: warning: overflow encountered in multiply",
        "bayes-tyre: warning: no font like this",
    ]


def test_a_plain_run_prints_nothing_unasked_and_a_quiet_one_nothing(records, tmp_path):
    running = [
        start("lsq", records, "--out", "loud", cwd=tmp_path),
        start("lsq", records, "--out", "quiet", "--quiet", cwd=tmp_path),
    ]
    loud, quiet = (finish(process) for process in running)
    assert (loud.returncode, loud.stderr) == (0, "")
    assert loud.stdout.endswith(f"\nwrote {Path('loud/least_squares.csv')} (data: simulated)\n6 records, 0 not ok\n")
    assert loud.stdout.startswith("\nfits of Equation 2 (data: simulated): 6 rows, 0 not ok\n")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")


def test_who_stops_reading_the_output_gets_no_complaint(tmp_path):
    process = subprocess.Popen(
        [str(COMMAND), "campaign", "--out", str(tmp_path / "records.csv")],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    with process.stderr as stderr:
        assert stderr.read() == ""
    process.wait(timeout=LONGEST)


def interrupted(command: list[str], cwd: Path, ready: Path) -> subprocess.CompletedProcess[str]:
    """Start a process, send Ctrl-C when a file appears; give how it ended."""
    process = start_as(command, cwd)
    until = time.monotonic() + LONGEST
    while not ready.exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    return finish(process)


HANGS = {
    "Python": "while True: pass",
    "a wait": "import time; time.sleep(300)",
    "a compiled loop": "import numpy as np; big = np.ones((4000, 4000)); [big @ big for _ in range(10**6)]",
    "what swallows exceptions": """
    while True:
        try:
            while True: pass
        except BaseException:
            pass""",
}


@pytest.mark.parametrize("where", HANGS)
def test_ctrl_c_ends_a_command_in_one_line_wherever_it_is(where, records, tmp_path):
    before = tree_of(tmp_path)
    disturbance = f"open({str(tmp_path / 'ready')!r}, 'w').close()\n    {HANGS[where].strip()}"
    command = [sys.executable, "-c", RUN.format(disturbance=disturbance), "lsq", str(records), "--out", "out"]
    done = interrupted(command, tmp_path, tmp_path / "ready")
    assert (done.returncode, done.stdout, done.stderr) == (130, "", INTERRUPTED)
    assert tree_of(tmp_path) == before | {"ready": b""}


def test_ctrl_c_while_a_file_is_written_takes_it_back(tmp_path):
    script = """
import sys, time
from pathlib import Path
import pandas as pd
from bayes_tyre.cli import app
def slowly(table, path, **_):
    Path(path).write_text("half")
    Path("ready").touch()
    time.sleep(300)
pd.DataFrame.to_csv = slowly
app(prog_name="bayes-tyre")
"""
    command = [sys.executable, "-c", script, "campaign", "--out", "out/records.csv"]
    done = interrupted(command, tmp_path, tmp_path / "ready")
    assert (done.returncode, done.stdout, done.stderr) == (130, "", INTERRUPTED)
    assert set(tree_of(tmp_path)) == {"ready", "out/"}


def test_ctrl_c_while_the_installed_fit_samples_ends_it(records, tmp_path):
    arguments = ["fit", str(records), "--out", "out", "--draws", "1000000", "--chains", "1"]
    on_the_path = environment() | {"PATH": f"{COMMAND.parent}{os.pathsep}{os.environ['PATH']}"}
    process = start_as([str(COMMAND), *arguments], tmp_path, on_the_path)
    assert process.stdout is not None
    said = process.stdout.readline()
    time.sleep(1)
    process.send_signal(signal.SIGINT)
    done = finish(process)
    call = shlex.join(["bayes-tyre", *arguments, "--resume"])
    assert (done.returncode, done.stderr) == (130, INTERRUPTED.replace("run the command again", f"resume with: {call}"))
    assert said.startswith("fitting 6 records")
    left = {name for name in tree_of(tmp_path) if not name.endswith("/")}
    assert all(name == "records.csv" or name.startswith("out/.checkpoint/chunk-") for name in left)


def test_a_command_whose_shell_ignores_ctrl_c_goes_on(records, tmp_path):
    disturbance = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"
    script = RUN.format(disturbance=disturbance)
    command = ["/bin/sh", "-c", "trap '' INT; exec \"$@\"", "sh", sys.executable, "-c", script]
    done = finish(start_as([*command, "lsq", str(records), "--out", "out", "--quiet"], tmp_path))
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "out" / "least_squares.csv").is_file()
