"""Writing a result's folder: every file whole or not at all, `run.json` last."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd
import xarray as xr

from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.formats.tables import write_table
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.record_table import record_extras
from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.report.figures.layout import save
from bayes_tyre.report.html.figures import HEADINGS
from bayes_tyre.results import summary
from bayes_tyre.results.motion_traces import MOTIONS_CSV
from bayes_tyre.results.provenance import RUN_JSON, Run, write_json, write_run


def write_fit(
    tree: xr.DataTree,
    diagnostics: Diagnostics,
    run: Run,
    out: Path,
    *,
    table: pd.DataFrame | None = None,
    printed: pd.DataFrame | None = None,
    interval: float = 0.95,
    beside: Mapping[str, pd.DataFrame] | None = None,
    motions: pd.DataFrame | None = None,
) -> None:
    """Write a posterior with its tables, diagnostics and figures into `out`.

    Parameters
    ----------
    tree, diagnostics, run:
        The posterior, its verdict, and how it was computed.
    table:
        The records it was fitted to, for the figures of records.
    printed:
        Printed `k_kN_per_mm` and `beta_mm` by case, shown beside the posterior where given.
    interval:
        Probability of every interval, equal-tailed.
    beside:
        Further tables, by the names of their files.
    motions:
        Readings and fitted motion of a few records, for their figures (`bayes_tyre.results.motion_traces`).
    """
    prepare_folder(out)
    (out / RUN_JSON).unlink(missing_ok=True)  # of an older run: it marks a folder as finished
    verdict = diagnostics.verdict
    write_tree(tree, out / "posterior.nc")
    extras = record_extras(table) if table is not None else None
    result = Result(tree, verdict, table, printed, interval, motions)
    write_table(summary.summary(tree, verdict, interval), out / "summary.csv")
    write_table(result.cases, out / "cases.csv")
    write_table(result.contrasts, out / "contrasts.csv")
    write_table(summary.repeats(tree, verdict, interval, extras), out / "repeats.csv")
    for name, further in (beside or {}).items():
        write_table(further, out / name)
    if motions is not None:
        write_table(motions, out / MOTIONS_CSV)
    write_json(diagnostics._asdict(), out / "diagnostics.json")
    _write_figures(result, out / "figures")
    write_run(run, out)


def _write_figures(result: Result, folder: Path) -> None:
    """Write the figures of a result; remove those of an earlier result that this one does not have."""
    drawn = {name: save(figure, folder / f"{name}.png") for name, figure in catalogue.draw(result)}
    for name in HEADINGS.keys() - drawn.keys():
        (folder / f"{name}.png").unlink(missing_ok=True)
