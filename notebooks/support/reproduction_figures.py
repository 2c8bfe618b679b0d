"""The source's numbers computed again: its sample on its calibration lines, and what comes back of its tables."""

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Setting
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH
from bayes_tyre.rig.calibration import fit_line

_MENDED = {"marker": "o", "markersize": 5, "markerfacecolor": "none", "color": INK, "linestyle": "none"}
_AS_PRINTED = {"marker": "x", "markersize": 5, "color": "#CC0000", "linestyle": "none"}


@matplotlib.style.context(STYLE)
def calibration_lines(printed: pd.DataFrame, mended: pd.DataFrame, sensors: dict[str, tuple[str, str]]) -> Figure:
    """Return the readings of a sample against its volts, as printed and with signs mended, and the line through these.

    Parameters
    ----------
    printed, mended:
        As `bayes_tyre.published.tables.raw_sample` gives them.
    sensors:
        Columns of volts (V) and of units, by the sensor's name: `bayes_tyre.published.recompute.SENSORS`.
    """
    figure = layout.page(WIDTH, 3.4)
    axes = figure.subplots(1, len(sensors), squeeze=False)[0]
    for ax, (name, (volts, unit)) in zip(axes, sensors.items(), strict=True):
        x, before, after = printed[volts].to_numpy(), printed[unit].to_numpy(), mended[unit].to_numpy()
        line = fit_line(x, after)
        ends = np.array([x.min(), x.max()])
        ax.plot(ends, line(ends), color=PALE, linewidth=1.0)
        ax.plot(x, after, **_MENDED)
        lost = before != after
        ax.plot(x[lost], before[lost], **_AS_PRINTED)
        about = f"{lost.sum()} of {len(x)} lost their sign" if lost.any() else "as printed"
        ax.set_title(f"{plain(name)}: {about}", fontsize=8)
        ax.set(xlabel="reading (V)", ylabel=plain(unit))
        ax.ticklabel_format(useOffset=False)
        ax.tick_params(axis="x", labelrotation=30)
    entries = [
        (Line2D([], [], **_MENDED), "reading"),
        (Line2D([], [], **_AS_PRINTED), "reading as printed, without its minus sign"),
        (Line2D([], [], color=PALE), "least squares"),
    ]
    layout.legend(figure, entries)
    note = "The 27 printed rows of appendix B1. Lines: least squares through the readings with their signs put back."
    return layout.finish(figure, Setting("published"), note)


@matplotlib.style.context(STYLE)
def returned_numbers(check: pd.DataFrame, origin: str) -> Figure:
    """Return how far each cell comes back from its printed value, in units of what its printed digits allow.

    Parameters
    ----------
    check:
        Rows of `bayes_tyre.published.checks`: `quantity`, `published`, `recomputed`, `tolerance`.
    origin:
        Of the data that the numbers come back from.
    """
    off = (check["recomputed"] - check["published"]) / check["tolerance"]
    groups = {"k of a case": "k (kN/mm), ", "beta of a case": "beta (mm), "}
    groups |= {"a mean of k": "mean k (kN/mm), ", "a mean of beta": "mean beta (mm), "}
    groups["a mean of k by speed"] = "model k (kN/mm), "
    figure = layout.page(WIDTH, 2.9)
    ax = figure.subplots()
    ax.axvspan(-1, 1, color=PALE, alpha=0.2, linewidth=0)
    names = []
    for y, (name, start) in enumerate(groups.items()):
        values = off[check["quantity"].str.startswith(start)].to_numpy()
        spread = np.linspace(-0.28, 0.28, len(values)) if len(values) > 1 else np.zeros(len(values))
        ax.plot(values, y + spread, "o", color=INK, markersize=2.8, alpha=0.7)
        names.append(f"{name} ({len(values)})")
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    reach = 1.1 * max(1.0, float(off.abs().max()))
    ax.set(xlim=(-reach, reach), xlabel="(returned - printed) / half a unit of the last printed digit (no unit)")
    note = "Marker: a printed number. Shaded: what the printed digits allow. A marker outside would be a fault of ours."
    return layout.finish(figure, Setting(origin), note)
