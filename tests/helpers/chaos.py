"""Commands that are killed, run out of disk, or find the clock set back: afterwards the bytes of a run left alone.

As a program (`make chaos`) it goes on for as many seconds as it is told: ``python -m helpers.chaos 600``.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from helpers.command_line import COMMAND, FEW, environment, finish, small, start_as, written

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.raw.simulate import write_simulated

#: A file of a clock that ran so far ahead, s: what is written after it was set back is older.
_AHEAD_S = 3 * 24 * 3600
#: Of one case: the motions of each further one would be compiled for anew.
RECORDINGS = ("DynamicS(0)20-30(1).lvm", "DynamicS(0)30-20(1).lvm")
#: Files of an older run that never pass for a result: checkpoints, parts and locks, all of which begin with a dot.
_HIDDEN = "."


class Command(NamedTuple):
    """A command line without its output; what it writes into; and whether it goes on from where it was killed."""

    line: tuple[str, ...]
    out: str = "out"
    resumes: bool = False


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
    prepare_jax()
    plan = [r for r in thesis_plan(4000.0) if r.file in RECORDINGS]
    short = [record._replace(duration_s=2.5, step_between_s=(1.0, 1.1)) for record in plan]
    write_simulated(short, {"single": load_rig("single")}, 0, folder / "raw", lambda _: None)
    if any("fitted" in COMMANDS[name].line for name in names):
        done = finish(_started(COMMANDS["fit"], folder, out="fitted"))
        assert done.returncode in (0, 4), done.stderr
    return folder


def left_alone(command: Command, folder: Path) -> tuple[dict[str, bytes], float]:
    """Return what a command writes, and how long it takes (s)."""
    began = time.monotonic()
    done = finish(_started(command, folder))
    assert done.returncode in (0, 4), done.stderr
    seconds, result = time.monotonic() - began, written_by(folder)
    shutil.rmtree(folder / "out")
    return result, seconds


def killed(command: Command, folder: Path, after_s: float) -> None:
    """Start a command, and end it by SIGKILL after so many seconds."""
    process = _started(command, folder)
    try:
        process.communicate(timeout=after_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


def out_of_disk(command: Command, folder: Path, most_bytes: int) -> None:
    """Run a command where no file may grow beyond so many bytes: it ends well, or in one line."""
    done = finish(_started(command, folder, most_bytes=most_bytes))
    assert "Traceback" not in done.stderr, done.stderr
    if done.returncode not in (0, 4):
        assert done.returncode == 3, done.stderr
        said = [line for line in done.stderr.splitlines() if not line.startswith("bayes-tyre: warning: ")]
        assert len(said) == 1, done.stderr


def clock_set_back(folder: Path) -> None:
    """Give whatever was written the time of a clock that was days ahead."""
    ahead = time.time() + _AHEAD_S
    for path in (folder / "out").rglob("*"):
        os.utime(path, (ahead, ahead))


def assert_as_left_alone(command: Command, folder: Path, alone: dict[str, bytes]) -> None:
    """Assert that what is there is whole, that the command then gives the bytes of a run left alone; and clean up."""
    for name, content in written_by(folder).items():
        assert alone.get(name) == content, f"{name} is neither whole nor absent"
    done = finish(_started(command, folder, "--resume" if command.resumes else None))
    assert done.returncode in (0, 4), done.stderr
    after = written_by(folder)
    assert after.keys() == alone.keys(), after.keys() ^ alone.keys()
    assert not [name for name in alone if after[name] != alone[name]]
    shutil.rmtree(folder / "out")


def written_by(folder: Path) -> dict[str, bytes]:
    """Return the files below `out` by name; of `run.json` without the time that the run took and its command."""
    files = {}
    for path in sorted((folder / "out").rglob("*")) if (folder / "out").exists() else ():
        name = str(path.relative_to(folder / "out"))
        if not path.is_file() or any(part.startswith(_HIDDEN) for part in Path(name).parts):
            continue
        files[name] = path.read_bytes()
        if path.name == "run.json":
            run = json.loads(files[name])
            kept = {key: value for key, value in run.items() if key not in ("wall_time_s", "command")}
            files[name] = json.dumps(kept).encode()
    return files


def _started(
    command: Command, folder: Path, option: str | None = None, *, out: str | None = None, most_bytes: int | None = None
) -> subprocess.Popen[str]:
    line = [str(COMMAND), *command.line, "--out", out or command.out, *([option] if option else [])]
    return start_as(line, folder, environment(), most_bytes)


def chaos(
    folder: Path, names: tuple[str, ...], until: Callable[[int], bool], seed: int, say: Callable[[str], None] = print
) -> Counter[str]:
    """Disturb commands at random moments until told to stop; return how often each was. Quick ones come more often.

    Parameters
    ----------
    folder, names:
        What `inputs` made, and which of `COMMANDS`.
    until:
        Called with the number of disturbances so far; True: enough.
    seed, say:
        Of the moments; called with each disturbance before it is made.
    """
    rng, counts = np.random.default_rng(seed), Counter[str]()
    alone = {name: left_alone(COMMANDS[name], folder) for name in names}
    often = np.array([alone[name][1] ** -0.5 for name in names])
    while not until(counts.total()):
        name = str(rng.choice(names, p=often / often.sum()))
        command, (result, seconds) = COMMANDS[name], alone[name]
        if rng.random() < 0.3:
            most = int(10 ** rng.uniform(2, 6))
            say(f"{name}: no file above {most} bytes")
            out_of_disk(command, folder, most)
        else:
            after_s = rng.uniform(0.3, 1.0) * seconds
            say(f"{name}: killed after {after_s:.2f} s of {seconds:.2f} s")
            killed(command, folder, after_s)
        if rng.random() < 0.3:
            say(f"{name}: the clock is set back")
            clock_set_back(folder)
        assert_as_left_alone(command, folder, result)
        counts[name] += 1
    return counts


def main() -> None:
    """Disturb all commands for as many seconds as the command line says, and print how often."""
    seconds, seed = (*map(int, sys.argv[1:]), *(600, 0)[len(sys.argv) - 1 :])
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as place:
        folder = inputs(Path(place))
        counts = chaos(folder, tuple(COMMANDS), lambda _: time.monotonic() - began > seconds, seed)
    took = time.monotonic() - began
    print(f"{counts.total()} disturbances in {took:.0f} s, each with the bytes of a run left alone: {dict(counts)}")


if __name__ == "__main__":
    main()
