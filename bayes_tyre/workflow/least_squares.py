"""Least-squares fits of a record table: `least_squares.csv`."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd

from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.tables import write_table
from bayes_tyre.inference.least_squares.table import FitSettings, fit_records

FITS = "least_squares.csv"
#: What `bayes_tyre.workflow.loops` writes beside it.
LOOPS, BACKBONE, FIGURE = "loops.csv", "backbone.csv", "figures/loops.png"


def fit_least_squares(
    table: pd.DataFrame, settings: FitSettings, out: Path, on_progress: Callable[[int], None]
) -> pd.DataFrame:
    """Write `least_squares.csv` into `out`; return it. What an older run on loops left there is removed."""
    prepare_folder(out)
    fits = fit_records(table, settings, on_progress)
    for name in (LOOPS, BACKBONE, FIGURE):
        (out / name).unlink(missing_ok=True)
    write_table(fits, out / FITS)
    return fits
