"""The HTML report of result folders: `report.html`, and printed: `report.pdf`."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, write_bytes, write_text
from bayes_tyre.formats.images import read_image
from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.inference.diagnostics.attempts import Attempts
from bayes_tyre.inference.model.prepared_records import used_points
from bayes_tyre.inference.sampling.datatree import is_of_motions
from bayes_tyre.published import tables
from bayes_tyre.report.answer.load import Reported, read_reported
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.report.html.between_results import ComparedResult, compare_results, has_cases
from bayes_tyre.report.html.figures import data_uri, embedded_figures, stored_figures
from bayes_tyre.report.html.fits_page import fits_document
from bayes_tyre.report.html.letterhead import NONE, Letterhead
from bayes_tyre.report.html.page import Part, document
from bayes_tyre.results.figure_data.motion_traces import MOTIONS_CSV, check_readings
from bayes_tyre.results.provenance import RUN_JSON
from bayes_tyre.results.separate_fits import read_separate_fits
from bayes_tyre.workflow.fit import planned_in
from bayes_tyre.workflow.from_results.pdf import find_browser, printed_page
from bayes_tyre.workflow.record_tables import read_given
from bayes_tyre.workflow.result_names import names

NAME, SUFFIXES = "report.html", (".html", ".htm")
#: Note on figures that the fit drew and that cannot be drawn again.
KEPT = "Figures of records are as the fit drew them: its input was not found, or has changed."
#: Note on figures of the fit beside tables of another reference.
RATIOS_NOT_TURNED = (
    "Ratios in the figures are as the fit drew them: they may be over another configuration than in the tables."
)

UNTRUSTED = "the posterior is not to be trusted; its report says why"


def target(folder: Path, out: Path | None) -> Path:
    """Return the page to write: `out`, or `report.html` in it where it is a folder, or in the first result's folder.

    Raises
    ------
    BadInput
        If it cannot be written there, or has the suffix of another kind of file.
    """
    out = out or folder
    path = out if out.suffix.lower() in SUFFIXES and not out.is_dir() else out / NAME
    if path.parent == out and out.suffix and not out.exists():
        raise BadInput(f"--out {out}: a report is written as HTML; name an .html file or a folder; --pdf prints it too")
    check_folder(path.parent)
    if path.is_dir():
        raise BadInput(f"--out {path}: a folder is in the place of a file; name another")
    return path


def letterhead(title: str, order: str, operator: str, logo: Path | None) -> Letterhead:
    """Return what stands above a report; a logo that is no image, or too large, is refused as `BadInput`."""
    image = None if logo is None else read_image(logo, "--logo")
    return Letterhead(title, order, operator, "" if image is None else data_uri(*image))


def write_report(
    folders: Sequence[Path],
    out: Path | None,
    on_note: Callable[[str], None] = lambda _: None,
    on_drawing: Callable[[Path], None] = lambda _: None,
    on_progress: Callable[[int], None] = lambda _: None,
    *,
    kept_figures: bool = False,
    reference: str | None = None,
    head: Letterhead = NONE,
    pdf: bool = False,
) -> tuple[list[Path], list[str]]:
    """Write the report of one result, or of several with a comparison; return its files, and what not to trust.

    The latter a line each: a result whose verdict is ``fail``, and a figure that could not be drawn.

    Parameters
    ----------
    folders, out:
        What `fit` or `motion` wrote, or one that `lsq` or `load-deflection` wrote; and where the page goes (`target`).
    on_note:
        Called with what the user should know, a line each.
    on_drawing:
        Called with a folder before its figures are drawn.
    on_progress:
        Called with 1 after each folder.
    kept_figures:
        Show the figures as they lie in the folders instead of drawing them again.
    reference:
        The configuration below in each ratio; None: as in the fit.
    head:
        What stands above the page.
    pdf:
        Print the page by a browser too, beside it.

    Raises
    ------
    BadInput
        If a result has no such configuration, a folder holds no finished result, is named twice, or the page cannot be
        written; if it is to be printed and there is no browser; for options of posteriors where there is none. Nothing
        is written then.
    """
    browser = find_browser() if pdf else None
    if len(folders) == 1 and (fits := read_separate_fits(folders[0])):
        for given, option in ((reference is not None, "--reference"), (kept_figures, "--kept-figures")):
            if given:
                raise BadInput(f"{folders[0]}: holds no posterior, which {option} is of; leave the option out")
        figures = stored_figures(folders[0] / "figures", set())
        return _written(fits_document(fits, list(figures), head), target(folders[0], out), browser), []
    read = [read_reported(folder, name) for folder, name in zip(folders, names(folders), strict=True)]
    results = [result.referred_to(reference) for result in read]
    path = target(folders[0], out)
    parts, compared_results, warnings = [], [], []
    for folder, result in zip(folders, results, strict=True):
        tree = read_tree(folder / "posterior.nc")
        if kept_figures or not has_cases(tree):  # only posteriors with cases have such figures
            note = "" if reference is None else RATIOS_NOT_TURNED
            parts.append(Part(result, list(stored_figures(folder / "figures", set())), note))
        else:
            attempts = Attempts()
            on_drawing(folder)
            parts.append(_drawn(folder, result, tree, on_note, attempts))
            warnings += [f"{result.name}: {check.reason}" for check in attempts.failed]
        compared_results.append(ComparedResult(result.name, tree if has_cases(tree) else None, result.run))
        on_progress(1)
    comparisons = [compare_results(compared_results[0], other, results[0].interval) for other in compared_results[1:]]
    written = _written(document(parts, comparisons, head), path, browser)
    untrusted = [f"{each.name}: {UNTRUSTED}" for each in results if each.verdict == "fail"]
    return written, [*untrusted, *warnings]


def _written(page: str, path: Path, browser: str | None) -> list[Path]:
    """Write a page, and with a browser its print beside it; return the files.

    An older `report.pdf` is no print of a new `report.html`, and goes.
    """
    if browser is None:
        if path.name == NAME:
            path.with_suffix(".pdf").unlink(missing_ok=True)
        return [write_text(page, path)]
    printed = printed_page(page, browser)
    return [write_text(page, path), write_bytes(printed, path.with_suffix(".pdf"))]


def _drawn(
    folder: Path, result: Reported, tree: xr.DataTree, on_note: Callable[[str], None], attempts: Attempts
) -> Part:
    of_motions = is_of_motions(tree["posterior"].to_dataset())
    table = None if of_motions else _records(folder, result, on_note)
    # As in the fit: only records made from the printed tables, and these tables, are compared with printed values.
    printed = tables.case_means() if result.run["origin"] in ("reconstructed", "published") else None
    result_drawn = Result(
        tree, result.verdict, table, printed, result.interval, _motions(folder), reference=result.reference or None
    )
    missing = table is None and not result.repeats.empty and not of_motions
    figures = list(embedded_figures(result_drawn, folder / "figures", attempts))
    return Part(result, figures, " ".join([KEPT] * missing + [f"{check.reason}." for check in attempts.failed]))


def _motions(folder: Path) -> pd.DataFrame | None:
    """Return readings and fitted motion of a few records; None where the result is of no motions."""
    path = folder / MOTIONS_CSV
    return check_readings(read_table(path), str(path)) if path.is_file() else None


def _records(folder: Path, result: Reported, on_note: Callable[[str], None]) -> pd.DataFrame | None:
    """Return the records that were fitted; None for a posterior without records, or where the file is missing."""
    if result.repeats.empty:
        return None
    try:
        plan = planned_in(folder / RUN_JSON, lambda _: None)
        table = used_points(read_given(plan.records, plan.columns).table, plan.model.region)
    except BadInput as error:
        on_note(f"figures of records are as the fit drew them: {error}")
        return None
    return table
