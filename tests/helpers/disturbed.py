"""Commands that are killed, run out of disk, find the clock set back or another input: what `helpers.chaos` does."""

import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from helpers.command_line import COMMAND, FEW, environment, finish, small, start_as, written
from helpers.short_recordings import write_recordings

from bayes_tyre.cli.shell import RESUME

#: A file of a clock that ran so far ahead, s: what is written after it was set back is older.
_AHEAD_S = 3 * 24 * 3600
#: Files of an older run that never pass for a result: checkpoints, parts and locks, all of which begin with a dot.
_HIDDEN = "."


class Command(NamedTuple):
    """A command line without its output; what it writes into; and whether it goes on from where it was killed."""

    line: tuple[str, ...]
    out: str = "out"
    resumes: bool = False


class Alone(NamedTuple):
    """What a command does when it is left alone: the files it writes, how long it takes (s), its lines on stderr."""

    files: dict[str, bytes]
    seconds: float
    said: tuple[str, ...]


#: By name. Each reads what `inputs` makes.
COMMANDS = {
    "lsq": Command(("lsq", "records.csv")),
    "export": Command(("export", "fitted", "--to", "tir")),
    "next": Command(("next", "fitted", "--goal", "k single (0)20-30", "--precision", "2%")),
    "process": Command(("process", "raw", "--workers", "1"), "out/records.csv", resumes=True),
    "fit": Command(("fit", "records.csv", *map(str, FEW)), resumes=True),
    "motion": Command(("motion", "raw", *map(str, FEW), "--workers", "1"), resumes=True),
    "study": Command(("study", "coverage", "--kinds", "few_points", "--sets", "1"), resumes=True),
}


def inputs(folder: Path, names: Iterable[str] = tuple(COMMANDS)) -> Path:
    """Write a record table, recordings and, for commands that read one, a fit into a folder; return it."""
    folder.mkdir(parents=True, exist_ok=True)
    written(small(), folder / "records.csv")
    write_recordings(folder / "raw")
    if any("fitted" in COMMANDS[name].line for name in names):
        done = finish(_started(COMMANDS["fit"], folder, out="fitted"))
        assert done.returncode in (0, 4), done.stderr
    return folder


def left_alone(command: Command, folder: Path) -> Alone:
    """Run a command, return what it did, and remove what it wrote."""
    began = time.monotonic()
    done = finish(_started(command, folder))
    assert done.returncode in (0, 4), done.stderr
    seconds, result = time.monotonic() - began, written_by(folder)
    shutil.rmtree(folder / "out")
    return Alone(result, seconds, tuple(done.stderr.splitlines()))


def killed(command: Command, folder: Path, after_s: float) -> None:
    """Start a command, and end it by SIGKILL after so many seconds."""
    process = _started(command, folder)
    try:
        process.communicate(timeout=after_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


def out_of_disk(command: Command, folder: Path, most_bytes: int, alone: Alone) -> None:
    """Run a command where no file may grow beyond so many bytes: it ends well, or in one line.

    Above that line may stand what the command left alone says too: `fit` gives its verdict before it writes.
    """
    done = finish(_started(command, folder, most_bytes=most_bytes))
    assert "Traceback" not in done.stderr, done.stderr
    if done.returncode not in (0, 4):
        assert done.returncode == 3, done.stderr
        lines = [line for line in done.stderr.splitlines() if not line.startswith("bayes-tyre: warning: ")]
        assert len([line for line in lines if line not in alone.said]) == 1, done.stderr
        assert lines[-1] not in alone.said, done.stderr


def clock_set_back(folder: Path) -> None:
    """Give whatever was written the time of a clock that was days ahead."""
    ahead = time.time() + _AHEAD_S
    for path in (folder / "out").rglob("*"):
        os.utime(path, (ahead, ahead))


def input_changed(command: Command, folder: Path) -> None:
    """Resume a command on another input: it is refused and named, or gives the bytes of a run on that input alone.

    Afterwards the input is what it was, and where the command was not refused nothing is left of it.
    """
    given, other, before = folder / command.line[1], folder / "other", folder / "before"
    if given.is_dir():
        write_recordings(other, seed=1)
    else:
        written(small(seed=2), other)
    given.rename(before)
    other.rename(given)
    done = finish(_started(command, folder, RESUME))
    if done.returncode == 3:
        assert given.name in done.stderr, done.stderr
        assert "SHA-256 was" in done.stderr, done.stderr
    else:
        assert done.returncode in (0, 4), done.stderr
        resumed = written_by(folder)
        shutil.rmtree(folder / "out")
        assert left_alone(command, folder).files == resumed
    given.rename(other)
    before.rename(given)
    shutil.rmtree(other) if other.is_dir() else other.unlink()


def at_once(command: Command, folder: Path, runs: int) -> list[dict[str, bytes]]:
    """Return what a command writes, run so often at once with one compilation cache, which is empty at first."""
    env = environment() | {"JAX_COMPILATION_CACHE_DIR": str(folder / "cache")}
    env |= {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0", "JAX_ENABLE_COMPILATION_CACHE": "1"}
    outs = [f"out{number}" for number in range(runs)]
    lines = [[*command.line, "--out", command.out.replace("out", out, 1)] for out in outs]
    started = [start_as([str(COMMAND), *line], folder, env) for line in lines]
    for done in map(finish, started):
        assert done.returncode in (0, 4), done.stderr
        assert "warning" not in done.stderr, done.stderr
    assert [*(folder / "cache").glob("*-cache")]
    results = [written_by(folder, out) for out in outs]
    for out in outs:
        shutil.rmtree(folder / out)
    shutil.rmtree(folder / "cache")
    return results


def assert_as_left_alone(command: Command, folder: Path, alone: dict[str, bytes]) -> None:
    """Assert that what is there is whole, that the command then gives the bytes of a run left alone; and clean up."""
    for name, content in written_by(folder).items():
        assert alone.get(name) == content, f"{name} is neither whole nor absent: see {_kept(name, content, alone)}"
    done = finish(_started(command, folder, RESUME if command.resumes else None))
    assert done.returncode in (0, 4), done.stderr
    after = written_by(folder)
    assert after.keys() == alone.keys(), after.keys() ^ alone.keys()
    for name, content in after.items():
        assert alone[name] == content, f"{name} differs: see {_kept(name, content, alone)}"
    shutil.rmtree(folder / "out")


def _kept(name: str, content: bytes, alone: dict[str, bytes]) -> Path:
    """Return a folder in which both contents of a file are kept: that of the disturbed run, and that left alone."""
    place = Path(tempfile.mkdtemp(prefix="differs"))
    for kind, kept in (("disturbed", content), ("alone", alone.get(name, b""))):
        (place / f"{kind}-{Path(name).name}").write_bytes(kept)
    return place


def written_by(folder: Path, out: str = "out") -> dict[str, bytes]:
    """Return the files below `out` by name, without the time that a run took (and `run.json` without its command)."""
    files = {}
    for path in sorted((folder / out).rglob("*")) if (folder / out).exists() else ():
        name = str(path.relative_to(folder / out))
        if not path.is_file() or any(part.startswith(_HIDDEN) for part in Path(name).parts):
            continue
        files[name] = path.read_bytes()
        if path.name == "run.json":
            run = json.loads(files[name])
            kept = {key: value for key, value in run.items() if key not in ("wall_time_s", "command")}
            files[name] = json.dumps(kept).encode()
        if path.suffix == ".csv" and b",seconds," in files[name].partition(b"\n")[0]:
            files[name] = pd.read_csv(path, dtype=str).drop(columns="seconds").to_csv(index=False).encode()
    return files


def _started(
    command: Command, folder: Path, option: str | None = None, *, out: str | None = None, most_bytes: int | None = None
) -> subprocess.Popen[str]:
    line = [str(COMMAND), *command.line, "--out", out or command.out, *([option] if option else [])]
    return start_as(line, folder, environment(), most_bytes)
