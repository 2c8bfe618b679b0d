"""What becomes of one raw file: a result or a fault, and the fingerprint of all that decides which."""

import hashlib
import json
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

import pandas as pd


@runtime_checkable  # tests check arguments
class FileTask(Protocol):
    """What one raw file needs: picklable, so that any process can do it."""

    @property
    def file(self) -> Path:
        """The raw file; absolute, for a worker of a cluster stands in a folder of its own."""
        ...

    @property
    def picture(self) -> Path | None:
        """The PNG that is wanted, or None."""
        ...

    def decides(self) -> dict[str, object]:
        """Return all that decides the result but the file's content and the package's version, as JSON takes it."""
        ...


class Done(NamedTuple):
    """A result: its table, and its picture as PNG where one is wanted. Whoever gave the task writes both."""

    table: pd.DataFrame
    picture: bytes | None = None


class Fault(NamedTuple):
    """Why a file has no result; not `lasting` where the next attempt may fare better (a disk, the memory)."""

    reason: str
    lasting: bool = True


def fingerprint(task: FileTask) -> str | None:
    """Return the SHA-256 of all that decides a task's result; None if its file cannot be read.

    The file counts by its content: a copy or a checkout changes its time and not its result, and some disks keep time
    to 2 s. Reading it for that costs some hundredths of what processing does.
    """
    try:
        with task.file.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
    kind = task.file.suffix.lower()  # it chooses the reader
    decides = {"content": content, "kind": kind, "version": version("bayes-tyre"), **task.decides()}
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()
