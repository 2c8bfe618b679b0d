"""`show`: a short table of results on disk."""

from contextlib import nullcontext, redirect_stdout
from io import StringIO
from itertools import product
from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli.shell import LimitOption, ReferenceOption, checked_limit
from bayes_tyre.plain_text import one_line


def show(
    results: Annotated[
        list[Path],
        typer.Argument(
            help="Folders that fit, motion, published --posterior, lsq, load-deflection, audit, study, modes, next, "
            "compare or predict wrote; with --truth fit, motion or lsq."
        ),
    ],
    truth: Annotated[
        Path | None,
        typer.Option(help="truth.csv of simulate: print k and beta of each record beside it, and the errors in %."),
    ] = None,
    limit: LimitOption = None,
    reference: ReferenceOption = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Print nothing; only check that the results can be read.")
    ] = False,
) -> None:
    """Print the answer of results on disk: k (kN/mm) and beta (mm) by configuration and direction, with intervals.

    First how much stiffer one configuration is than the other, last what not to believe and the next command. Of lsq
    and load-deflection the first 20 rows of each table, with standard errors, units and status; of audit, study, modes,
    next, compare and predict what the command printed.

    Example: bayes-tyre show results/published/posterior results/fit --limit "k >= 1.8"
    """
    given = [option for option, text in (("--limit", limit), ("--reference", reference)) if text is not None]
    if given and truth is not None:
        raise typer.BadParameter("is of posteriors; leave --truth out", param_hint=given[0])
    limit = checked_limit(limit)
    with redirect_stdout(StringIO()) if quiet else nullcontext():
        if truth is not None:
            from bayes_tyre.report.terminal.recovery_table import print_recovery

            print_recovery(results, truth)
            return
        from bayes_tyre.report.terminal.results_table import print_overview
        from bayes_tyre.workflow.from_results.answers import answer, check_posterior, limits_of, posterior_in

        results = [posterior_in(folder) for folder in results]
        for folder, option in product(results, given):
            check_posterior(folder, option)
        sentences = [] if limit is None else list(limits_of(results, limit))
        answers = [answer(folder) for folder in results]
        print_overview(
            [folder for folder, lines in zip(results, answers, strict=True) if not lines], reference=reference
        )
        for folder, lines in zip(results, answers, strict=True):
            for line in ["", *lines, f"files: {folder}"] if lines else ():
                typer.echo(one_line(line, None))
        for sentence in sentences:
            typer.echo(sentence)
