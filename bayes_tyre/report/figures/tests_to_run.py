"""What further tests are expected to bring: a goal's width, or how probably it is wrong, against their number."""

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Setting
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH

#: What the columns of `plan.csv` expect, on the axis and in the note.
_MEASURES = {
    "width": ("width of the 95 % interval\n(% of the median)", "width"),
    "p_wrong": ("probability of a\nwrong ranking (%)", "probability"),
}


@matplotlib.style.context(STYLE)
def width_against_tests(plan: pd.DataFrame, now: float, precision: float, goal: str, setting: Setting) -> Figure:
    """Return the expected width of a goal's 95 % interval after each test of `plan.csv`, and the one to be reached.

    Of a ranking: the probability that it is wrong, in place of the width.
    """
    measure = "p_wrong" if "p_wrong_expected" in plan else "width"
    on_axis, name = _MEASURES[measure]
    figure = layout.page(WIDTH, 3.4)
    ax = figure.subplots()
    widths = 100.0 * np.array([now, *plan[f"{measure}_expected"]])
    new = np.array([False, *(plan["kind"] == "case")])
    at = np.arange(len(widths))
    ax.plot(at, widths, color=INK, linewidth=1.2)
    for shown, marker, label in ((~new, "o", "repeat of a case with records"), (new, "s", "test of a new case")):
        ax.plot(at[shown], widths[shown], marker, color=INK, markersize=4, label=label)
    ax.axhline(100.0 * precision, color=PALE, linestyle="--", linewidth=0.9, label="precision asked for")
    ax.set_ylim(0.0, 1.08 * max(widths.max(), 100.0 * precision))
    ax.set_xlim(-0.5, max(len(plan), 1) + 0.5)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("further tests")
    ax.set_ylabel(on_axis)
    layout.legend(figure, list(zip(*ax.get_legend_handles_labels(), strict=True)))
    note = f"{plain(goal)}: expected {name}, before any of the tests is run. At 0: the {name} now."
    return layout.finish(figure, setting, note)
