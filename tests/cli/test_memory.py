"""Little memory: whichever library runs out of it first, the command ends in one line that says how much it needs."""

import re
import sys

import pytest
from helpers.command_line import COMMAND, assert_refused, environment, finish, start_as

from bayes_tyre.cli import memory

LIMITED = "import os, resource, sys; m = int(sys.argv[1]); resource.setrlimit(resource.RLIMIT_AS, (m, m))"


def limited(megabytes, *arguments, cwd):
    command = [sys.executable, "-c", f"{LIMITED}; os.execv(sys.argv[2], sys.argv[2:])", str(megabytes * 1_000_000)]
    return finish(start_as([*command, str(COMMAND), *map(str, arguments)], cwd, environment()))


@pytest.mark.parametrize("megabytes", [300, 700, 1000])
def test_a_command_without_the_memory_ends_in_one_line_that_says_how_much(megabytes, tmp_path):
    rows = "".join(f"a,{i},{i}\n" for i in range(9))
    (tmp_path / "records.csv").write_text(f"record,displacement_mm,force_kN\n{rows}")
    done = limited(megabytes, "lsq", "records.csv", "--out", "out", cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, "not enough memory: lsq needs about 4,000 MB of address space")
    assert re.search(rf"\({megabytes:,} MB are allowed: ulimit -v\)", done.stderr)
    left = {path.name for path in tmp_path.rglob("*")}
    assert left <= {"records.csv", "out", ".out.lock"}  # as a killed run leaves it


def test_what_is_said_to_be_enough_is_enough(tmp_path):
    rows = "".join(f"a,{i / 10},{1.5 * i / (i + 9)}\n" for i in range(40))
    (tmp_path / "records.csv").write_text(f"record,displacement_mm,force_kN\n{rows}")
    done = limited(memory.NEEDED, "lsq", "records.csv", "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1].startswith("1 records")


def test_what_a_limited_command_says_and_returns_is_its_own(tmp_path):
    done = limited(memory.NEEDED, "columns", "none.csv", "--out", "map.toml", cwd=tmp_path)
    assert_refused(done.returncode, done.stderr, "none.csv: no such file")
    assert limited(memory.NEEDED, "lsq", cwd=tmp_path).returncode == 2
