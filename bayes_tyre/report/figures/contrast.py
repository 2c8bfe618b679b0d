"""Ratios of k and beta between configurations and between directions, each with its probability to be above 1."""

import textwrap
from collections.abc import Hashable, Mapping
from typing import Any

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.figures.page import case_axis, layout
from bayes_tyre.report.figures.page.colours import INK, Setting
from bayes_tyre.report.figures.page.labels import interval_name, plain
from bayes_tyre.report.figures.page.layout import STYLE
from bayes_tyre.report.wording import AXIS_NAMES, panels, probability_text, text_name
from bayes_tyre.results.columns import numbers, texts
from bayes_tyre.results.contrasts import SAME_CASE

#: Height of a line, inches; the room of the shortest list, lines.
_LINE, _LEAST = 0.17, 8
# Ratios that reach so many times as far stand on a logarithmic axis; what is kept free at the right of the data for
# probabilities, as a share of the data's range, for each panel that shares the width of the page.
_LOG_FROM, _ROOM = 3.0, 0.25


@matplotlib.style.context(STYLE)
def contrasts_by_case(contrasts: pd.DataFrame, setting: Setting, about: str = "") -> Figure:
    """Return the ratios of k, beta and more, a line a ratio: median, interval, and the probability that it is above 1.

    Averages are drawn thick, above the matched cases that they average. Of contrasts between directions only the
    averages are shown: how cases are matched matters more there than which case it is.

    Parameters
    ----------
    contrasts:
        As `contrasts.csv` has them: `contrast`, `matching`, the factors held fixed, `parameter`, `median`, `lower`,
        `upper`, `interval`, `p_greater_than_1`; no unit.
    setting:
        What all figures of the result share.
    about:
        A sentence on what the ratios are of, where it is not plain; it joins the note.
    """
    rows = case_axis.case_factors(contrasts)
    for column in ("contrast", "matching", "parameter"):
        rows[column] = texts(contrasts, column)
    for column in ("median", "lower", "upper", "interval", "p_greater_than_1"):
        rows[column] = numbers(contrasts, column)
    rows["of_case"] = rows[list(CASE_FACTORS[2:])].notna().any(axis=1)
    between_directions = rows["matching"] != SAME_CASE
    rows = rows[rows["parameter"].isin(list(AXIS_NAMES)) & ~(between_directions & rows["of_case"])]
    listed = rows.drop_duplicates(["contrast", "matching", *CASE_FACTORS]).reset_index(drop=True)
    headings = [plain(f"{row['contrast']}, {row['matching']}", 60) for row in listed.to_dict("records")]
    lines = case_axis.list_lines(headings, [_label(row) for row in listed.to_dict("records")])
    listed["y"] = [line.y for line in lines if not line.heads]
    rows = rows.merge(listed[["contrast", "matching", *CASE_FACTORS, "y"]])
    room = max(_LEAST, len(lines))
    parameters = panels(rows["parameter"])
    figure, axes, inches = case_axis.parameter_panels(len(parameters), 1.1, _LINE, room, case_axis.case_axis_name(rows))
    for ax, parameter in zip(axes, parameters, strict=True):
        _panel(ax, rows[rows["parameter"] == parameter], parameter, _ROOM * min(case_axis.ACROSS, len(parameters)))
        if len(parameters) > 2:  # narrow panels: a long name goes on below
            ax.set_xlabel("\n".join(textwrap.wrap(ax.get_xlabel(), 32)))
        case_axis.name_lines(ax, lines, inches, max(case_axis.FEWEST, len(lines)))
    contents = " or ".join(interval_name(one) for one in sorted(set(rows["interval"].dropna()))) or "interval"
    if rows.empty:
        return layout.finish(figure, setting, "No two configurations or directions have cases that match.")
    note = (
        f"Marker: median. Line: {contents}. At the right: probability that the ratio is above 1. Dashed: 1, no "
        f"difference. Thick: averages over the matched cases. {about}"
    )
    return layout.finish(figure, setting, note.rstrip())


def _label(row: Mapping[Hashable, Any]) -> str:
    """Return what a ratio is of: its case, or which cases it averages."""
    if row["of_case"]:
        case = case_axis.case_label(*(row[factor] for factor in CASE_FACTORS[2:]))
        return " ".join(plain(part, 24) for part in (row["configuration"], row["direction"], case) if part)
    fixed = [plain(row[factor], 24) for factor in CASE_FACTORS[:2] if row[factor]]
    return ", ".join(["average", *fixed])


def _panel(ax: Axes, rows: pd.DataFrame, parameter: str, room: float) -> None:
    ax.axvline(1.0, color=INK, linestyle="--", linewidth=0.8)
    for of_case, width, size in ((True, 1.2, 3.0), (False, 2.4, 5.0)):
        mine = rows[rows["of_case"] == of_case]
        ax.hlines(mine["y"], mine["lower"], mine["upper"], color=INK, linewidth=width, alpha=0.6 if of_case else 1.0)
        ax.plot(mine["median"], mine["y"], "o", color=INK, markersize=size)
    for row in rows.to_dict("records"):
        place = {"xycoords": ax.get_yaxis_transform(), "ha": "right", "va": "center", "fontsize": 6.5}
        ax.annotate(probability_text(row["p_greater_than_1"], 2), (0.99, row["y"]), **place)
    values = rows[["lower", "upper"]].to_numpy().ravel()
    values = np.append(values[np.isfinite(values)], 1.0)
    low, high = values.min(), values.max()
    log = bool(low > 0 and high > _LOG_FROM * low)
    if log:
        layout.log_axis(ax, low / 1.05, high * (high / low) ** room)
    else:
        ax.set_xlim(low - 0.05 * (high - low or 1.0), high + room * (high - low or 1.0))
    ax.set_xlabel(f"ratio of {text_name(parameter)} (no unit{', log scale' if log else ''})")
