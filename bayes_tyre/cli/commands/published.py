"""`published` and `campaign`: the source's numbers recomputed, and records reconstructed from them."""

import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli import sampled, shell
from bayes_tyre.cli.model_options import PriorsOption
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder
from bayes_tyre.runtime import prepare_jax

#: Options that have an effect without --posterior; --seed is accepted by every command.
WITHOUT_POSTERIOR = ("out", "posterior", "seed", "quiet", "verbose", "log_file")


def published(
    context: typer.Context,
    out: shell.Out,
    posterior: Annotated[bool, typer.Option("--posterior", help="Also fit Tables 9 and 11 themselves.")] = False,
    chains: shell.Chains = 4,
    warmup: shell.Warmup = 1000,
    draws: shell.Draws = None,
    target_accept: shell.TargetAccept = None,
    seed: shell.Seed = 0,
    interval: shell.Interval = 0.95,
    priors: PriorsOption = None,
    quiet: shell.Quiet = False,
) -> None:
    """Recompute what the source prints and can be recomputed; --posterior fits its Tables 9 and 11 (kN/mm, mm).

    Writes published_check.csv (quantity, source, kind, published, recomputed, tolerance, agrees) and posterior/.

    Example: bayes-tyre published --out results/published --posterior
    """
    began = time.monotonic()
    if not posterior and (name := shell.given_beside(context, WITHOUT_POSTERIOR)):
        shell.warn(f"{name} has no effect without --posterior")
    prepare_jax(chains)
    from bayes_tyre.workflow.published import agreement_lines, check_published

    if posterior:
        from bayes_tyre.workflow.fit import fit_published_tables, read_priors

        prior_settings = read_priors(priors)  # before minutes of work, like the folder
        check_folder(out / "posterior")
    check = check_published(out)
    shell.say(f"wrote {out / 'published_check.csv'}", quiet)
    for line in agreement_lines(check):
        shell.say(f"  {line}", quiet)
    trusted = bool(check["agrees"].all())
    if posterior:
        settings = sampled.settings(chains, warmup, draws, seed, target_accept, default=2000)
        with shell.stages(quiet) as stages:
            callbacks = sampled.callbacks(stages, quiet, began)
            diagnostics = fit_published_tables(
                out / "posterior", settings, interval, sys.argv[1:], prior_settings, callbacks
            )
        sampled.report_verdict(diagnostics, f"wrote {out / 'posterior'}", quiet)
        if not quiet:
            from bayes_tyre.report.terminal.results_table import print_overview

            with suppress(BadInput):  # the verdict already names a table that failed
                print_overview([out / "posterior"])
        trusted = trusted and diagnostics.verdict == "pass"
    if not trusted:
        raise typer.Exit(shell.NOT_TRUSTED)


def campaign(
    out: Annotated[Path, typer.Option(help="Record table to write (.csv or .parquet); its truth goes beside it.")],
    seed: Annotated[int | None, typer.Option(min=0, help="Another campaign than the one in data/campaign.")] = None,
    quiet: shell.Quiet = False,
) -> None:
    """Reconstruct records from the published tables: 48 cases x 3 repeats (mm, kN). Nothing in it was measured.

    Least squares on it returns the printed k and beta. The same file comes out every time.

    Example: bayes-tyre campaign --out data/campaign/records.csv
    """
    from bayes_tyre.workflow.published import write_campaign

    for path in write_campaign(out, seed):
        shell.say(f"wrote {path} (reconstructed, not measured)", quiet)
