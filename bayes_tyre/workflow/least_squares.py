"""Least-squares fits of a record table: `least_squares.csv`."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd

from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.inference.least_squares.table import FitSettings, fit_records
from bayes_tyre.workflow.result_names import REPORTS

FITS, WORKBOOK = "least_squares.csv", "least_squares.xlsx"
#: What `bayes_tyre.workflow.loops` writes beside it.
LOOPS, BACKBONE, FIGURE = "loops.csv", "backbone.csv", "figures/loops.png"


def fit_least_squares(
    table: pd.DataFrame, settings: FitSettings, out: Path, on_progress: Callable[[int], None], *, xlsx: bool = False
) -> pd.DataFrame:
    """Write `least_squares.csv` into `out`, and as a workbook if asked for; return it.

    What an older run, or one on loops, left there is removed.
    """
    prepare_folder(out)
    fits = fit_records(table, settings, on_progress)
    write_fits(fits, out, xlsx=xlsx)
    return fits


def write_fits(fits: pd.DataFrame, out: Path, beside: Mapping[str, pd.DataFrame] | None = None, *, xlsx: bool) -> None:
    """Write `least_squares.csv` and tables beside it into a folder that is there, and as a workbook if asked for.

    What an older run left there is removed.
    """
    tables = {FITS: fits, **(beside or {})}
    for name in (LOOPS, BACKBONE, FIGURE, WORKBOOK, *REPORTS):
        (out / name).unlink(missing_ok=True)
    for name, table in tables.items():
        write_table(table, out / name)
    if xlsx:
        from bayes_tyre.formats.tables.workbook_writer import write_workbook  # imports what most runs do not need

        write_workbook({Path(name).stem: table for name, table in tables.items()}, out / WORKBOOK)
