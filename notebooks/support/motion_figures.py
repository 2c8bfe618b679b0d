"""Figures of a simulated motion: the hysteresis loop of a known tyre, and estimates relative to their true values."""

import matplotlib.style
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Setting
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH

_TRUTH = {"color": INK, "linewidth": 0.8, "linestyle": "--"}


@matplotlib.style.context(STYLE)
def loop_figure(path: pd.DataFrame, amplitude_mm: float) -> Figure:
    """Return a known tyre's loop: the force at the left, and without its middle line k d + C at the right.

    Parameters
    ----------
    path:
        `displacement_mm`, `force_kN`, `friction_kN` (force less k d + C) in order around the loop, simulated.
    amplitude_mm:
        Half the stroke.
    """
    figure = layout.page(WIDTH, 3.4)
    axes = figure.subplots(1, 2)
    names = (("force_kN", "force less C, flat ground (kN)"), ("friction_kN", "force less k d + C, flat ground (kN)"))
    for ax, (column, label) in zip(axes, names, strict=True):
        ax.plot(path["displacement_mm"], path[column], color=INK)
        ax.fill(path["displacement_mm"], path[column], facecolor=(PALE, 0.3), linewidth=0)
        ax.set_xlabel("displacement from the middle, flat ground (mm)")
        ax.set_ylabel(label)
    note = (
        f"A simulated tyre moved up and down by {amplitude_mm:g} mm either way. The shaded area, the same at both "
        "sides, is the energy that a cycle loses."
    )
    return layout.finish(figure, Setting("simulated"), note)


@matplotlib.style.context(STYLE)
def off_the_truth(table: pd.DataFrame) -> Figure:
    """Return how far each quantity is off its known truth, a line a quantity and a marker a record.

    Parameters
    ----------
    table:
        A row a record and quantity, simulated: `record`, and what `support.motion_truth.beside_truth` gives.
    """
    quantities = list(dict.fromkeys(table["quantity"]))
    appearance = Setting("measured").looks(table["record"])
    figure = layout.page(WIDTH, 1.2 + 0.34 * len(quantities))
    ax = figure.subplots()
    ax.axvline(0.0, **_TRUTH)
    for i, (record, look) in enumerate(appearance.items()):
        mine = table[table["record"] == record]
        at = mine["quantity"].map(quantities.index) + 0.6 * ((i + 0.5) / len(appearance) - 0.5)
        off = {end: 100 * (mine[end] / mine["truth"] - 1) for end in ("median", "lower", "upper")}
        ax.hlines(at, off["lower"], off["upper"], color=INK, linewidth=1.2)
        ax.plot(off["median"], at, look.marker, color=INK, markersize=4)
    ax.set_yticks(range(len(quantities)), quantities)
    ax.invert_yaxis()
    ax.set_xlabel("off the truth (%)")
    style = {"color": INK, "linewidth": 1.2}
    layout.legend(figure, [(Line2D([], [], marker=look.marker, **style), plain(n)) for n, look in appearance.items()])
    return layout.finish(figure, Setting("simulated"), "Marker: median. Line: 95 % interval. Dashed: the truth.")
