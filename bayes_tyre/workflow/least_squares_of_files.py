"""Least-squares fits of many tables, each by itself: by several processes here, or on a cluster.

Only the rows of `least_squares.csv` come back of a table, so that an archive need not fit into the memory.
"""

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.tables.column_map import ColumnMap, read_column_map
from bayes_tyre.formats.tables.workbook import split_sheet
from bayes_tyre.inference.least_squares.table import FitSettings, fit_records
from bayes_tyre.runtime import prepare_jax
from bayes_tyre.workflow.execution.batch import Machines, run_batch
from bayes_tyre.workflow.execution.outcome import Done, Fault, attempted
from bayes_tyre.workflow.execution.task_cache import TaskCache
from bayes_tyre.workflow.least_squares import FITS, write_fits
from bayes_tyre.workflow.record_tables import (
    Given,
    check_columns,
    check_names,
    of_files,
    our_columns,
    read_one,
    table_files,
)

#: Attributes of a part: what is said of its file, and which of our columns it has.
_SUSPICIONS, _NOTES, _COLUMNS = "suspicions", "notes", "columns"


class TableTask(NamedTuple):
    """The task of one table: a `bayes_tyre.workflow.execution.outcome.FileTask`.

    Attributes
    ----------
    table:
        The file, absolute; of a workbook with its sheet.
    columns, settings:
        The column map, and how to fit.
    several:
        Whether there are other tables: one without a column `record` is then one record.
    figure:
        None: there is none.
    """

    table: Path
    columns: ColumnMap
    settings: FitSettings
    several: bool
    figure: Path | None = None

    @property
    def file(self) -> Path:
        """The file that the table is in."""
        return split_sheet(self.table)[0]

    def decides(self) -> dict[str, object]:
        """Return what determines the fits beside the file's content."""
        of_table = {"sheet": split_sheet(self.table)[1], "name": self.table.stem, "several": self.several}
        return {**of_table, "columns": self.columns.options, "settings": dataclasses.asdict(self.settings)}


def table_tasks(
    paths: Sequence[Path], columns: Path | None, settings: FitSettings
) -> tuple[list[TableTask], list[str]]:
    """Return a task for each table in files and folders, and what is said of tables that were skipped.

    Raises
    ------
    BadInput
        For a column map that cannot be used, and a folder without a table.
    """
    column_map, (files, notes) = read_column_map(columns), table_files(paths)
    return [TableTask(file.absolute(), column_map, settings, len(files) > 1) for file in files], notes


def fit_files(
    tasks: Sequence[TableTask], machines: Machines, out: Path, on_progress: Callable[[int], None], *, xlsx: bool = False
) -> Given:
    """Write `least_squares.csv` into `out`, and as a workbook if asked for; return it, and what is said of the files.

    The same to the byte whatever the machines, and whether or not a run was interrupted; estimates are those of
    `fit_records` but for last digits, because other records are in a batch with them.

    Parameters
    ----------
    tasks:
        As `table_tasks` gives them.
    machines:
        Processes or cluster; whether to do only what is missing since the last run with this `out`.
    out, xlsx:
        The folder, and whether to write a workbook.
    on_progress:
        Called with 1 after each table.

    Raises
    ------
    BadInput
        For a table that cannot be used, a record that stands in two, and a column that some tables lack; nothing is
        written then.
    """
    prepare_folder(out)
    outcomes = run_batch(fit_file, tasks, TaskCache(out / FITS), machines, on_progress)
    files = [task.table for task in tasks]
    for file, outcome in zip(files, outcomes, strict=True):
        if isinstance(outcome, Fault):
            raise BadInput(f"{file}: {outcome.reason.removeprefix(f'{file}: ')}")
    fits = [pd.read_parquet(outcome) for outcome in outcomes if isinstance(outcome, Path)]
    check_columns(files, [table.attrs[_COLUMNS] for table in fits])
    check_names(files, fits)
    suspicions = of_files(files, [table.attrs[_SUSPICIONS] for table in fits], together=False)
    notes = of_files(files, [table.attrs[_NOTES] for table in fits])
    for table in fits:
        table.attrs.clear()
    together = pd.concat(fits, ignore_index=True)
    together["origin"] = together.pop("origin")  # the last column, whatever further ones some tables have
    write_fits(together, out, xlsx=xlsx)
    return Given(together, suspicions, notes)


def fit_file(task: TableTask) -> Done | Fault:
    """Return the fits of a table, or why there are none."""
    prepare_jax()
    return attempted(_done, task)


def _done(task: TableTask) -> Done:
    given = read_one(task.table, task.columns, task.several)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        fits = fit_records(given.table, task.settings)
    notes = [*given.notes, *(str(one.message) for one in caught)]
    fits.attrs = {_SUSPICIONS: given.suspicions, _NOTES: notes, _COLUMNS: our_columns(given.table)}
    return Done(fits)
