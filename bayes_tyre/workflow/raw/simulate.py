"""Simulated raw files with known true parameters, from a plan."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, prepare_folder
from bayes_tyre.formats.lvm.write import write_lvm
from bayes_tyre.formats.recordings.raw import TRUTH
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.rig.axle import Rig
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.plan import Planned
from bayes_tyre.simulate.simulator import simulate_record

NOTES = "simulated by bayes-tyre, not measured: the true parameters are in truth.csv"
# Mean length of a row in files that were written.
_BYTES_A_ROW = 68


def size_of(plan: Sequence[Planned]) -> float:
    """Return about how many bytes the raw files of a plan take."""
    return _BYTES_A_ROW * sum(record.duration_s * record.rate_Hz for record in plan)


def write_simulated(
    plan: Sequence[Planned], rigs: Mapping[str, Rig], seed: int, out: Path, on_progress: Callable[[int], None]
) -> Path:
    """Write a raw file a record, each whole, and at last `truth.csv`; return its path.

    One record at a time is in memory. A record depends only on its plan, its rig and the seed, not on other records.
    `rigs` holds a rig a configuration; `on_progress` is called with 1 after each record.

    Raises
    ------
    BadInput
        If the folder cannot be written to, holds recordings that are not of the plan, or the disk is too small.
    """
    _check(plan, out)
    prepare_folder(out)
    (out / TRUTH).unlink(missing_ok=True)  # written last: where it exists, every file it names exists
    rows = []
    for record in plan:
        rig = rigs[record.case.configuration]
        simulated = simulate_record(draw_truth(record, rig, seed), rig)
        write_lvm(simulated.raw, out / record.file, notes=NOTES)
        rows.append(simulated.row)
        on_progress(1)
    # Standing tyres have no harmonics: columns and their order are taken from the longest row.
    return write_table(pd.DataFrame(rows, columns=max(map(list, rows), key=len)), out / TRUTH)


def _check(plan: Sequence[Planned], out: Path) -> None:
    check_folder(out)
    names = {record.file for record in plan}
    others = sorted(path.name for path in out.glob("*.lvm") if path.name not in names)
    if others:
        raise BadInput(f"--out {out}: holds {others[0]}, which is not of this plan; name a folder of its own")
    existing = next(path for path in (out.absolute(), *out.absolute().parents) if path.exists())
    replaced = sum(path.stat().st_size for path in out.glob("*.lvm"))
    free = shutil.disk_usage(existing).free + replaced
    if free < size_of(plan):
        raise BadInput(
            f"--out {out}: the plan takes {size_of(plan) / 1e9:.1f} GB and {free / 1e9:.1f} GB are free; "
            "name another disk, a lower --rate or --plan quick"
        )
