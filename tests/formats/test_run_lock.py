"""One run at a time into one --out: the second is refused, and a killed process holds nothing."""

import os
import re
import signal
import subprocess
import sys

import pytest
from helpers.command_line import assert_refused, here, small, tree_of, written

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.run_lock import sole_run

HOLDER = """
import sys, time
from pathlib import Path
from bayes_tyre.formats.run_lock import sole_run
with sole_run(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def holder(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", HOLDER, tmp_path / "out"], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def test_the_second_run_is_refused_and_told_since_when_and_a_killed_one_is_taken_over(holder, tmp_path):
    path, out = written(small(), tmp_path / "records.csv"), tmp_path / "out"
    before = tree_of(tmp_path)
    refused = here("lsq", path, "--out", out)
    assert_refused(refused.exit_code, refused.stderr, f"--out {out}: another run", f"process {holder.pid} on ")
    assert re.search(r" since \d{4}-\d\d-\d\d \d\d:\d\d:\d\d", refused.stderr)
    assert tree_of(tmp_path) == before
    os.kill(holder.pid, signal.SIGKILL)
    holder.wait()
    assert tree_of(tmp_path) == before
    done = here("lsq", path, "--out", out)
    assert (done.exit_code, done.stderr) == (0, "")
    assert set(tree_of(tmp_path)) == {"records.csv", "out/", "out/least_squares.csv"}


def test_another_name_of_the_folder_is_the_same_folder_and_another_folder_is_free(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "out")
    with sole_run(tmp_path / "out"):
        with pytest.raises(BadInput, match="another run writes into it"), sole_run(tmp_path / "link"):
            pytest.fail("held twice")
        with sole_run(tmp_path / "other" / "deep"):
            assert (tmp_path / "other").is_dir()
        assert not (tmp_path / "other").exists()
    with sole_run(tmp_path / "link"):
        pass
    assert set(tree_of(tmp_path)) == {"out/", "link/"}


def test_where_no_file_can_be_made_the_command_itself_says_so(tmp_path):
    (tmp_path / "file").write_text("mine")
    for out in (None, tmp_path / "file" / "below", tmp_path / ("x" * 254)):
        with sole_run(out):
            pass
    assert list(tree_of(tmp_path)) == ["file"]
