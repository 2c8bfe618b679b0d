"""`audit`: bias and error of each method for known true parameters."""

from typing import Annotated, Literal

import typer

from bayes_tyre.cli.shell import Out, Quiet, Seed, progress, say
from bayes_tyre.runtime import prepare_jax


def audit(
    out: Out,
    plan: Annotated[
        Literal["quick", "full"],
        typer.Option(help="quick: some minutes. full: twice as many truths, and more windows."),
    ] = "quick",
    replicates: Annotated[
        int, typer.Option(min=1, help="Records a true parameter set, each with independent noise.")
    ] = 3,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Show what thesis, inertia and motion return for records simulated with known k (kN/mm), x (kN) and beta (mm).

    A stationary rig; varied are k, x, beta, damping, rise time (s), step (kN) and the window of thesis (samples).
    Writes audit.csv (bias, error and coverage a method and point), audit_records.csv, conclusion.txt and figures/.

    Example: bayes-tyre audit --out results/audit --plan quick
    """
    prepare_jax()
    from bayes_tyre.studies.audit.grid import PLANS
    from bayes_tyre.studies.audit.sentences import lines
    from bayes_tyre.studies.audit.study import count_records
    from bayes_tyre.workflow.studies import write_audit

    with progress("auditing records", count_records(PLANS[plan], replicates), quiet) as on_progress:
        overview, conclusion = write_audit(out, plan, replicates, seed, on_progress)
    say(f"wrote {out / 'audit.csv'} (simulated, not measured)", quiet)
    for line in lines(overview):
        say(f"  {line}", quiet)
    for paragraph in conclusion:
        say(f"\n{paragraph}", quiet)
