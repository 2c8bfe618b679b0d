"""`report.html` of fits without a posterior (`lsq`, `load-deflection`): their tables, and the figures beside them."""

import math
from collections.abc import Sequence

from bayes_tyre.report.answer.caveats import origin_sentence
from bayes_tyre.report.answer.formatting import label, rounded
from bayes_tyre.report.html.figures import EmbeddedFigure
from bayes_tyre.report.html.letterhead import NONE, Letterhead
from bayes_tyre.report.html.page import rendered
from bayes_tyre.report.html.tables import Cell, Column, Table, number
from bayes_tyre.results import separate_fits
from bayes_tyre.results.separate_fits import FitTable

_LONGEST_STATUS = 2000


def fits_document(tables: Sequence[FitTable], figures: Sequence[EmbeddedFigure], head: Letterhead = NONE) -> str:
    """Return the page of one folder's tables and figures, with what stands above it."""
    origins = dict.fromkeys(part for table in tables for part in table.origin.split(" + "))
    captions = ", ".join(table.caption for table in tables)
    return rendered(
        "fits.html.j2",
        head,
        title=f"{captions[0].upper()}{captions[1:]}",
        origins=[(each, origin_sentence(each)) for each in origins],
        tables=[_shown(f"table{i}", table) for i, table in enumerate(tables)],
        figures=figures,
    )


def _shown(name: str, table: FitTable) -> Table:
    columns = [Column("", label(each.name), each.unit, number=not each.is_text) for each in table.columns]
    status = [Cell(label(each, _LONGEST_STATUS), each) for each in table.status]
    rows = [list(row) for row in zip(*map(_cells, table.columns), status, strict=True)]
    caption = f"{table.caption[0].upper()}{table.caption[1:]}: {len(rows)}, {table.not_ok} not ok"
    return Table(name, caption, [*columns, Column("", "status", "", number=False)], rows)


def _cells(column: separate_fits.Column) -> list[Cell]:
    if column.is_text:
        return [Cell(label(each), each) for each in column.values]
    errors = (rounded(each) for each in column.errors)
    reaches = (f"\N{PLUS-MINUS SIGN} {error}" if error else "" for error in errors)
    counts = not column.unit and all(float(each).is_integer() for each in column.values if math.isfinite(each))
    show = "{:.0f}".format if counts else rounded
    return [number(value, show)._replace(reach=reach) for value, reach in zip(column.values, reaches, strict=True)]
