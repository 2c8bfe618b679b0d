"""Writing a result's folder: every file whole or not at all, `run.json` last."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd

from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.formats.tables.workbook_writer import write_workbook
from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.judge import with_failures
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.sampling.run import sampler_runs
from bayes_tyre.record_table import record_extras
from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.report.figures.page.layout import save
from bayes_tyre.report.html.figures import HEADINGS
from bayes_tyre.results import summary
from bayes_tyre.results.figure_data.motion_traces import MOTIONS_CSV
from bayes_tyre.results.provenance import RUN_JSON, Run, write_json, write_run

#: All tables of a result, a sheet each.
WORKBOOK = "results.xlsx"


def write_fit(
    result: Result,
    diagnostics: Diagnostics,
    run: Run,
    out: Path,
    beside: Mapping[str, pd.DataFrame] | None = None,
    *,
    xlsx: bool = False,
) -> Diagnostics:
    """Write a posterior with its tables, diagnostics and figures into `out`; return the diagnostics that were written.

    A table or figure that fails becomes a failed check, and what was not written is removed if an older run left it.

    Parameters
    ----------
    result, diagnostics, run:
        The posterior with what its figures need, its diagnostics, and how it was computed.
    beside:
        Further tables, by the names of their files.
    xlsx:
        Write the tables as one workbook too.
    """
    prepare_folder(out)
    (out / RUN_JSON).unlink(missing_ok=True)  # of an older run: it marks a folder as finished
    write_tree(result.tree, out / "posterior.nc")
    judged = _write_tables_and_figures(result, diagnostics, out, beside or {}, xlsx)
    if judged.verdict != result.verdict:  # tables and figures say so too
        judged = _write_tables_and_figures(
            replace(result, verdict=judged.verdict), diagnostics, out, beside or {}, xlsx
        )
    write_json(judged._asdict(), out / "diagnostics.json")
    write_run(run, out, sampler_runs(result.tree))
    return judged


def _write_tables_and_figures(
    result: Result, diagnostics: Diagnostics, out: Path, beside: Mapping[str, pd.DataFrame], xlsx: bool
) -> Diagnostics:
    attempts = Attempts()
    sheets: dict[str, pd.DataFrame] = {}

    def write(name: str, table: Callable[[], pd.DataFrame]) -> Path:
        sheets[Path(name).stem] = table()
        return write_table(sheets[Path(name).stem], out / name)

    for name, table in _tables(result, beside).items():
        if attempts(name, partial(write, name, table), None) is None:
            (out / name).unlink(missing_ok=True)
    if not xlsx or attempts(WORKBOOK, lambda: write_workbook(sheets, out / WORKBOOK), None) is None:
        (out / WORKBOOK).unlink(missing_ok=True)
    _write_figures(result, out / "figures", attempts)
    return with_failures(diagnostics, attempts.failed)


def _tables(result: Result, beside: Mapping[str, pd.DataFrame]) -> dict[str, Callable[[], pd.DataFrame]]:
    """Return what computes each table, by the name of its file."""
    tree, verdict, interval = result.tree, result.verdict, result.interval
    further = {**beside, **({} if result.motions is None else {MOTIONS_CSV: result.motions})}

    def repeats() -> pd.DataFrame:
        extras = record_extras(result.table) if result.table is not None else None
        return summary.repeats(tree, verdict, interval, extras)

    return {
        "summary.csv": lambda: summary.summary(tree, verdict, interval),
        "cases.csv": lambda: result.cases,
        "contrasts.csv": lambda: result.contrasts,
        "repeats.csv": repeats,
        **{name: lambda table=table: table for name, table in further.items()},
    }


def _write_figures(result: Result, folder: Path, attempts: Attempts) -> None:
    """Write the figures of a result; remove those of an earlier result that this one does not have."""
    written = set()
    for name, figure in catalogue.draw(result, attempts):
        path = folder / f"{name}.png"
        if attempts(path.name, lambda figure=figure, path=path: save(figure, path), None) is not None:
            written.add(name)
    for name in HEADINGS.keys() - written:
        (folder / f"{name}.png").unlink(missing_ok=True)
