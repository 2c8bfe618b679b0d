"""Little memory: whichever library runs out of it first, the command ends in one line that says how much it needs."""

import re
import subprocess
import sys

import pytest
from helpers.command_line import COMMAND, FEW, assert_refused, environment, finish, small, start_as, written
from helpers.short_recordings import write_recordings

from bayes_tyre.cli import memory

LIMITED = "import os, resource, sys; m = int(sys.argv[1]); resource.setrlimit(resource.RLIMIT_AS, (m, m))"
#: A command in the place of those of the package: it ends by what is executed.
ENDING = """
import typer
from bayes_tyre.cli import memory
try:
    memory.within_limit(lambda: exec(sys.argv[2]), "lsq")
except typer.Exit as end:
    sys.exit(end.exit_code)
"""


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


#: Commands of each kind (that sample and that do not, of no file, tables, raw files and results), each with what it
#: cannot do without; the limit is of the program, the same for all.
NOT_ENOUGH = {
    **dict.fromkeys(("published", "campaign", "study coverage"), ()),
    **dict.fromkeys(("fit", "motion", "columns", "show"), ("records.csv",)),
    "next": ("records.csv", "--goal", "k a / b", "--precision", "2%"),
}


@pytest.mark.parametrize("command", NOT_ENOUGH)
def test_a_command_says_how_much_it_needs(command, tmp_path):
    out = () if command == "show" else ("--out", "out")
    (tmp_path / "records.csv").write_text("record,displacement_mm,force_kN\na,1,1\n")
    done = limited(250, *command.split(), *NOT_ENOUGH[command], *out, cwd=tmp_path)
    needs = f"{memory.needed_mb(command):,} MB of address space"
    # "not enough memory", or "perhaps for want of" it: where allocation fails is chance, and some libraries then only
    # say that something did.
    assert_refused(done.returncode, done.stderr, f"memory: {command} needs about {needs}")


@pytest.mark.parametrize(
    ("megabytes", "command"),
    [
        (1000, ("fit", "records.csv", *FEW, "--out", "out")),
        (1000, ("motion", "raw", *FEW, "--workers", 1, "--out", "out")),
        (500, ("process", "raw", "--workers", 2, "--out", "out/records.csv")),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else None,
)
def test_a_command_that_gets_as_far_as_its_data_says_how_much_it_needs(megabytes, command, tmp_path):
    written(small(), tmp_path / "records.csv")
    write_recordings(tmp_path / "raw")
    done = limited(megabytes, *command, cwd=tmp_path)
    needs = f"{command[0]} needs about {memory.needed_mb(command[0]):,} MB of address space"
    # In words for either, as above.
    assert_refused(done.returncode, done.stderr, f"memory: {needs} ({megabytes:,} MB are allowed: ulimit")


def ended(megabytes, end, tmp_path):
    """Run a command that ends by what is executed, as one whose address space is limited."""
    command = [sys.executable, "-c", LIMITED + ENDING, str(megabytes * 1_000_000), end]
    return finish(start_as(command, tmp_path, environment()))


def test_with_too_little_an_end_that_does_not_name_memory_is_not_called_want_of_it(tmp_path):
    for end, by in (
        ("1 / 0", "code 1: ZeroDivisionError: division by zero"),
        ("os.kill(os.getpid(), 11)", "SIGSEGV"),
        ("print('odd', file=sys.stderr, flush=True); os.abort()", "SIGABRT: odd"),
    ):
        done = ended(1000, end, tmp_path)
        said = f"ended by {by}, perhaps for want of memory: lsq needs about 4,000 MB of address space (1,000 MB"
        assert_refused(done.returncode, done.stderr, said)


def test_with_enough_an_error_is_the_commands_own(tmp_path):
    done = ended(memory.NEEDED, "1 / 0", tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[0].startswith("Traceback")
    assert done.stderr.splitlines()[-1] == "ZeroDivisionError: division by zero"
    done = ended(memory.NEEDED, "raise RuntimeError('RESOURCE_EXHAUSTED: Out of memory allocating 9 bytes')", tmp_path)
    assert_refused(done.returncode, done.stderr, "not enough memory: lsq needs about 4,000 MB")


def test_a_limited_command_writes_its_errors_to_a_file_too(tmp_path):
    limit = [sys.executable, "-c", f"{LIMITED}; os.execv(sys.argv[2], sys.argv[2:])", str(memory.NEEDED * 1_000_000)]
    with (tmp_path / "errors.txt").open("w") as errors:
        command = [*limit, str(COMMAND), "columns", "none.csv"]
        done = subprocess.run(command, cwd=tmp_path, stderr=errors, env=environment(), check=False)
    assert_refused(done.returncode, (tmp_path / "errors.txt").read_text(), "none.csv: no such file")


def test_a_log_file_has_the_end_of_a_limited_command_once(tmp_path):
    for megabytes, code in ((memory.NEEDED, 3), (250, 3)):
        done = limited(megabytes, "columns", "none.csv", "--log-file", f"{megabytes}.txt", cwd=tmp_path)
        assert done.returncode == code, done.stderr
        assert (tmp_path / f"{megabytes}.txt").read_text().count("ended with code 3") == 1


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
