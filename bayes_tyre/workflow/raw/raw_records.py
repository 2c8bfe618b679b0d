"""What commands on raw files share: what a file needs to be used, the origin of a record, and the rejected files."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import path_text
from bayes_tyre.record import RawSignals
from bayes_tyre.rig.axle import Rig
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.workflow.execution.outcome import Fault
from bayes_tyre.workflow.raw.process_tasks import Task

REJECTED = "rejected.csv"
#: Most rejected files named on the terminal; the table has them all.
_NAMED = 3
#: In the notes of files that the simulator wrote.
_SIMULATED = "simulated by bayes-tyre"


def usable(task: Task) -> tuple[RecordFactors, Rig]:
    """Return the factors and the rig of a file.

    Raises
    ------
    BadInput
        With the reason why it cannot be used.
    """
    if isinstance(task.factors, str) or task.rig is None:
        raise BadInput(str(task.factors))
    return task.factors, task.rig


def origin_of_raw(raw: RawSignals, task: Task) -> str:
    """Return ``simulated`` where the file's notes say so or the truth table beside it names it; else ``measured``."""
    noted = any(_SIMULATED in text for text in raw.notes)
    return "simulated" if noted or task.simulated else "measured"


def rejected(files: Sequence[Path], outcomes: Sequence[Path | Fault]) -> pd.DataFrame:
    """Return `rejected.csv`: file and reason of those without a result."""
    rows = [
        (path_text(file), outcome.reason)
        for file, outcome in zip(files, outcomes, strict=True)
        if isinstance(outcome, Fault)
    ]
    return pd.DataFrame(rows, columns=["file", "reason"], dtype=object)


def none_usable(path: Path, rows: pd.DataFrame, tasks: int) -> BadInput:
    """Return what to raise where no file can be used, `rejected.csv` written: the first file, and why."""
    (first,) = rejections(rows.head(1)) or ("no files",)
    return BadInput(f"{first}; none of {tasks} files can be used, see {path}")


def rejections(rows: pd.DataFrame) -> list[str]:
    """Return a line for each of the first few rejected files: the file, and why it has no result."""
    return [f"{file}: {reason}" for file, reason in rows.head(_NAMED).itertuples(index=False)]


def rejection_notes(rows: pd.DataFrame, path: Path) -> list[str]:
    """Return what to say of rejected files where others have a result: the first few, and where all are listed."""
    more = len(rows) - _NAMED
    return [*rejections(rows), *([f"{more} more files are rejected: see {path}"] if more > 0 else [])]
