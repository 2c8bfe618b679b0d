"""Four figures of a posterior, drawn from tables; the only thing estimated here is the shape of a density."""

import math
from pathlib import Path

import arviz as az
import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayes_tyre.formats.tables import whole_file
from bayes_tyre.record import CASE_WORDS
from bayes_tyre.report import case_lines, colours
from bayes_tyre.report.case_lines import Line
from bayes_tyre.report.colours import INK, PARAMETERS, STYLE, Look, configuration_label, numbers, plain, texts

#: Width of a figure, height of a line in a list of cases, the tallest figure, inches; the room of the shortest list.
WIDTH, LINE, TALLEST, LEAST = 8.0, 0.17, 30.0, 8
#: The most records on a figure, and the part of a record's travel that its inset enlarges.
MOST_RECORDS, START = 6, 0.04
_PRINTED = {"marker": "D", "markersize": 6.5, "markerfacecolor": "none", "markeredgecolor": INK, "linestyle": "none"}
_FIT = "#0072B2"
_POINTS = {"marker": "o", "markersize": 2.2, "markeredgewidth": 0, "color": INK, "linestyle": "none"}
_BAND = {"facecolor": (_FIT, 0.3), "edgecolor": "none", "linewidth": 0}


@matplotlib.style.context(STYLE)
def posteriors_by_direction(cells: pd.DataFrame, origin: str, interval: float = 0.95) -> Figure:
    """Return the posterior densities of k and beta, a panel a direction, the configurations in each.

    Parameters
    ----------
    cells:
        Draws, long: `configuration`, `direction`, `parameter` (`k` | `beta`), `unit` (kN/mm | mm), `value`.
    origin:
        Where the data come from, such as ``"reconstructed"``; it stands in the corner.
    interval:
        Content of the equal-tailed interval marked.
    """
    draws = pd.DataFrame({word: texts(cells, word) for word in ("configuration", "direction", "parameter", "unit")})
    draws["value"] = numbers(cells, "value")
    draws = draws[draws["value"].notna() & draws["parameter"].isin(list(PARAMETERS))]
    directions = sorted(set(draws["direction"]), key=case_lines.direction_rank) or [""]
    parameters = [p for p in PARAMETERS if (draws["parameter"] == p).any()] or list(PARAMETERS)
    appearance = colours.looks(draws["configuration"])
    figure = colours.page(WIDTH, 1.0 + (2.3 + 0.1 * len(appearance)) * len(parameters))
    axes = figure.subplots(len(parameters), len(directions), sharex="row", sharey="row", squeeze=False)
    for row, parameter in zip(axes, parameters, strict=True):
        here = draws[draws["parameter"] == parameter]
        _density_row(list(row), [here[here["direction"] == d] for d in directions], appearance, interval, parameter)
    for ax, direction in zip(axes[0], directions, strict=True):
        ax.set_title(plain(direction or "direction not stated"))
    colours.legend(figure, [(look.density_handle, configuration_label(name)) for name, look in appearance.items()])
    note = f"Mean over the cases of a direction. Bar, shading: {colours.interval_name(interval)}, equal-tailed."
    note += " Marker: median."
    return colours.finish(figure, origin, note, [cells])


def _density_row(
    axes: list[Axes], panels: list[pd.DataFrame], appearance: dict[str, Look], interval: float, parameter: str
) -> None:
    draws = pd.concat(panels)
    low, high = draws["value"].min(), draws["value"].max()
    log = bool(parameter == "beta" and low > 0 and high > 10 * low)
    strip = min(0.5, 0.08 * len(appearance))
    highest = 0.0
    for ax, panel in zip(axes, panels, strict=True):
        unit = colours.name_axis(ax, parameter, draws, log)
        for i, (configuration, look) in enumerate(appearance.items()):
            values = panel.loc[panel["configuration"] == configuration, "value"].to_numpy()
            if len(values):
                bar = strip * (1 - (i + 0.5) / len(appearance))
                highest = max(highest, _density(ax, values, look, log, interval, bar))
        axes[0].set_ylabel(f"density (per {f'decade of {unit}' if log else unit})")
        ax.axhline(0, color="#666666", linewidth=0.7)
    if log:
        colours.log_axis(axes[0], low, high)
    top = 1.05 * highest or 1.0
    axes[0].set_ylim(-top * strip / (1 - strip), top)
    axes[0].set_yticks([tick for tick in axes[0].get_yticks() if 0 <= tick <= top])


def _density(ax: Axes, values: np.ndarray, look: Look, log: bool, interval: float, bar: float) -> float:
    """Draw one density, and its interval at height `bar` of the panel; return the density's highest point."""
    lower, median, upper = np.quantile(values, [(1 - interval) / 2, 0.5, (1 + interval) / 2])
    below = ax.get_xaxis_transform()
    ax.plot([lower, upper], [bar, bar], color=look.colour, linewidth=2, transform=below, solid_capstyle="butt")
    ax.plot([median], [bar], color=look.colour, marker=look.marker, markersize=5.5, transform=below)
    if np.ptp(values) == 0:
        ax.axvline(median, color=look.colour, linestyle=look.line)
        return 0.0
    x, height, _ = az.kde(np.log10(values) if log else values)
    x = 10**x if log else x
    ax.plot(x, height, color=look.colour, linestyle=look.line)
    ax.fill_between(x, height, where=((x >= lower) & (x <= upper)).tolist(), **look.shade)
    return float(height.max())


@matplotlib.style.context(STYLE)
def forest_of_cases(cases: pd.DataFrame, printed: pd.DataFrame | None, origin: str, about: str = "") -> Figure:
    """Return k and beta of every case, a line a case: median, interval, and the printed value beside them.

    Parameters
    ----------
    cases:
        A row a case and parameter: the case's words, `parameter` (`k` | `beta`), `unit`, `median`, `lower`,
        `upper` (kN/mm | mm), `interval` (its content).
    printed:
        A row a case: the case's words, `k_kN_per_mm` (kN/mm), `beta_mm` (mm); None draws no printed values.
    origin:
        Where the data come from, such as ``"reconstructed"``; it stands in the corner.
    about:
        A sentence on what the intervals are of, where it is not plain; it joins the note.
    """
    cases = cases[texts(cases, "parameter").isin(list(PARAMETERS))]
    shown = case_lines.numbered(case_lines.case_words(cases).assign(parameter=texts(cases, "parameter")))
    shown = shown.assign(**{column: numbers(cases, column) for column in ("median", "lower", "upper")})
    shown["unit"] = texts(cases, "unit")
    rows = case_lines.in_order(shown[[*CASE_WORDS, "nth"]].drop_duplicates(), [*CASE_WORDS, "nth"])
    lines = case_lines.grouped_lines(rows)
    rows["y"] = [line.y for line in lines if not line.heads]
    shown = shown.merge(rows)
    appearance = colours.looks(rows["configuration"])
    entries = [(look.interval_handle, configuration_label(name)) for name, look in appearance.items()]
    if printed is not None:
        values = {name: numbers(printed, column) for name, (_, _, column) in PARAMETERS.items()}
        rows = rows.merge(case_lines.numbered(case_lines.case_words(printed)).assign(**values), how="left")
        entries.append((Line2D([], [], **_PRINTED), "printed value"))
    room = max(LEAST, len(lines))
    figure = colours.page(WIDTH, min(TALLEST, 1.3 + LINE * room))
    axes = figure.subplots(1, 2, sharey=True)
    for ax, parameter in zip(axes, PARAMETERS, strict=True):
        _forest_panel(ax, shown[shown["parameter"] == parameter], rows, appearance, parameter)
        case_lines.name_lines(ax, lines, min(LINE, (TALLEST - 1.3) / room), len(lines))
    axes[0].set_ylabel(case_lines.CASE_AXIS)
    colours.legend(figure, entries)
    contents = sorted(set(numbers(cases, "interval").dropna()))
    note = f"Marker: median. Line: {' or '.join(map(colours.interval_name, contents)) or 'interval'}."
    return colours.finish(figure, origin, f"{note} {about}".rstrip(), [cases])


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
    log = bool(parameter == "beta" and len(values) and values.min() > 0)
    if log:
        colours.log_axis(ax, values.min() / 1.1, values.max() * 1.1)
    colours.name_axis(ax, parameter, shown, log)


@matplotlib.style.context(STYLE)
def records_with_bands(points: pd.DataFrame, bands: pd.DataFrame, origin: str, interval: float = 0.95) -> Figure:
    """Return up to six records with the posterior predictive median and band, and the residuals below each.

    Residuals stand against the distance from the first point, on a logarithmic axis: the start of the step,
    where beta shows, is a hundredth of the travel. An inset enlarges it.

    Parameters
    ----------
    points:
        Measured: `record`, `displacement_mm`, `force_kN`; rows of a record in measured order.
    bands:
        Predicted: `record`, `displacement_mm`, `median_kN`, `lower_kN`, `upper_kN`; in the same order.
    origin:
        Where the data come from, such as ``"reconstructed"``; it stands in the corner.
    interval:
        Content of the bands.
    """
    measured = _of_records(points, ["displacement_mm", "force_kN"])
    predicted = _of_records(bands, ["displacement_mm", "median_kN", "lower_kN", "upper_kN"])
    names = list(dict.fromkeys(measured["record"]))
    shown = names[:MOST_RECORDS]
    down = max(1, math.ceil(len(shown) / 2))
    figure = colours.page(WIDTH, 1.0 + 3.2 * down)
    cells = figure.subfigures(down, min(2, max(1, len(shown))), squeeze=False).ravel()
    for cell, record in zip(cells, shown, strict=False):
        _record_panel(cell, record, *(table[table["record"] == record] for table in (measured, predicted)))
    handles = (Line2D([], [], **_POINTS), Line2D([], [], color=_FIT), Patch(**_BAND))
    names_of = ("data", "posterior predictive median", colours.interval_name(interval))
    colours.legend(figure, list(zip(handles, names_of, strict=True)))
    note = f"Inset: first {100 * START:g} % of the travel. Residual: data less median; nearest points on the left edge."
    left_out = "" if len(names) == len(shown) else f" The first {len(shown)} of {len(names)} records."
    return colours.finish(figure, origin, note + left_out, [points, bands])


def _of_records(table: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    return pd.DataFrame({"record": texts(table, "record"), **{c: numbers(table, c) for c in columns}}).dropna()


def _record_panel(cell: SubFigure, record: str, points: pd.DataFrame, band: pd.DataFrame) -> None:
    above, below = cell.subplots(2, 1, height_ratios=[5, 2])
    d, force = (points[column].to_numpy() for column in points.columns[1:])
    at, median, lower, upper = (band[column].to_numpy() for column in band.columns[1:])
    above.set(title=plain(record), xlabel="displacement (mm)", ylabel="force (kN)")
    below.set(xlabel="distance from the first point (mm, log scale)", ylabel="residual (kN)")
    below.axhline(0, color=_FIT, linewidth=0.8)
    travel = float(np.abs(d - d[0]).max())
    inset = above.inset_axes((0.66, 0.2, 0.33, 0.33))
    inset.set_title("start (mm, kN)", fontsize=6.5, pad=2)
    inset.tick_params(labelsize=6.5, length=2, pad=1.5)
    for ax, reach in ((above, math.inf), (inset, START * travel)):
        shown, drawn = (np.abs(x - d[0]) <= reach for x in (d, at))
        ax.plot(d[shown], force[shown], **_POINTS)
        ax.fill_between(at[drawn], lower[drawn], upper[drawn], **_BAND)
        ax.plot(at[drawn], median[drawn], color=_FIT, linewidth=0.9)
    if not len(at) or travel == 0:
        below.set_axis_off()
        below.text(0.5, 0.5, "no residuals: no prediction, or no travel", ha="center", transform=below.transAxes)
        return
    order = np.argsort(at, kind="stable")
    residual = force - (median if np.array_equal(at, d) else np.interp(d, at[order], median[order]))
    nearest = travel / 1e4
    away, far = (np.maximum(np.abs(x - d[0]), nearest) for x in (d, at))
    order = np.argsort(far, kind="stable")
    below.fill_between(far[order], (lower - median)[order], (upper - median)[order], **_BAND)
    below.plot(away, residual, **_POINTS)
    colours.log_axis(below, nearest * 0.9, travel * 1.1)


@matplotlib.style.context(STYLE)
def outlier_probabilities(repeats: pd.DataFrame, origin: str) -> Figure:
    """Return the probability that a record is discordant: a panel a configuration, a line a case, a marker a record.

    Parameters
    ----------
    repeats:
        A row a record: `record`, the words (`speed_km_h`, km/h; `initial_load_kN`, `step_kN`, kN),
        `outlier_probability` (no unit; NaN where a case has fewer than three repeats).
    origin:
        Where the data come from, such as ``"reconstructed"``; it stands in the corner.
    """
    records = case_lines.case_words(repeats).assign(record=texts(repeats, "record"), repeat=numbers(repeats, "repeat"))
    records["p"] = numbers(repeats, "outlier_probability")
    records["own"] = records["record"].where(records[list(CASE_WORDS[2:])].isna().all(axis=1), "")
    records = case_lines.in_order(records, ["configuration", "speed_km_h", *CASE_WORDS, "own", "repeat", "record"])
    appearance = colours.looks(records["configuration"])
    panels = [_outlier_lines(records[records["configuration"] == name]) for name in appearance]
    columns = 2 if len(panels) > 1 else 1
    sizes = [max(LEAST, len(lines)) for lines, _ in panels] or [LEAST]
    tall = [max(sizes[i : i + columns]) for i in range(0, len(sizes), columns)]
    spare = 0.8 + 0.6 * len(tall)
    figure = colours.page(WIDTH, min(TALLEST, spare + LINE * sum(tall)))
    axes = figure.subplots(len(tall), columns, squeeze=False, height_ratios=tall).ravel()
    inches = min(LINE, max(1.0, TALLEST - spare) / sum(tall))
    for i, (ax, (name, look), (lines, cases)) in enumerate(zip(axes, appearance.items(), panels, strict=False)):
        ax.set(title=configuration_label(name), ylabel="" if i % columns else case_lines.CASE_AXIS)
        _outlier_panel(ax, cases, look)
        case_lines.name_lines(ax, lines, inches, tall[i // columns])
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    return colours.finish(figure, origin, _outlier_note(records), [repeats])


def _outlier_lines(records: pd.DataFrame) -> tuple[list[Line], list[tuple[int, pd.DataFrame]]]:
    """Return the lines of one panel, and for each case its place and its records."""
    cases = [case for _, case in records.groupby([*CASE_WORDS, "own"], sort=False, dropna=False)]
    firsts = [case.iloc[0] for case in cases]
    headings = ["" if math.isnan(case["speed_km_h"]) else f"{case['speed_km_h']:g} km/h" for case in firsts]
    lines = case_lines.list_lines(headings, [case_lines.line_label(case) for case in firsts])
    return lines, list(zip([line.y for line in lines if not line.heads], cases, strict=True))


def _outlier_panel(ax: Axes, cases: list[tuple[int, pd.DataFrame]], look: Look) -> None:
    ax.axvline(0.5, color=INK, linestyle="--", linewidth=0.8)
    for y, case in cases:
        level = y + (np.arange(len(case)) - (len(case) - 1) / 2) * 0.5 / len(case)
        ax.plot(case["p"], level, look.marker, color=look.colour, markersize=3.5, alpha=0.8, clip_on=False)
        odd = case[case["p"] > 0.5]
        if len(odd):
            named = odd["repeat"].map("repeat {:g}".format).where(odd["repeat"].notna(), odd["record"])
            place = {"xytext": (-6, 0), "textcoords": "offset points", "ha": "right", "va": "center"}
            white = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
            ax.annotate(plain(", ".join(named), 30), (odd["p"].min(), y), fontsize=7, bbox=white, **place)
    ax.set(xlim=(-0.03, 1.03), xlabel="probability that the record is discordant (no unit)")


def _outlier_note(records: pd.DataFrame) -> str:
    missing = records["p"].isna()
    sizes = records.groupby(list(CASE_WORDS), dropna=False)["record"].transform("size")
    reason = "fewer than three repeats" + ("" if (sizes[missing] < 3).all() else ", or a model that gives none")
    note = f" {missing.sum()} of {len(records)} records have no marker: {reason}." if missing.any() else ""
    return f"Dashed: 0.5; records above it are named.{note}"


@matplotlib.style.context(STYLE)
def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG at 150 dots an inch, whole or not at all, the same bytes each time; return the path."""
    with whole_file(path) as beside:
        figure.savefig(beside, format="png", dpi=150, metadata={"Software": None})
    return path
