"""`study`: what shows that the posterior is right."""

from typing import Annotated

import typer

from bayes_tyre.cli.messages import fault
from bayes_tyre.cli.shell import NOT_TRUSTED, Out, Quiet, Seed, guarded, progress, say

#: Host devices that data sets are shared out among.
DEVICES = 2

study = typer.Typer(
    name="study",
    help="Show that the posterior is right, on simulated data of known k (kN/mm) and beta (mm).",
    no_args_is_help=True,
    rich_markup_mode=None,
)


def calibration(
    out: Out,
    datasets: Annotated[int, typer.Option(min=20, help="Simulated data sets, each fitted.")] = 500,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Rank truths drawn from the priors (k kN/mm, beta mm, J kN, ...) among their posteriors' draws.

    Writes calibration.csv (coverage of 50, 80 and 95 % intervals, p-value of uniform ranks), ranks.csv, datasets.csv,
    priors.csv and figures/. Exit code 4 where a parameter is not calibrated.

    Example: bayes-tyre study calibration --out results/calibration --datasets 500
    """
    from bayes_tyre.runtime import prepare_jax

    prepare_jax(DEVICES)
    from bayes_tyre.workflow.study import write_calibration

    options = {"datasets": datasets, "seed": seed}
    with progress("calibrating", datasets, quiet) as on_progress:
        found = write_calibration(out, datasets, seed, options, on_progress)
    failed = found.datasets["sampling"] != "ok"
    say(f"wrote {out / 'calibration.csv'} (simulated, not measured)", quiet)
    say(f"  sampling failed in {failed.sum()} of {datasets} data sets; they count all the same", quiet)
    wrong = found.table.loc[~found.table["calibrated"], "parameter"]
    say(f"  calibrated: {len(found.table) - len(wrong)} of {len(found.table)} parameters", quiet)
    for name in wrong:
        fault(f"{name}: ranks of truths are not uniform; see {out / 'figures' / 'calibration.png'}")
    if len(wrong):
        raise typer.Exit(NOT_TRUSTED)


def outliers(
    out: Out,
    campaigns: Annotated[int, typer.Option(min=4, help="Simulated campaigns with each share of odd repeats.")] = 200,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Compare the posterior with the source's rule for repeats that differ, and with the plain mean (k kN/mm, beta mm).

    Writes outliers.csv (relative error, coverage of 95 % intervals), datasets.csv and figures/.

    Example: bayes-tyre study outliers --out results/outliers --campaigns 200
    """
    from bayes_tyre.runtime import prepare_jax

    prepare_jax(DEVICES)
    from bayes_tyre.studies.outliers import SHARES, in_words
    from bayes_tyre.workflow.study import write_outliers

    options = {"campaigns": campaigns, "seed": seed}
    with progress("fitting campaigns", len(SHARES) * campaigns, quiet) as on_progress:
        found = write_outliers(out, campaigns, seed, options, on_progress)
    failed = found.datasets["sampling"] != "ok"
    say(f"wrote {out / 'outliers.csv'} (simulated, not measured)", quiet)
    say(f"  sampling failed in {failed.sum()} of {len(failed)} campaigns; they count all the same", quiet)
    for line in in_words(found.table):
        say(f"  {line}", quiet)


for command in (calibration, outliers):
    study.command()(guarded(command))
