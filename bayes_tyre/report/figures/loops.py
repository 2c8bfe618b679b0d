"""Driven curves with the law fitted to each of their branches, and the backbones of their closed cycles."""

from typing import Any

import matplotlib.style
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.report.figures import layout
from bayes_tyre.report.figures.colours import INK, PALE, Setting
from bayes_tyre.report.figures.labels import plain
from bayes_tyre.report.figures.layout import STYLE

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
    labels = first.get("configuration", pd.Series("", index=first.index)).to_numpy(str)
    looks = setting.looks(labels)
    for ax, name in zip(axes, shown, strict=True):
        own = (first["loop"] == name).to_numpy()
        curve = branches[branches["loop"] == name]
        colour = looks[labels[own][0]].colour
        ax.plot(curve["displacement_mm"], curve["force_kN"], color=colour, **_POINTS)
        _lines(ax, laws[own], backbones[backbones["record"] == name])
        ax.set_title(plain(name), fontsize=8)
        ax.set_xlabel("displacement (mm)")
    for ax in first_column:
        ax.set_ylabel("force (kN)")
    entries = [(Line2D([], [], color=INK, **_POINTS), "points"), (Line2D([], [], **_LAW), "Equation 2, each branch")]
    layout.legend(figure, [*entries, (Line2D([], [], **_BACKBONE), "backbone, each closed cycle")])
    left_out = "" if len(shown) == len(names) else f" The first {len(shown)} of {len(names)} curves."
    note = "Curves are cut at their reversals. Backbone: mean of loading and unloading force at equal displacement."
    return layout.finish(figure, setting, note + left_out)


def _lines(ax: Axes, laws: Float[np.ndarray, "branches points 2"], backbones: pd.DataFrame) -> None:
    for law in laws:
        ax.plot(*law.T, **_LAW)
    for _, backbone in backbones.groupby("cycle"):
        ax.plot(backbone["displacement_mm"], backbone["backbone_kN"], **_BACKBONE)
