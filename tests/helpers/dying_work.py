"""Work for worker processes, one of which dies; quick to import, because each process imports it."""

import os
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.workflow.execution.outcome import Done, Fault

DEADLY = 3
#: How many tables made here are alive in this process, and the most there were.
ALIVE: Counter[str] = Counter()


class Task(NamedTuple):
    """A file whose content selects its outcome; each death leaves a file in the folder `deaths`."""

    file: Path
    deaths: Path | None = None
    figure: Path | None = None

    def decides(self) -> dict[str, object]:
        return {}


class Counted(pd.DataFrame):
    """A table that counts its instances in this process."""

    def __setstate__(self, state):
        pd.DataFrame.__setstate__(self, state)  # pyright: ignore[reportAttributeAccessIssue]
        object.__setattr__(self, "_life", Life())


class Life:
    """Counts itself."""

    def __init__(self) -> None:
        ALIVE["now"] += 1
        ALIVE["most"] = max(ALIVE["most"], ALIVE["now"])
        ALIVE["ever"] += 1

    def __del__(self) -> None:
        ALIVE["now"] -= 1


def work(task: int) -> str:
    if task == DEADLY:
        os._exit(9)
    time.sleep(0.02)
    return str(task)


def tabulate(task: int) -> pd.DataFrame:
    """Return a table of one row; killed as `work` is."""
    return pd.DataFrame({"task": [work(task)]}).astype(int)


def make(task: Task) -> Done | Fault:
    """Return a table of a file's text: `deadly` kills, `once` kills the first time, `bad` is a fault."""
    text = task.file.read_text()
    if text == "deadly" or (text == "once" and task.deaths is not None and not any(task.deaths.iterdir())):
        if task.deaths is not None:
            (task.deaths / str(os.getpid())).touch()
        os.kill(os.getpid(), 9)
    if text == "bad":
        return Fault("it is bad; mend it")
    return Done(Counted({"record": text, "force_kN": [0.1, 1 / 3]}), b"png" if task.figure else None)


def slowly(task: Task) -> str:
    time.sleep(0.05)
    return task.file.name
