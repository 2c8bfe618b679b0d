"""Figures of motions: a record's readings beside the fitted motion, and the loop that loses the energy."""

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayes_tyre.report.figures.page import case_axis, layout
from bayes_tyre.report.figures.page.colours import FAINT_BAND, INK, PALE, Look, Setting
from bayes_tyre.report.figures.page.labels import configuration_label, interval_name, plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH
from bayes_tyre.results.figure_data.motion_traces import CHANNELS

#: Standard deviations on either side of 0 within which 95 % of normal residuals lie.
_MOST_LIE = 1.96


@matplotlib.style.context(STYLE)
def motion_figure(readings: pd.DataFrame, setting: Setting) -> Figure:
    """Return the figure of one record: readings and motion at the left, residuals in standard deviations at the right.

    Parameters
    ----------
    readings:
        As `bayes_tyre.results.figure_data.motion_traces.readings_table` gives them, and in each row the same `record`,
        `configuration` and `status`, what the check said of the estimate.
    setting:
        What all figures of the result share; a record by itself has its origin alone.
    """
    record, configuration, status = (str(readings[name].iloc[0]) for name in ("record", "configuration", "status"))
    colour = setting.looks([configuration])[configuration].colour
    time_s = readings["time_s"].to_numpy()
    figure = layout.page(WIDTH, 6.0)
    axes = figure.subplots(3, 2, sharex=True, width_ratios=(1.4, 1.0))
    for row, channel in zip(axes, CHANNELS, strict=True):
        read, fitted, left = (readings[name].to_numpy(float) for name in channel[1:])
        row[0].plot(time_s, read, ".", color=PALE, markersize=2)
        row[0].plot(time_s, fitted, color=colour, linewidth=0.9)
        row[0].set_ylabel(channel.label)
        row[1].axhspan(-_MOST_LIE, _MOST_LIE, **FAINT_BAND)
        row[1].axhline(0.0, color=INK, linewidth=0.6)
        row[1].plot(time_s, left, ".", color=INK, markersize=1.5)
        row[1].set_ylabel("residual\n(standard deviations)")
    for ax in axes[-1]:
        ax.set_xlabel("time from the window's start (s)")
    entries = [
        (Line2D([], [], linestyle="", marker=".", color=PALE), "readings"),
        (Line2D([], [], color=colour), f"fitted motion, {configuration_label(configuration)}"),
        (Patch(**FAINT_BAND), "where 95 % should lie"),
    ]
    layout.legend(figure, entries)
    block_ms = 1e3 * float(np.diff(time_s[:2])[0]) if len(time_s) > 1 else 0.0
    note = (
        f"Record {record}. Readings: means over {block_ms:.2g} ms. Residual: reading less fitted motion, in standard "
        f"deviations. Check of the estimate: {status}."
    )
    return layout.finish(figure, setting, plain(note, 600))


@matplotlib.style.context(STYLE)
def loops_by_direction(loops: pd.DataFrame, setting: Setting, amplitude_mm: float, interval: float = 0.95) -> Figure:
    """Return the loop of each configuration, a panel a direction of the step: friction over displacement.

    Parameters
    ----------
    loops:
        As `bayes_tyre.results.figure_data.hysteresis_loops.friction_loops` gives them, mm and kN.
    setting:
        What all figures of the result share.
    amplitude_mm:
        Half the stroke.
    interval:
        Content of the bands.
    """
    directions = sorted(set(loops["direction"]), key=case_axis.direction_rank)
    appearance = setting.looks(loops["configuration"])
    figure = layout.page(WIDTH, 3.9)
    axes = figure.subplots(1, len(directions), sharey=True, squeeze=False)[0]
    for ax, direction in zip(axes, directions, strict=True):
        _loop_panel(ax, loops[loops["direction"] == direction], appearance)
        ax.set_title(plain(f"{direction or 'direction not stated'} steps"))
        ax.set_xlabel("displacement from the middle, flat ground (mm)")
    axes[0].set_ylabel("force less k d + C, flat ground (kN)")
    axes[0].locator_params(axis="y", nbins=5)
    entries = [(_loop_handle(look), configuration_label(name)) for name, look in appearance.items()]
    layout.legend(figure, entries)
    note = (
        f"Line: median; band: {interval_name(interval)}; mean over the cases of a direction. Half the stroke is "
        f"{amplitude_mm:g} mm. Above: displacement grows; below: it falls. Their distance is 2 (x - k beta), the area "
        "between them what a cycle loses; tables state it at the wheel centre."
    )
    return layout.finish(figure, setting, note)


def _loop_handle(look: Look) -> tuple[Patch, Line2D]:
    return Patch(**look.band), Line2D([], [], color=look.colour, linestyle=look.line)


def _loop_panel(ax: Axes, loops: pd.DataFrame, appearance: dict[str, Look]) -> None:
    ax.axhline(0.0, color=INK, linewidth=0.6)
    for configuration, look in appearance.items():
        mine = loops[loops["configuration"] == configuration]
        for _, branch in mine.groupby("branch"):
            ax.fill_between(branch["displacement_mm"], branch["lower_kN"], branch["upper_kN"], **look.band)
            ax.plot(branch["displacement_mm"], branch["median_kN"], color=look.colour, linestyle=look.line)
