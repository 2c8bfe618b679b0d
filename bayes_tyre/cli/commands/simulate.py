"""`simulate`: raw files with known true parameters."""

from typing import Annotated, Literal

import typer

from bayes_tyre.cli.raw import RigName
from bayes_tyre.cli.shell import Out, Quiet, Seed, progress, say
from bayes_tyre.runtime import prepare_jax


def simulate(
    out: Out,
    plan: Annotated[
        Literal["quick", "thesis"],
        typer.Option(
            help="quick: 24 stationary records of 4.5 s. thesis: the test plan, 288 of 15 s (3 GB at 10 kHz)."
        ),
    ] = "quick",
    seed: Seed = 0,
    rate: Annotated[float, typer.Option(min=1000, max=100_000, help="Sampling rate, Hz.")] = 10_000.0,
    rig: RigName = None,
    quiet: Quiet = False,
) -> None:
    """Simulate step-load tests: raw files (V, m/s^2, mm, kN) of an axle moving on tyres of known k (kN/mm), x, beta.

    Writes a file a record, in the names and layout of the source, and truth.csv (a row a file, every true parameter).
    The same plan, rate, rig and seed give the same files.

    Example: bayes-tyre simulate --out data/simulated --plan quick
    """
    prepare_jax()
    from bayes_tyre.rig.axle import load_rig
    from bayes_tyre.simulate.plan import PLANS
    from bayes_tyre.workflow.raw.simulate import size_of, write_simulated

    records = PLANS[plan](rate)
    rigs = {record.case.configuration: load_rig(rig or record.case.configuration) for record in records}
    say(f"simulating {len(records)} records, about {size_of(records) / 1e6:.0f} MB", quiet)
    with progress("simulating", len(records), quiet) as on_progress:
        truth = write_simulated(records, rigs, seed, out, on_progress)
    say(f"wrote {len(records)} .lvm files (simulated, not measured) and {truth}", quiet)
