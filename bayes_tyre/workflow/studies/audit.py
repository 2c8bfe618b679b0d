"""The audit: computation, figures, conclusion and files."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from bayes_tyre.formats.files import prepare_folder, write_text
from bayes_tyre.formats.tables import write_table
from bayes_tyre.published.tables import characteristic_deflection
from bayes_tyre.report.figures import audit as audit_figures
from bayes_tyre.report.figures.layout import save
from bayes_tyre.results.provenance import RUN_JSON, begin_run, write_run
from bayes_tyre.studies.audit import ORIGIN, study_audit
from bayes_tyre.studies.audit_grid import FACTOR_NAMES, PLANS, SOURCE_WINDOW, TYPICAL, WINDOW
from bayes_tyre.studies.audit_overview import overview
from bayes_tyre.studies.audit_sentences import conclusion


class Written(NamedTuple):
    """What the command prints: the overview a method and parameter, and the conclusion's paragraphs."""

    overview: pd.DataFrame
    conclusion: list[str]


def write_audit(
    out: Path,
    plan: str,
    replicates: int,
    seed: int,
    options: Mapping[str, object],
    on_progress: Callable[[int], None],
) -> Written:
    """Write `audit.csv`, `audit_records.csv`, `conclusion.txt` and the figures into `out`.

    Parameters
    ----------
    out:
        Folder, made where it is missing.
    plan:
        A name in `bayes_tyre.studies.audit_grid.PLANS`.
    replicates, seed:
        Records a point, and where their draws start.
    options:
        For `run.json`.
    on_progress:
        Called with 1 after each record.
    """
    prepare_folder(out)
    run = begin_run("bayes-tyre audit", options, seed, [], ORIGIN)
    (out / RUN_JSON).unlink(missing_ok=True)
    result = study_audit(PLANS[plan], replicates, seed, on_progress)
    shown = overview(result.table)
    paragraphs = conclusion(result.table, characteristic_deflection()["beta_mm"].tolist())
    write_table(result.records, out / "audit_records.csv")
    write_table(result.table, out / "audit.csv")
    write_text("\n\n".join(paragraphs) + "\n", out / "conclusion.txt")
    typical = {**TYPICAL._asdict(), WINDOW: SOURCE_WINDOW}
    for name, figure in audit_figures.draw(result.table, shown, FACTOR_NAMES, typical):
        save(figure, out / "figures" / f"{name}.png")
    write_run(run, out)
    return Written(shown, paragraphs)
