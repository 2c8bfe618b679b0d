"""Two short recordings of a simulated axle as raw files: what commands on raw files are tried with."""

from pathlib import Path

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.raw.simulate import write_simulated

#: Of one case: the motions of each further one would be compiled for anew.
RECORDINGS = ("DynamicS(0)20-30(1).lvm", "DynamicS(0)30-20(1).lvm")


def write_recordings(folder: Path, seed: int = 0) -> Path:
    """Write them and their `truth.csv` into a folder; return it."""
    prepare_jax()
    plan = [r for r in thesis_plan(4000.0) if r.file in RECORDINGS]
    short = [record._replace(duration_s=2.5, step_between_s=(1.0, 1.1)) for record in plan]
    write_simulated(short, {"single": load_rig("single")}, seed, folder, lambda _: None)
    return folder
