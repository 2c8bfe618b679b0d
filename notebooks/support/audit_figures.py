"""One simulated record of the audit: its true path, and the paths that the methods return."""

from collections.abc import Mapping

import matplotlib.style
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.report.figures.audit import method_looks
from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, Setting
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH


@matplotlib.style.context(STYLE)
def one_record(truth: pd.DataFrame, paths: Mapping[str, pd.DataFrame]) -> Figure:
    """Return force over displacement of one simulated record: the truth, and what methods make of it.

    Parameters
    ----------
    truth:
        `displacement_mm`, `force_kN` on flat ground, in time's order from the step's start to the first reversal.
    paths:
        The same by method, each from its own first point; a displacement may be counted from anywhere.
    """
    appearance = method_looks(paths)
    figure = layout.page(WIDTH, 4.0)
    ax = figure.subplots()
    styles = {"truth": {"color": INK, "linewidth": 2.5, "alpha": 0.5}}
    styles |= {name: {"color": appearance[name].colour, "linestyle": appearance[name].line} for name in paths}
    for name, path in {"truth": truth, **paths}.items():
        u = path["displacement_mm"] - path["displacement_mm"].iloc[0]
        ax.plot(u, path["force_kN"], **{"linewidth": 1.2, **styles[name]})
    ax.set_xlabel("displacement from the step's start, flat ground (mm)")
    ax.set_ylabel("force, flat ground (kN)")
    layout.legend(figure, [(Line2D([], [], **style), name) for name, style in styles.items()])
    return layout.finish(
        figure, Setting("simulated"), "One simulated record of a stationary axle; truth: what its tyre did."
    )
