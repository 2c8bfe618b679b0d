"""Recordings for `process`: three that are records, and three that are none; and what a run has left of them."""

import shutil
from pathlib import Path

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.raw.simulate import write_simulated

GOOD = ("DynamicS(0)30-20(1).lvm", "DynamicS(0)20-30(2).lvm", "DynamicD(0)30-40(3).lvm")
#: Without a step, no recording, and of no case.
STILL, UNREADABLE, NAMELESS = "DynamicS(0)30-20(2).lvm", "DynamicS(0)30-20(3).lvm", "run7.lvm"
RIGS = {name: load_rig(name) for name in ("single", "dual")}
FACTORS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN", "repeat"]


def record_into(folder: Path, seed: int, *names: str) -> None:
    """Write short simulated recordings of these names."""
    plan = [
        record._replace(duration_s=2.5, step_between_s=(1.0, 1.1))
        for record in thesis_plan(5000.0)
        if record.file in names
    ]
    write_simulated(plan, RIGS, seed, folder, lambda done: None)


def write_recordings(folder: Path) -> None:
    """Write all six."""
    record_into(folder, 0, *GOOD)
    text = (folder / GOOD[0]).read_text().splitlines(keepends=True)
    still = [*text[:-12500], *[line for line in text[-12500:] if float(line.split("\t")[0]) < 0.9]]
    (folder / STILL).write_text("".join(still))
    (folder / UNREADABLE).write_text("no recording at all")
    shutil.copy(folder / GOOD[0], folder / NAMELESS)


def files_processed(table: Path) -> int:
    """Return of how many files a run into this table has stored the results."""
    return sum(path.suffix in (".part", ".reason") for path in table.with_name(f".{table.name}.parts").glob("[!.]*"))


def assert_same(folder: Path, other: Path) -> None:
    """Assert that `other` holds what `folder` holds, to the byte."""
    for path in (path for path in folder.rglob("*") if path.is_file()):
        assert (other / path.relative_to(folder)).read_bytes() == path.read_bytes(), path
