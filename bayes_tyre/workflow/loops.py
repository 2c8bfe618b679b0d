"""Least-squares fits of driven curves: a row a branch, their closed cycles, backbones and a figure."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from bayes_tyre.formats.files import prepare_folder
from bayes_tyre.inference.least_squares.loops import backbone, cycle_table, law_curves
from bayes_tyre.inference.least_squares.table import FitSettings, fit_records
from bayes_tyre.record_table import check_record_table, origin_of
from bayes_tyre.report.figures.loops import driven_loops
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.layout import save
from bayes_tyre.signals.reversals import cut_loops
from bayes_tyre.workflow.least_squares import BACKBONE, FIGURE, LOOPS, write_fits
from bayes_tyre.workflow.record_tables import RECORDS, read_given


def read_loops(
    paths: Sequence[Path], columns: Path | None, on_note: Callable[[str], None]
) -> tuple[pd.DataFrame, list[str]]:
    """Return the branches of the driven curves in record tables on disk (`cut_loops`), and suspicions of their units.

    Directions and steps in the tables are left out: a curve has both directions. A table without a column `record` is
    one curve, named as its file. The rest as in `bayes_tyre.workflow.record_tables.read_given`; what was converted or
    left out goes to `on_note`.
    """
    given = read_given(paths, columns, _CURVES)
    for note in given.notes:
        on_note(note)
    return cut_loops(given.table), given.suspicions


def _check_curves(table: pd.DataFrame, name: str) -> pd.DataFrame:
    table = table.drop(columns=["direction", "step_kN"], errors="ignore")
    if "record" not in table:
        table["record"] = Path(name).stem
    return check_record_table(table, name)


_CURVES = RECORDS._replace(check=_check_curves)


def fit_loops(
    branches: pd.DataFrame, settings: FitSettings, out: Path, on_progress: Callable[[int], None], *, xlsx: bool = False
) -> None:
    """Write fits of branches, their closed cycles, backbones and a figure into `out`.

    Parameters
    ----------
    branches:
        As `read_loops` returns them.
    """
    prepare_folder(out)
    fits = fit_records(branches, settings, on_progress).astype({"branch": int, "cycle": int})
    backbones = backbone(branches)
    cycles = cycle_table(branches, fits, backbones)
    write_fits(fits, out, {LOOPS: cycles, BACKBONE: backbones}, xlsx=xlsx)
    configurations = branches["configuration"].unique() if "configuration" in branches else [""]
    setting = Setting(origin_of(branches), configurations=tuple(configurations))
    save(driven_loops(branches, law_curves(branches, fits), backbones, setting), out / FIGURE)
