"""`report`: one HTML page from results on disk."""

from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli.shell import NOT_TRUSTED, Quiet, ReferenceOption, note, progress, say, warn
from bayes_tyre.runtime import prepare_jax


def report(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...",
            help="Folders that fit, motion or published --posterior wrote; or one that lsq or load-deflection wrote.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="HTML file, or a folder for report.html; default: the first DIR.")
    ] = None,
    kept_figures: Annotated[
        bool,
        typer.Option(
            "--kept-figures", help="Show the PNG figures that lie in DIR instead of drawing them again: quicker."
        ),
    ] = False,
    reference: ReferenceOption = None,
    title: Annotated[str, typer.Option(help="Title of the page in place of its own.")] = "",
    order: Annotated[str, typer.Option(help="Order that the tests belong to; stands below the title.")] = "",
    operator: Annotated[str, typer.Option(help="Who ran the tests; stands below the title.")] = "",
    logo: Annotated[
        Path | None,
        typer.Option(help="Image to put beside the title, embedded: PNG, JPEG, GIF, WebP or SVG, 1 MiB at most."),
    ] = None,
    pdf: Annotated[
        bool,
        typer.Option("--pdf", help="Print the page too, to .pdf beside it, by the Chromium, Chrome or Edge on PATH."),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write report.html: the verdict, which tyre is stiffer (k, kN/mm) and how certain that is, tables and figures.

    One file that opens from disk without a network; --pdf prints it too. Several DIRs are compared, each with the
    first: single against dual, or this year's campaign against last year's. Results of motion include friction x (kN)
    and the energy lost (J). Ends with code 4 where a verdict is fail or a figure could not be drawn.

    Example: bayes-tyre report results/fit --out report.html
    """
    prepare_jax()
    from bayes_tyre.plain_text import path_text
    from bayes_tyre.workflow.from_results.report import letterhead, write_report

    head = letterhead(title, order, operator, logo)
    with progress("report", len(folders), quiet) as advance:
        paths, warnings = write_report(
            folders,
            out,
            lambda text: note(text, quiet),
            lambda folder: say(f"drawing the figures of {path_text(folder)}", quiet),
            advance,
            kept_figures=kept_figures,
            reference=reference,
            head=head,
            pdf=pdf,
        )
    for path in paths:
        say(f"wrote {path}", quiet)
    for warning in warnings:
        warn(warning)
    if warnings:
        raise typer.Exit(NOT_TRUSTED)
