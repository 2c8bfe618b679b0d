"""Average ratios of several results side by side: what one kind of data supports, beside what another would."""

from collections.abc import Mapping

import matplotlib.style
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.inference.sampling.datatree import CASE_PARAMETERS
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.figures.page import case_axis, layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Setting
from bayes_tyre.report.figures.page.labels import interval_name, plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH

#: Height of a line, inches; distance between results on it, lines.
_LINE, _APART = 0.26, 0.34
#: How the results look, in their order; no configuration has these.
_LOOKS = (
    {"color": INK, "marker": "o", "markersize": 5.0},
    {"color": PALE, "marker": "s", "markersize": 5.0, "markerfacecolor": "white"},
    {"color": "#555555", "marker": "^", "markersize": 5.0},
)


@matplotlib.style.context(STYLE)
def average_contrasts(contrasts: Mapping[str, pd.DataFrame], setting: Setting) -> Figure:
    """Return the average ratios of k and beta of up to three results, a line a ratio, a marker a result.

    Parameters
    ----------
    contrasts:
        Tables as `bayes_tyre.results.contrasts.contrasts` gives them, by what to call each result.
    setting:
        What all figures of the results share: the origin names every kind of data, joined by `` + ``.
    """
    named = {name: table[table[list(CASE_FACTORS[2:])].isna().all(axis=1)] for name, table in contrasts.items()}
    averages = pd.concat([table.assign(result=name) for name, table in named.items()], ignore_index=True)
    keys = ["contrast", "matching", "configuration", "direction"]
    averages[keys] = averages[keys].fillna("")
    listed = averages.drop_duplicates(keys)[keys].sort_values(keys[:2], kind="stable", ignore_index=True)
    headings = [plain(f"{row['contrast']}, {row['matching']}", 60) for row in listed.to_dict("records")]
    labels = [", ".join(word for word in row if word) or "all" for row in listed[keys[2:]].to_numpy()]
    lines = case_axis.list_lines(headings, [plain(label) for label in labels])
    averages = averages.merge(listed.assign(y=[line.y for line in lines if not line.heads]))
    figure = layout.page(WIDTH, 1.3 + _LINE * len(lines))
    axes = figure.subplots(1, 2, sharey=True)
    for ax, parameter in zip(axes, CASE_PARAMETERS, strict=True):
        _panel(ax, averages[averages["parameter"] == parameter], list(contrasts))
        case_axis.name_lines(ax, lines, _LINE, len(lines))
        ax.set_xlabel(f"ratio of {parameter} (no unit)")
    layout.legend(
        figure, [(Line2D([], [], **look), plain(name)) for name, look in zip(contrasts, _LOOKS, strict=False)]
    )
    contents = " or ".join(interval_name(one) for one in sorted(set(averages["interval"])))
    note = (
        f"Marker: median of the averaged ratio. Line: {contents}, equal-tailed. Dashed: 1, no difference. Bold: the "
        "ratio and which cases are set against each other."
    )
    return layout.finish(figure, setting, note)


def _panel(ax: Axes, averages: pd.DataFrame, results: list[str]) -> None:
    ax.axvline(1.0, color=INK, linestyle="--", linewidth=0.8)
    for i, (name, look) in enumerate(zip(results, _LOOKS, strict=False)):
        mine = averages[averages["result"] == name]
        y = mine["y"] + _APART * (i - (len(results) - 1) / 2)
        ax.hlines(y, mine["lower"], mine["upper"], color=look["color"], linewidth=1.8)
        ax.plot(mine["median"], y, linestyle="none", **look)
