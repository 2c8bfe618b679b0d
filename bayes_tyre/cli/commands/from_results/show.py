"""`show`: a short table of results on disk."""

from contextlib import nullcontext, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli.shell import LimitOption, NoSeed, checked_limit


def show(
    results: Annotated[
        list[Path],
        typer.Argument(
            help="Folders that fit, motion, published --posterior, lsq or load-deflection wrote; with --truth fit, "
            "motion or lsq."
        ),
    ],
    truth: Annotated[
        Path | None,
        typer.Option(help="truth.csv of simulate: print k and beta of each record beside it, and the errors in %."),
    ] = None,
    limit: LimitOption = None,
    seed: NoSeed = 0,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Print nothing; only check that the results can be read.")
    ] = False,
) -> None:
    """Print k (kN/mm) and beta (mm) by configuration and direction, with intervals, from results on disk.

    Of lsq and load-deflection it prints the first 20 rows of each table, with standard errors, units and status.

    Example: bayes-tyre show results/published/posterior results/fit --limit "k >= 1.8"
    """
    del seed
    if limit is not None and truth is not None:
        raise typer.BadParameter("is of posteriors; leave --truth out", param_hint="--limit")
    limit = checked_limit(limit)
    with redirect_stdout(StringIO()) if quiet else nullcontext():
        if truth is not None:
            from bayes_tyre.report.terminal.recovery_table import print_recovery

            print_recovery(results, truth)
            return
        from bayes_tyre.report.terminal.results_table import print_overview

        print_overview(results)
        if limit is not None:
            from bayes_tyre.workflow.from_results.limits import limits_of

            for sentence in limits_of(results, limit):
                typer.echo(sentence)
