"""Writing a result's folder: every file whole or not at all, `run.json` last."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import pandas as pd

from bayes_tyre.formats.files import prepare_folder, remove_leftovers, write_bytes
from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.formats.tables.table_files import write_table
from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.diagnostics.judge import with_failures
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.sampling.record_draws import thin_records
from bayes_tyre.inference.sampling.run import sampler_runs
from bayes_tyre.record_table import record_extras
from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.report.html.figures import HEADINGS
from bayes_tyre.results import summary
from bayes_tyre.results.comparison.law_weights import LAWS_CSV
from bayes_tyre.results.derived import with_derived
from bayes_tyre.results.figure_data.motion_traces import MOTIONS_CSV
from bayes_tyre.results.provenance import RUN_JSON, Run, write_json, write_run
from bayes_tyre.workflow.drawing import Begin, drawing_process
from bayes_tyre.workflow.execution.resume import Callbacks
from bayes_tyre.workflow.result_names import COMPARISON, REPORTS

#: All tables of a result, a sheet each.
WORKBOOK = "results.xlsx"
#: What other commands wrote about the result that a new one replaces.
_ABOUT_OLDER = (
    *REPORTS,
    *("prediction.csv", "prediction.toml", COMPARISON, "comparison_records.csv", "comparison_cases.csv"),
)
#: Tables that a result of motions has.
_OF_MOTIONS = {"estimates.csv", MOTIONS_CSV, LAWS_CSV}
#: Fewest records of a result whose figures are drawn by a process of their own: it takes seconds to start.
DRAWN_APART = 48


def write_fit(
    result: Result,
    diagnostics: Diagnostics,
    run: Run,
    out: Path,
    beside: Mapping[str, pd.DataFrame] | None = None,
    *,
    xlsx: bool = False,
    callbacks: Callbacks | None = None,
    record_draws: int | None = None,
) -> Diagnostics:
    """Write a posterior with its tables, diagnostics and figures into `out`; return the diagnostics that were written.

    Tables come first, then the posterior and the figures, those of many records drawn by a process of their own. A
    table or figure that fails becomes a failed check, and what was not written is removed if an older run left it.

    Parameters
    ----------
    result, diagnostics, run:
        The posterior with what its figures need, its diagnostics, and how it was computed.
    beside:
        Further tables, by the names of their files.
    xlsx:
        Write the tables as one workbook too.
    callbacks:
        Called as stages begin, and once tables and diagnostics are written, with the verdict that stands unless a
        figure fails.
    record_draws:
        Draws of each record in `posterior.nc`, as `thin_records` takes them; tables and figures are of all draws.
    """
    prepare_folder(out)
    for name in (RUN_JSON, *_ABOUT_OLDER):  # run.json first: it marks a folder as finished
        (out / name).unlink(missing_ok=True)
    written = (RUN_JSON, "diagnostics.json", "posterior.nc", WORKBOOK, *_tables(result, beside or {}))
    for name in _OF_MOTIONS.difference(written):
        (out / name).unlink(missing_ok=True)
    remove_leftovers(out / name for name in (*written, *(f"figures/{name}.png" for name in HEADINGS)))
    attempts, callbacks = Attempts(), callbacks or Callbacks()
    callbacks.on_stage("tables", None)
    with drawing_process(_records(result) >= DRAWN_APART) as begin:

        def settled(result: Result, *parts: Callable[[Result], None]) -> tuple[Result, Diagnostics]:
            """Write parts, the last one for the first time; all of them again where it fails: they say so too."""
            parts[-1](result)
            judged = with_failures(diagnostics, attempts.failed)
            if judged.verdict != result.verdict:
                result = replace(result, verdict=judged.verdict)
                for part in parts:
                    part(result)
            return result, judged

        def tables(result: Result) -> None:
            _write_tables(result, out, beside or {}, xlsx, attempts)

        def figures(result: Result) -> None:
            _write_figures(result, out / "figures", attempts, begin, callbacks)

        result, judged = settled(result, tables)
        write_json(judged._asdict(), out / "diagnostics.json")
        callbacks.answer(judged)
        callbacks.on_stage("posterior", None)
        tree = attempts("derived quantities", lambda: with_derived(result.tree), result.tree)
        write_tree(thin_records(tree, record_draws), out / "posterior.nc")
        result, judged = settled(result, tables, figures)
    write_json(judged._asdict(), out / "diagnostics.json")
    write_run(run, out, sampler_runs(result.tree), jax.default_backend())
    return judged


def _records(result: Result) -> int:
    return 0 if result.table is None else result.table["record"].nunique()


def _write_tables(
    result: Result, out: Path, beside: Mapping[str, pd.DataFrame], xlsx: bool, attempts: Attempts
) -> None:
    sheets: dict[str, pd.DataFrame] = {}

    def workbook() -> Path:
        from bayes_tyre.formats.tables.workbook_writer import write_workbook  # imports what most runs do not need

        return write_workbook(sheets, out / WORKBOOK)

    def write(name: str, table: Callable[[], pd.DataFrame]) -> Path:
        sheets[Path(name).stem] = table()
        return write_table(sheets[Path(name).stem], out / name)

    for name, table in _tables(result, beside).items():
        if attempts(name, partial(write, name, table), None) is None:
            (out / name).unlink(missing_ok=True)
    if not xlsx or attempts(WORKBOOK, workbook, None) is None:
        (out / WORKBOOK).unlink(missing_ok=True)


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


def _write_figures(result: Result, folder: Path, attempts: Attempts, begin: Begin, callbacks: Callbacks) -> None:
    """Write the figures of a result; remove those of an earlier result that this one does not have."""
    callbacks.on_stage("data of the figures", None)
    drawn = {name: begin(drawing) for name, drawing in catalogue.drawings(result, attempts)}
    callbacks.on_stage("figures", len(drawn))
    written = set()
    # From the last: the process draws from the first, and this one what it has not begun.
    for name, png in reversed(drawn.items()):
        path = folder / f"{name}.png"
        if attempts(path.name, lambda png=png, path=path: write_bytes(png(), path), None) is not None:
            written.add(name)
        callbacks.on_progress(1)
    for name in HEADINGS.keys() - written:
        (folder / f"{name}.png").unlink(missing_ok=True)
