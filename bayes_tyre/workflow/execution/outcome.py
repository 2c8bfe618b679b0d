"""The outcome of one file, a result or a fault, and the fingerprint of everything that determines it."""

import hashlib
import json
import traceback
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

import pandas as pd

from bayes_tyre.errors import NO_MEMORY, BadInput, out_of_memory
from bayes_tyre.plain_text import path_text, reason


@runtime_checkable  # tests check arguments
class FileTask(Protocol):
    """What the work on one file needs; picklable, so that any process can do it."""

    @property
    def file(self) -> Path:
        """The file; absolute, because a worker of a cluster has a working folder of its own."""
        ...

    @property
    def figure(self) -> Path | None:
        """The PNG to draw, or None."""
        ...

    def decides(self) -> dict[str, object]:
        """Return what determines the result beside the file's content and the package's version, ready for JSON."""
        ...


class Done(NamedTuple):
    """A result: its table, and its figure as PNG if one is wanted. The process that submitted the task writes both."""

    table: pd.DataFrame
    figure: bytes | None = None


class Fault(NamedTuple):
    """Why a file has no result; not `lasting` where another attempt may succeed (a disk, the memory)."""

    reason: str
    lasting: bool = True


def attempted[T: FileTask](make: Callable[[T], Done], task: T) -> Done | Fault:
    """Return the result for a file, or why it has none; an error in this package must not end the batch."""
    try:
        return make(task)
    except BadInput as error:
        fault = path_text(Path(str(error).removeprefix(f"{task.file}: ")))
        # Errors of the disk or the memory may not occur again.
        return Fault(fault, lasting=not isinstance(error.__context__, OSError | MemoryError))
    except Exception as error:
        if out_of_memory(error):
            return Fault(f"{NO_MEMORY} to work on it; give it more, or cut the file in pieces", lasting=False)
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__} in {Path(where.filename).name}, line {where.lineno}: {reason(error)}"
        return Fault(f"bayes-tyre itself failed on it; please report: {text}", lasting=False)


def fingerprint(task: FileTask) -> str | None:
    """Return the SHA-256 of everything that determines a task's result; None if its file cannot be read.

    The file's content counts, not its time: a copy or a checkout changes the time and not the result, and some disks
    store times to 2 s. Reading it for this takes a few hundredths of the time of processing.
    """
    try:
        with task.file.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
    kind = task.file.suffix.lower()  # it selects the reader
    decides = {"content": content, "kind": kind, "version": version("bayes-tyre"), **task.decides()}
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()
