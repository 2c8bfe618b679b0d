"""`show`: the short table of results on disk."""

from pathlib import Path
from typing import Annotated

import typer


def show(
    results: Annotated[list[Path], typer.Argument(help="Folders that fit or published --posterior wrote.")],
) -> None:
    """Print k (kN/mm) and beta (mm) by configuration and direction, with intervals, from results on disk.

    Example: bayes-tyre show results/published/posterior results/fit
    """
    from bayes_tyre.report.overview import print_overview

    print_overview(results)
