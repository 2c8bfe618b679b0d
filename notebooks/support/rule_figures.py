"""What the source's rule and the posterior make of k, case by case, with the repeats behind it."""

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from support.rule import PLAIN, POSTERIOR, RULE

from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.figures.page import case_axis, layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Setting
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH

#: Height of a line, inches; how far a method stands below the middle of its line, lines.
_LINE, _BELOW = 0.5, {PLAIN: -0.12, RULE: 0.1, POSTERIOR: 0.32}
_REPEAT = {"marker": "|", "markersize": 9, "color": INK, "linestyle": "none"}
_LEFT_OUT = {"marker": "x", "markersize": 6, "color": "#CC0000", "linestyle": "none"}
_AXIS = "case: (speed, km/h)\nfirst load-last load, kN"
_GREYS = {PLAIN: PALE, RULE: "#555555"}


@matplotlib.style.context(STYLE)
def rule_and_posterior(fits: pd.DataFrame, estimates: pd.DataFrame, setting: Setting) -> Figure:
    """Return the repeats of each case and its k by three methods.

    Parameters
    ----------
    fits:
        As `least_squares.csv`, a row a record: each is a repeat's k.
    estimates:
        As `support.rule.k_by_method` gives them.
    setting:
        What all figures of the result share.
    """
    rows = case_axis.numbered(case_axis.case_factors(estimates).drop_duplicates())
    rows = case_axis.in_order(rows, [*CASE_FACTORS, "nth"])
    lines = case_axis.grouped_lines(rows)
    rows["y"] = [line.y for line in lines if not line.heads]
    repeats, estimates = fits.merge(rows), estimates.merge(rows)
    appearance = setting.looks(rows["configuration"])
    figure = layout.page(WIDTH, 1.3 + _LINE * len(lines))
    ax = figure.subplots()
    out = repeats["record"].isin(set(", ".join(estimates["left_out"]).split(", ")))
    ax.plot(repeats["k_kN_per_mm"], repeats["y"] - 0.32, **_REPEAT)
    ax.plot(repeats.loc[out, "k_kN_per_mm"], repeats.loc[out, "y"] - 0.32, **_LEFT_OUT)
    for (method, configuration), mine in estimates.groupby(["method", "configuration"], sort=False):
        look = appearance[str(configuration)]
        colour, marker = (look.colour, look.marker) if method == POSTERIOR else (_GREYS[str(method)], "s")
        y = mine["y"] + _BELOW[str(method)]
        ax.hlines(y, mine["lower"], mine["upper"], color=colour, linewidth=1.8)
        ax.plot(mine["k_kN_per_mm"], y, marker, color=colour)
    seen = np.concatenate([repeats["k_kN_per_mm"], estimates.loc[estimates["method"] == POSTERIOR, "upper"]])
    room = 0.15 * np.ptp(seen)
    ax.set(xlim=(seen.min() - room, seen.max() + room), xlabel="stiffness k (kN/mm)", ylabel=_AXIS)
    case_axis.name_lines(ax, lines, _LINE, len(lines))
    entries = [(Line2D([], [], **_REPEAT), "a repeat"), (Line2D([], [], **_LEFT_OUT), "left out by the rule")]
    entries += [(Line2D([], [], color=grey, marker="s"), method) for method, grey in _GREYS.items()]
    entries += [(look.interval_handle, f"{POSTERIOR}, {name}") for name, look in appearance.items()]
    layout.legend(figure, entries)
    note = (
        "Lines: 95 % interval; of a mean Student's, from the repeats that it keeps (a line that leaves the page goes "
        "on). Of the posterior: median, equal-tailed."
    )
    return layout.finish(figure, setting, note)
