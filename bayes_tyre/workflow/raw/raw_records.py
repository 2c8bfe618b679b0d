"""What commands share that make something of each raw file: the attempt, its origin, and the list of those rejected."""

import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.record import RawSignals
from bayes_tyre.rig.axle import Rig
from bayes_tyre.signals.factors import RecordFactors
from bayes_tyre.workflow.execution.outcome import Done, Fault
from bayes_tyre.workflow.raw.inspect import path_text
from bayes_tyre.workflow.raw.process_tasks import Task

REJECTED = "rejected.csv"
#: What the simulator's files say of themselves.
_SIMULATED = "simulated by bayes-tyre"


def attempted(make: Callable[[Task], Done], task: Task) -> Done | Fault:
    """Return what is made of a file, or why nothing is; a fault of ours must not lose the work on other files."""
    try:
        return make(task)
    except BadInput as error:
        reason = path_text(Path(str(error).removeprefix(f"{task.file}: ")))
        # Another attempt may find the disk, or the memory, that this one did not.
        return Fault(reason, lasting=not isinstance(error.__context__, OSError | MemoryError))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__} in {Path(where.filename).name}, line {where.lineno}: {error}"
        return Fault(f"bayes-tyre itself failed on it; please report: {said}", lasting=False)


def usable(task: Task) -> tuple[RecordFactors, Rig]:
    """Return the words and the rig of a file.

    Raises
    ------
    BadInput
        With the reason why it cannot be used.
    """
    if isinstance(task.factors, str) or task.rig is None:
        raise BadInput(str(task.factors))
    return task.factors, task.rig


def origin_of_raw(raw: RawSignals, task: Task) -> str:
    """Return ``simulated`` where the file says so of itself, or the truths beside it name it; else ``measured``."""
    said = any(_SIMULATED in text for text in raw.notes)
    return "simulated" if said or task.simulated else "measured"


def rejected(files: Sequence[Path], outcomes: Sequence[Path | Fault]) -> pd.DataFrame:
    """Return `rejected.csv`: file and reason of those of which nothing could be made."""
    rows = [(path_text(file), end.reason) for file, end in zip(files, outcomes, strict=True) if isinstance(end, Fault)]
    return pd.DataFrame(rows, columns=["file", "reason"], dtype=object)


def none_usable(path: Path, rows: pd.DataFrame, tasks: int) -> BadInput:
    """Return what to raise where no file can be used, `rejected.csv` written."""
    first = f": {rows['reason'].iloc[0]}" if len(rows) else ""
    return BadInput(f"{path}: none of {tasks} files can be used, the first{first}")
