"""Records as measured: against the posterior predictive, against the priors alone, and the residuals."""

import math
from typing import Any

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import FAINT_BAND, INK, PALE, Look, Setting
from bayes_tyre.report.figures.page.labels import configuration_label, decimals, interval_name, plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH
from bayes_tyre.results.columns import of_records
from bayes_tyre.results.figure_data.prior_curves import PriorPanel

#: The most records on a figure, and the part of a record's travel that its inset enlarges.
MOST_RECORDS, START = 6, 0.04
_POINTS = {"marker": "o", "markersize": 2.2, "markeredgewidth": 0, "color": INK, "linestyle": "none"}
_SIGMA: dict[str, Any] = {"linestyle": "--", "linewidth": 0.9}
_DATA: dict[str, Any] = {"linewidth": 1.3}
_DISPLACEMENT, _FORCE, _RESIDUAL = "displacement (mm)", "force (kN)", "residual (kN)"


@matplotlib.style.context(STYLE)
def records_with_bands(points: pd.DataFrame, bands: pd.DataFrame, setting: Setting, interval: float = 0.95) -> Figure:
    """Return up to six records with the posterior predictive median and band, and the residuals below each.

    Residuals stand against the distance from the first point, on a logarithmic axis: the start of the step,
    where beta shows, is a hundredth of the travel. An inset enlarges it.

    Parameters
    ----------
    points:
        Measured: `record`, `displacement_mm`, `force_kN`, and `configuration` where it is known; rows of a record in
        measured order.
    bands:
        Predicted: `record`, `displacement_mm`, `median_kN`, `lower_kN`, `upper_kN`; in the same order.
    setting:
        What all figures of the result share.
    interval:
        Content of the bands.
    """
    measured = of_records(points, ["displacement_mm", "force_kN"])
    predicted = of_records(bands, ["displacement_mm", "median_kN", "lower_kN", "upper_kN"])
    names = list(dict.fromkeys(measured["record"]))
    shown = names[:MOST_RECORDS]
    down = max(1, math.ceil(len(shown) / 2))
    figure = layout.page(WIDTH, 1.0 + 3.2 * down)
    cells = figure.subfigures(down, min(2, max(1, len(shown))), squeeze=False).ravel()
    appearance = setting.looks(measured.loc[measured["record"].isin(shown), "configuration"])
    for cell, record in zip(cells, shown, strict=False):
        mine, band = (table[table["record"] == record] for table in (measured, predicted))
        _record_panel(cell, mine, band, appearance[mine["configuration"].iloc[0]])
    lines = _entries(appearance, f"median and {interval_name(interval)}", {"linewidth": 0.9})
    bands_of = [Patch(**look.band) for look in appearance.values()]
    with_bands = [((patch, line), label) for patch, (line, label) in zip(bands_of, lines, strict=True)]
    layout.legend(figure, [(Line2D([], [], **_POINTS), "data"), *with_bands])
    note = (
        "Median and interval: posterior predictive, noise of a new point included. Residual: data less median; "
        f"nearest points on the left edge. Inset: first {100 * START:g} % of the travel."
    )
    return layout.finish(figure, setting, note + layout.left_out(len(shown), len(names), "records"))


def _entries(appearance: dict[str, Look], what: str, line: dict[str, Any]) -> list[tuple[Line2D, str]]:
    """Return a legend entry for each configuration, named if any is; `line` is what its lines are like."""
    named = [name for name in appearance if name]
    labels = {name: f"{what}, {configuration_label(name)}" if named else what for name in appearance}
    return [(Line2D([], [], color=look.colour, **line), labels[name]) for name, look in appearance.items()]


def _record_panel(cell: SubFigure, points: pd.DataFrame, band: pd.DataFrame, look: Look) -> None:
    above, below = cell.subplots(2, 1, height_ratios=[5, 2])
    d, force = (points[column].to_numpy() for column in ("displacement_mm", "force_kN"))
    columns = ("displacement_mm", "median_kN", "lower_kN", "upper_kN")
    at, median, lower, upper = (band[column].to_numpy() for column in columns)
    above.set(title=plain(points["record"].iloc[0]), xlabel=_DISPLACEMENT, ylabel=_FORCE)
    below.set(xlabel="distance from the first point (mm, log scale)", ylabel=_RESIDUAL)
    below.axhline(0, color=look.colour, linewidth=0.8)
    travel = float(np.abs(d - d[0]).max())
    inset = above.inset_axes((0.66, 0.2, 0.33, 0.33))
    inset.set_title("start (mm, kN)", fontsize=6.5, pad=2)
    inset.tick_params(labelsize=6.5, length=2, pad=1.5)
    for ax, reach in ((above, math.inf), (inset, START * travel)):
        shown, drawn = (np.abs(x - d[0]) <= reach for x in (d, at))
        ax.plot(d[shown], force[shown], **_POINTS)
        ax.fill_between(at[drawn], lower[drawn], upper[drawn], **look.band)
        ax.plot(at[drawn], median[drawn], color=look.colour, linewidth=0.9)
    if not len(at) or travel == 0:
        below.set_axis_off()
        below.text(0.5, 0.5, "no residuals: no prediction, or no travel", ha="center", transform=below.transAxes)
        return
    order = np.argsort(at, kind="stable")
    residual = force - (median if np.array_equal(at, d) else np.interp(d, at[order], median[order]))
    nearest = travel / 1e4
    away, far = (np.maximum(np.abs(x - d[0]), nearest) for x in (d, at))
    order = np.argsort(far, kind="stable")
    below.fill_between(far[order], (lower - median)[order], (upper - median)[order], **look.band)
    below.plot(away, residual, **_POINTS)
    layout.log_axis(below, nearest * 0.9, travel * 1.1)


@matplotlib.style.context(STYLE)
def residuals_against_displacement(
    points: pd.DataFrame, records: pd.DataFrame, setting: Setting, threshold: float
) -> Figure:
    """Return the residuals of up to six records, and the lag-1 autocorrelation of the residuals of all.

    Parameters
    ----------
    points:
        Of the records to show: `record`, `displacement_mm`, `residual_kN` at the posterior mean.
    records:
        A row for every record: `record`, `configuration` where known, `sigma_kN`, `autocorrelation`.
    setting:
        What all figures of the result share.
    threshold:
        What the mean of the autocorrelations may reach, chance aside, before the verdict is fail.
    """
    left = of_records(points, ["displacement_mm", "residual_kN"])
    every = of_records(records, ["sigma_kN", "autocorrelation"])
    shown = list(dict.fromkeys(left["record"]))[:MOST_RECORDS]
    rows = math.ceil(len(shown) / 2)
    figure = layout.page(WIDTH, 1.0 + 1.75 * rows + 2.0)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[*[1.75] * rows, 2.0])
    appearance = setting.looks(every["configuration"])
    for i, record in enumerate(shown):
        across = slice(None) if len(shown) == 1 else i % 2
        ax = figure.add_subplot(grid[i // 2, across])
        _residual_panel(ax, left[left["record"] == record], every[every["record"] == record].iloc[0], appearance)
    _autocorrelation_panel(figure.add_subplot(grid[rows, :]), every, appearance, threshold)
    bars = [
        (Patch(**look.shade), f"records, {configuration_label(name)}" if name else "records")
        for name, look in appearance.items()
    ]
    layout.legend(figure, [(Line2D([], [], **_POINTS), "residual"), *_entries(appearance, "± sigma", _SIGMA), *bars])
    note = "Residual: data less the law at the posterior mean. Sigma: posterior mean. In the titles: the residuals'"
    return layout.finish(figure, setting, f"{note} autocorrelation at lag 1, about 0 where the noise is independent.")


def _residual_panel(ax: Axes, points: pd.DataFrame, record: pd.Series, appearance: dict[str, Look]) -> None:
    look, sigma = appearance[record["configuration"]], record["sigma_kN"]
    ax.plot(points["displacement_mm"], points["residual_kN"], **_POINTS)
    ax.axhline(0, color=look.colour, linewidth=0.9)
    for level in (-sigma, sigma):
        ax.axhline(level, color=look.colour, **_SIGMA)
    most = 1.1 * max(sigma, float(points["residual_kN"].abs().max()))
    ax.set(xlabel=_DISPLACEMENT, ylabel=_RESIDUAL, ylim=(-most, most))
    autocorrelation = decimals(record["autocorrelation"])
    ax.set_title(f"{plain(record['record'], 24)}: lag-1 autocorrelation {autocorrelation}", fontsize=8)


def _autocorrelation_panel(ax: Axes, records: pd.DataFrame, appearance: dict[str, Look], threshold: float) -> None:
    values = records["autocorrelation"]
    low, high = min([-0.2, *values]), max([threshold + 0.1, *values])
    edges = np.linspace(low, high, 41)
    floor = np.zeros(len(edges) - 1)
    for name, look in appearance.items():
        counts = np.histogram(values[records["configuration"] == name], edges)[0]
        ax.stairs(floor + counts, edges, baseline=floor, fill=True, **look.shade)
        floor = floor + counts
    ax.axvline(threshold, color=INK, linestyle="--", linewidth=0.9)
    middle = float(values.mean()) if len(values) else math.nan
    ax.axvline(middle, color=INK, linewidth=0.9)
    verdict = f"a mean above {threshold:g} (dashed), by more than chance, fails the verdict"
    ax.set_title(f"all records ({len(records)}): mean {decimals(middle)} (line); {verdict}")
    ax.set(xlabel="lag-1 autocorrelation of a record's residuals (no unit)", ylabel="records (count)")
    ax.yaxis.set_major_locator(MaxNLocator("auto", integer=True))


@matplotlib.style.context(STYLE)
def prior_predictive_curves(panels: list[PriorPanel], setting: Setting, interval: float = 0.95) -> Figure:
    """Return records drawn from the priors alone with records of the data over them, six panels at most.

    Parameters
    ----------
    panels:
        As `bayes_tyre.results.figure_data.prior_curves.prior_panels` gives them.
    setting:
        What all figures of the result share.
    interval:
        Content of the bands.
    """
    shown = panels[:MOST_RECORDS]
    figure, axes, _ = layout.panel_grid(len(shown), 2, 2.6, 0.9)
    appearance = setting.looks(panel.configuration for panel in shown)
    for ax, panel in zip(axes, shown, strict=True):
        _prior_panel(ax, panel, appearance[panel.configuration])
    drawn = Line2D([], [], color=PALE, linewidth=0.6), "records drawn from the priors"
    layout.legend(figure, [drawn, (Patch(**FAINT_BAND), interval_name(interval)), *_entries(appearance, "data", _DATA)])
    note = "Prior records start and travel like the record named, one of median travel; the data are of its case."
    return layout.finish(figure, setting, note)


def _prior_panel(ax: Axes, panel: PriorPanel, look: Look) -> None:
    band = panel.band
    ax.fill_between(band["displacement_mm"], band["lower_kN"], band["upper_kN"], **FAINT_BAND)
    for _, curve in panel.curves.groupby("record", sort=False):
        ax.plot(curve["displacement_mm"], curve["force_kN"], color=PALE, linewidth=0.6, alpha=0.6)
    for _, record in panel.points.groupby("record", sort=False):
        ax.plot(record["displacement_mm"], record["force_kN"], color=look.colour, **_DATA)
    seen = np.concatenate([band["lower_kN"], band["upper_kN"], panel.points["force_kN"]])
    room = 0.05 * np.ptp(seen)
    ax.set(xlabel=_DISPLACEMENT, ylabel=_FORCE, ylim=(seen.min() - room, seen.max() + room))
    factors = ", ".join(plain(factor, 24) for factor in (panel.configuration, panel.direction) if factor)
    ax.set_title("\n".join([*([factors] if factors else []), f"like {plain(panel.like)}"]), fontsize=8)
