"""Raw files in, a record table and the rejected files out; a file that fails is a row and stops no other."""

import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, remove_leftovers
from bayes_tyre.formats.joined import write_joined
from bayes_tyre.formats.raw import read_raw
from bayes_tyre.formats.tables import write_table
from bayes_tyre.rig.sensors import columns_of
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.signals.process import process
from bayes_tyre.workflow.each_file import Machines, each_file
from bayes_tyre.workflow.inspect import path_text
from bayes_tyre.workflow.outcome import Done, Fault
from bayes_tyre.workflow.parts import Parts
from bayes_tyre.workflow.process_tasks import Settings, Task, plan_tasks

REJECTED = "rejected.csv"
#: What the simulator's files say of themselves.
_SIMULATED = "simulated by bayes-tyre"


def process_files(
    files: Sequence[Path], settings: Settings, machines: Machines, out: Path, on_progress: Callable[[int], None]
) -> tuple[int, int]:
    """Write the record table of raw files and `rejected.csv` beside it; return how many records, how many rejected.

    Parameters
    ----------
    files:
        As `bayes_tyre.formats.raw.raw_files` finds them.
    settings:
        Rig, cases, method, pictures.
    machines:
        Processes or cluster; whether to do only what is missing since the last run with this `out`.
    out:
        A `.csv` or `.parquet` file. It is the same to the byte whatever the machines, and whether or not a run was
        interrupted; its rows are in the order of the files.
    on_progress:
        Called with 1 after each file.

    Raises
    ------
    BadInput
        If the rig, the cases, the cluster or `out` are of no use, before the work; if no file is, after
        `rejected.csv` was written.
    """
    if out.is_dir() or out.suffix.lower() not in (".csv", ".parquet"):
        raise BadInput(f"--out {out}: is no .csv or .parquet file; name one")
    check_folder(out.parent)
    if settings.figures:
        check_folder(settings.figures, "--figures")
    tasks, parts = plan_tasks(files, settings), Parts(out)
    outcomes = each_file(process_file, tasks, parts, machines, on_progress)
    rows = [(path_text(file), end.reason) for file, end in zip(files, outcomes, strict=True) if isinstance(end, Fault)]
    records = [end for end in outcomes if isinstance(end, Path)]
    remove_leftovers([out, out.parent / REJECTED])
    write_table(pd.DataFrame(rows, columns=["file", "reason"], dtype=object), out.parent / REJECTED)
    if not records:
        out.unlink(missing_ok=True)  # an earlier run's records are not those of these files
        parts.remove()
        first = f": {rows[0][1]}" if rows else ""
        raise BadInput(f"{out.parent / REJECTED}: none of {len(tasks)} files can be used, the first{first}")
    write_joined(records, out)
    return len(records), len(rows)


def process_file(task: Task) -> Done | Fault:
    """Return the rows of a file's record and its picture if one is wanted, or why there are none."""
    prepare_jax()
    try:
        return _done(task)
    except BadInput as error:
        reason = path_text(Path(str(error).removeprefix(f"{task.file}: ")))
        # Another attempt may find the disk, or the memory, that this one did not.
        return Fault(reason, lasting=not isinstance(error.__context__, OSError | MemoryError))
    except Exception as error:  # a fault of ours in one file must not lose the work on the others
        where = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__} in {Path(where.filename).name}, line {where.lineno}: {error}"
        return Fault(f"bayes-tyre itself failed on it; please report: {said}", lasting=False)


def _done(task: Task) -> Done:
    if isinstance(task.words, str) or task.rig is None:
        raise BadInput(str(task.words))
    raw = read_raw(task.file, columns_of(task.rig))
    processed = process(raw, task.rig, task.words, task.method)
    said = any(_SIMULATED in text for text in raw.notes)
    origin = "simulated" if said or task.simulated else "measured"
    picture = None
    if task.picture is not None:
        from bayes_tyre.report.process_figures import record_png

        picture = record_png(processed, origin)
    return Done(pd.DataFrame({**processed.columns(), "origin": origin}), picture)
