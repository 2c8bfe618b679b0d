"""`compare`: models of the same records, ranked by what they predict of a record, or of a case, left out."""

from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli.shell import NOT_TRUSTED, Quiet, progress, say, warn
from bayes_tyre.runtime import prepare_jax


def compare(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR DIR...", help="Folders that fit wrote, of one table; or motion, of the same raw files."
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for comparison.csv; default: the first DIR.")] = None,
    refit: Annotated[
        bool,
        typer.Option(help="Fit again without a record, or case, where importance sampling fails (Pareto k > 0.7)."),
    ] = True,
    quiet: Quiet = False,
) -> None:
    """Compare models by leave-one-out: which best predicts a record, or all records of a case, from the others.

    Of fits it ranks models of one record table, of motions the force laws (motion --law) that the same raw files were
    fitted with. A record's own parameters (k kN/mm, beta mm, J and sigma kN; of a motion all its unknowns) are
    integrated out; of fits, those of a case too (in comparison_cases.csv), as for a case that was not tested. Writes
    comparison.csv (a row a model, the best first: elpd, its standard error, the difference to the best) and
    comparison_records.csv (a row a model and record), and prints the conclusions in a sentence each. Ends with code 4
    where a posterior, or an estimate of records, is not to be trusted.

    Example: bayes-tyre compare results/fit results/fit_student results/fit_normal
    """
    prepare_jax(4)
    from bayes_tyre.results.comparison.model_comparison import rank_lines
    from bayes_tyre.workflow.from_results.compare import compare_folders

    with progress("compare", len(folders), quiet) as advance:
        comparison = compare_folders(folders, out or folders[0], refit=refit, on_note=warn, on_progress=advance)
    for table, sentence in zip(comparison.tables, comparison.sentences, strict=True):
        for line in (*rank_lines(table), sentence):
            say(line, quiet)
    for path in comparison.paths:
        say(f"wrote {path}", quiet)
    for failure in comparison.failed:
        warn(failure)
    for reason in comparison.untrusted:
        warn(reason)
    if comparison.failed or comparison.untrusted:
        raise typer.Exit(NOT_TRUSTED)
