"""Least-squares fits of a record table: `least_squares.csv`."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd

from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.tables import write_table
from bayes_tyre.formats.workbook import write_workbook
from bayes_tyre.inference.least_squares.table import FitSettings, fit_records


def fit_least_squares(
    table: pd.DataFrame, settings: FitSettings, out: Path, on_progress: Callable[[int], None], *, xlsx: bool = False
) -> pd.DataFrame:
    """Write `least_squares.csv` into `out`, and as a workbook if asked for; return it."""
    prepare_folder(out)
    fits = fit_records(table, settings, on_progress)
    write_table(fits, out / "least_squares.csv")
    (out / "least_squares.xlsx").unlink(missing_ok=True)  # an older run's
    if xlsx:
        write_workbook({"least_squares": fits}, out / "least_squares.xlsx")
    return fits
