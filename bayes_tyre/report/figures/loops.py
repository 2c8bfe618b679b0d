"""Driven curves with the law fitted to each of their branches, and the backbones of their closed cycles."""

from typing import Any

import matplotlib.style
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Setting
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import STYLE

#: The most curves on a figure.
MOST_CURVES = 8
_POINTS: dict[str, Any] = {"marker": ".", "markersize": 4.0, "linestyle": "none", "markeredgewidth": 0}
_LAW: dict[str, Any] = {"color": INK, "linewidth": 0.6}
_BACKBONE: dict[str, Any] = {"color": PALE, "linewidth": 1.0, "linestyle": "--"}


@matplotlib.style.context(STYLE)
def driven_loops(
    branches: pd.DataFrame, laws: Float[np.ndarray, "branches points 2"], backbones: pd.DataFrame, setting: Setting
) -> Figure:
    """Return a panel a curve: its points, Equation 2 as fitted to each branch, and the backbone of each cycle.

    Parameters
    ----------
    branches:
        Points of the branches (mm, kN), as `bayes_tyre.signals.reversals.cut_loops` cuts them; the first eight curves
        are drawn.
    laws, backbones:
        As `bayes_tyre.inference.least_squares.loops` computes them (mm, kN).
    setting:
        What all figures of the result share.
    """
    names = branches["loop"].unique()
    shown = names[:MOST_CURVES]
    figure, axes, first_column = layout.panel_grid(len(shown), 2 if len(shown) > 1 else 1, 3.0, 1.1)
    first = branches.drop_duplicates("record")
    for ax, name in zip(axes, shown, strict=True):
        curve = branches[branches["loop"] == name]
        configuration = str(curve["configuration"].iloc[0]) if "configuration" in curve else ""
        ax.plot(
            curve["displacement_mm"],
            curve["force_kN"],
            color=setting.looks([configuration])[configuration].colour,
            **_POINTS,
        )
        for law in laws[(first["loop"] == name).to_numpy()]:
            ax.plot(*law.T, **_LAW)
        for _, backbone in backbones[backbones["record"] == name].groupby("cycle"):
            ax.plot(backbone["displacement_mm"], backbone["backbone_kN"], **_BACKBONE)
        ax.set_title(plain(name), fontsize=8)
        ax.set_xlabel("displacement (mm)")
    for ax in first_column:
        ax.set_ylabel("force (kN)")
    points = Line2D([], [], color=INK, **_POINTS), "points"
    lines = [(_LAW, "Equation 2, each branch"), (_BACKBONE, "backbone, each closed cycle")]
    layout.legend(figure, [points, *((Line2D([], [], **look), label) for look, label in lines)])
    note = "Curves are cut at their reversals. Backbone: mean of loading and unloading force at equal displacement."
    return layout.finish(figure, setting, note + layout.left_out(len(shown), len(names), "curves"))
