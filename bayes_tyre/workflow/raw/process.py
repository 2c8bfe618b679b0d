"""Processing of raw files to a record table; a file that fails becomes a row of `rejected.csv`."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, remove_leftovers
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.formats.tables.joined import Change, write_joined
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.record import FORCE_PER_KG, MASS, MASS_SD
from bayes_tyre.rig.sensors import columns_of
from bayes_tyre.signals.mass import shared_mass
from bayes_tyre.signals.process import process
from bayes_tyre.workflow.execution.batch import Machines, run_batch
from bayes_tyre.workflow.execution.outcome import Done, Fault, attempted
from bayes_tyre.workflow.execution.task_cache import TaskCache
from bayes_tyre.workflow.raw.process_tasks import Settings, Task, plan_tasks
from bayes_tyre.workflow.raw.raw_records import REJECTED, none_usable, origin_of_raw, rejected, usable


def process_files(
    files: Sequence[Path], settings: Settings, machines: Machines, out: Path, on_progress: Callable[[int], None]
) -> tuple[int, pd.DataFrame]:
    """Write the record table of raw files and `rejected.csv` beside it; return how many records, and what is rejected.

    Parameters
    ----------
    files:
        As `bayes_tyre.formats.recordings.raw.raw_files` finds them.
    settings:
        Rig, cases, method, figures.
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
        If the rig, the cases, the cluster or `out` cannot be used, before the work; if no file can, after
        `rejected.csv` was written.
    """
    if out.is_dir() or out.suffix.lower() not in (".csv", ".parquet"):
        raise BadInput(f"--out {out}: is no .csv or .parquet file; name one")
    check_folder(out.parent)
    if settings.figures:
        check_folder(settings.figures, "--figures")
    tasks, cache = plan_tasks(files, settings), TaskCache(out)
    outcomes = run_batch(process_file, tasks, cache, machines, on_progress)
    rows = rejected(files, outcomes)
    records = [outcome for outcome in outcomes if isinstance(outcome, Path)]
    remove_leftovers([out, out.parent / REJECTED])
    write_table(rows, out.parent / REJECTED)
    if not records:
        out.unlink(missing_ok=True)  # an earlier run's records are not those of these files
        cache.remove()
        raise none_usable(out.parent / REJECTED, rows, len(tasks))
    write_joined(records, out, _shared_masses(tasks, outcomes))
    return len(records), rows


def _shared_masses(tasks: Sequence[Task], outcomes: Sequence[Path | Fault]) -> list[Change | None] | None:
    """Return, for each record, what gives it the mass that its configuration has on its rig; None where none has one.

    An axle has one mass with the tyres of a configuration. What each record finds by itself is off by several times as
    much, and its k with it. Where there are standing records the mass is theirs: what is left of a runout looks like
    mass, mostly like less of it.
    """
    done = [(task.rig, part) for task, part in zip(tasks, outcomes, strict=True) if isinstance(part, Path)]
    own = pd.DataFrame([pd.read_parquet(part).iloc[0] for _, part in done]).reset_index(drop=True)
    if MASS not in own:
        return None
    rigs = [rig for rig, _ in done if rig is not None]
    keys = [
        f"{configuration} on {rig.model_dump_json()}"
        for rig, configuration in zip(rigs, own["configuration"], strict=True)
    ]
    rig_of = dict(zip(keys, rigs, strict=True))
    shared = {str(key): shared_mass(rig_of[str(key)], _masses(rows)) for key, rows in own.groupby(pd.Series(keys))}
    masses = [shared[key] for key in keys]
    return [None if mass is None else partial(_with_mass, mass=mass) for mass in masses]


def _masses(records: pd.DataFrame) -> Float[np.ndarray, "records 2"]:
    standing = records["speed_km_h"] == 0
    used = records[standing] if standing.any() else records
    return used[["mass_from_record_kg", "mass_from_record_sd_kg"]].to_numpy(dtype=float)


def _with_mass(record: pd.DataFrame, mass: tuple[float, float]) -> pd.DataFrame:
    """Return a record with another mass and its standard deviation, kg."""
    kg, sd_kg = mass
    force_kN = record["force_kN"] + (kg - record[MASS]) * record[FORCE_PER_KG]
    return record.assign(**{"force_kN": force_kN, MASS: kg, MASS_SD: sd_kg})


def process_file(task: Task) -> Done | Fault:
    """Return the rows of a file's record and its figure if one is wanted, or why there are none."""
    return attempted(_done, task)


def _done(task: Task) -> Done:
    factors, rig = usable(task)
    raw = read_raw(task.file, columns_of(rig))
    processed = process(raw, rig, factors, task.method)
    origin = origin_of_raw(raw, task)
    figure = None
    if task.figure is not None:
        from bayes_tyre.report.figures.page.layout import png
        from bayes_tyre.report.figures.process import record_figure

        figure = png(lambda: record_figure(processed, origin))
    return Done(pd.DataFrame({**processed.columns(), "origin": origin}), figure)
