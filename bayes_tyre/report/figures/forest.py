"""Lists of cases: k and beta of each, and the probability that each record is discordant."""

import math
import textwrap

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.record import CASE_FACTORS, parameter_column
from bayes_tyre.report.figures.page import case_axis, layout
from bayes_tyre.report.figures.page.case_axis import Line
from bayes_tyre.report.figures.page.colours import INK, Look, Setting
from bayes_tyre.report.figures.page.labels import configuration_label, interval_name, plain
from bayes_tyre.report.figures.page.layout import STYLE, TALLEST, WIDTH
from bayes_tyre.report.wording import AXIS_NAMES, USUAL, WIDE, panels
from bayes_tyre.results.columns import numbers, texts

#: Height of a line in a list, inches; the room of the shortest list, lines.
LINE, LEAST = 0.17, 8
_PRINTED = {"marker": "D", "markersize": 6.5, "markerfacecolor": "none", "markeredgecolor": INK, "linestyle": "none"}


@matplotlib.style.context(STYLE)
def forest_of_cases(cases: pd.DataFrame, printed: pd.DataFrame | None, setting: Setting, about: str = "") -> Figure:
    """Return k, beta and what else is given of every case, a line a case: median, interval, the printed value beside.

    Parameters
    ----------
    cases:
        A row a case and parameter: the case's factors, `parameter` (of `wording.AXIS_NAMES`), `unit`, `median`,
        `lower`, `upper` (kN/mm | mm), `interval` (its content).
    printed:
        A row a case: the case's factors, `k_kN_per_mm` (kN/mm), `beta_mm` (mm); None draws no printed values.
    setting:
        What all figures of the result share.
    about:
        A sentence on what the intervals are of, where it is not plain; it joins the note.
    """
    cases = cases[texts(cases, "parameter").isin(list(AXIS_NAMES))]
    shown = case_axis.numbered(case_axis.case_factors(cases).assign(parameter=texts(cases, "parameter")))
    shown = shown.assign(**{column: numbers(cases, column) for column in ("median", "lower", "upper")})
    shown["unit"] = texts(cases, "unit")
    rows = case_axis.in_order(shown[[*CASE_FACTORS, "nth"]].drop_duplicates(), [*CASE_FACTORS, "nth"])
    lines = case_axis.grouped_lines(rows)
    rows["y"] = [line.y for line in lines if not line.heads]
    shown = shown.merge(rows)
    appearance = setting.looks(rows["configuration"])
    entries = [(look.interval_handle, configuration_label(name)) for name, look in appearance.items()]
    if printed is not None:
        values = {name: numbers(printed, parameter_column(name)) for name in USUAL}
        rows = rows.merge(case_axis.numbered(case_axis.case_factors(printed)).assign(**values), how="left")
        entries.append((Line2D([], [], **_PRINTED), "printed value"))
    room = max(LEAST, len(lines))
    parameters = panels(shown["parameter"])
    figure, axes, inches = case_axis.parameter_panels(len(parameters), 1.3, LINE, room, case_axis.case_axis_name(rows))
    for ax, parameter in zip(axes, parameters, strict=True):
        _forest_panel(ax, shown[shown["parameter"] == parameter], rows, appearance, parameter)
        if len(parameters) > 2:  # narrow panels: a long name goes on below
            ax.set_xlabel("\n".join(textwrap.wrap(ax.get_xlabel(), 32)))
        case_axis.name_lines(ax, lines, inches, len(lines))
    layout.legend(figure, entries)
    contents = sorted(set(numbers(cases, "interval").dropna()))
    note = f"Marker: median. Line: {' or '.join(map(interval_name, contents)) or 'interval'}."
    return layout.finish(figure, setting, f"{note} {about}".rstrip())


def _forest_panel(
    ax: Axes, shown: pd.DataFrame, rows: pd.DataFrame, appearance: dict[str, Look], parameter: str
) -> None:
    for configuration, look in appearance.items():
        mine = shown[shown["configuration"] == configuration]
        ax.hlines(mine["y"], mine["lower"], mine["upper"], color=look.colour, linewidth=1.6)
        ax.plot(mine["median"], mine["y"], look.marker, color=look.colour)
    values = shown[["median", "lower", "upper"]].to_numpy().ravel()
    if parameter in rows:
        ax.plot(rows[parameter], rows["y"], **_PRINTED, markeredgewidth=0.8)
        values = np.concatenate([values, rows[parameter]])
    values = values[np.isfinite(values)]
    log = bool(parameter in WIDE and len(values) and values.min() > 0)
    if log:
        layout.log_axis(ax, values.min() / 1.1, values.max() * 1.1)
    layout.name_axis(ax, parameter, shown, log)


@matplotlib.style.context(STYLE)
def outlier_probabilities(repeats: pd.DataFrame, setting: Setting) -> Figure:
    """Return the probability that a record is discordant: a panel a configuration, a line a case, a marker a record.

    Parameters
    ----------
    repeats:
        A row a record: `record`, the factors (`speed_km_h`, km/h; `initial_load_kN`, `step_kN`, kN),
        `outlier_probability` (no unit; NaN where a case has fewer than three repeats).
    setting:
        What all figures of the result share.
    """
    records = case_axis.case_factors(repeats).assign(record=texts(repeats, "record"), repeat=numbers(repeats, "repeat"))
    records["p"] = numbers(repeats, "outlier_probability")
    records["own"] = records["record"].where(records[list(CASE_FACTORS[2:])].isna().all(axis=1), "")
    records = case_axis.in_order(records, ["configuration", "speed_km_h", *CASE_FACTORS, "own", "repeat", "record"])
    appearance = setting.looks(records["configuration"])
    panels = [_outlier_lines(records[records["configuration"] == name]) for name in appearance]
    columns = 2 if len(panels) > 1 else 1
    sizes = [max(LEAST, len(lines)) for lines, _ in panels] or [LEAST]
    tall = [max(sizes[i : i + columns]) for i in range(0, len(sizes), columns)]
    spare = 0.8 + 0.6 * len(tall)
    figure = layout.page(WIDTH, min(TALLEST, spare + LINE * sum(tall)))
    axes = figure.subplots(len(tall), columns, squeeze=False, height_ratios=tall).ravel()
    inches = min(LINE, max(1.0, TALLEST - spare) / sum(tall))
    for i, (ax, (name, look), (lines, cases)) in enumerate(zip(axes, appearance.items(), panels, strict=False)):
        ax.set(title=configuration_label(name), ylabel="" if i % columns else case_axis.case_axis_name(records))
        _outlier_panel(ax, cases, look)
        in_row = panels[i - i % columns : i - i % columns + columns]
        case_axis.name_lines(ax, lines, inches, max(case_axis.FEWEST, *(len(each) for each, _ in in_row)))
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    return layout.finish(figure, setting, _outlier_note(records))


def _outlier_lines(records: pd.DataFrame) -> tuple[list[Line], list[tuple[int, pd.DataFrame]]]:
    """Return the lines of one panel, and for each case its place and its records."""
    cases = [case for _, case in records.groupby([*CASE_FACTORS, "own"], sort=False, dropna=False)]
    firsts = [case.iloc[0] for case in cases]
    headings = ["" if math.isnan(case["speed_km_h"]) else f"{case['speed_km_h']:g} km/h" for case in firsts]
    lines = case_axis.list_lines(headings, [case_axis.line_label(case) for case in firsts])
    return lines, list(zip([line.y for line in lines if not line.heads], cases, strict=True))


def _outlier_panel(ax: Axes, cases: list[tuple[int, pd.DataFrame]], look: Look) -> None:
    ax.axvline(0.5, color=INK, linestyle="--", linewidth=0.8)
    for y, case in cases:
        level = y + (np.arange(len(case)) - (len(case) - 1) / 2) * 0.5 / len(case)
        ax.plot(case["p"], level, look.marker, color=look.colour, markersize=3.5, alpha=0.8, clip_on=False)
        discordant = case[case["p"] > 0.5]
        if len(discordant):
            named = (
                discordant["repeat"].map("repeat {:g}".format).where(discordant["repeat"].notna(), discordant["record"])
            )
            place = {"xytext": (-6, 0), "textcoords": "offset points", "ha": "right", "va": "center"}
            white = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
            ax.annotate(plain(", ".join(named), 30), (discordant["p"].min(), y), fontsize=7, bbox=white, **place)
    ax.set(xlim=(-0.03, 1.03), xlabel="probability that the record is discordant (no unit)")


def _outlier_note(records: pd.DataFrame) -> str:
    missing = records["p"].isna()
    sizes = records.groupby(list(CASE_FACTORS), dropna=False)["record"].transform("size")
    reason = "fewer than three repeats" + ("" if (sizes[missing] < 3).all() else ", or a model that gives none")
    note = f" {missing.sum()} of {len(records)} records have no marker: {reason}." if missing.any() else ""
    return f"Dashed: 0.5; records above it are named.{note}"
