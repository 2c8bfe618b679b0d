"""k and beta by speed, load and step size, configurations side by side."""

import matplotlib.style
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.inference.sampling.datatree import CASE_PARAMETERS
from bayes_tyre.record import RECORD_UNITS
from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, Look, Setting
from bayes_tyre.report.figures.page.labels import configuration_label, interval_name
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH
from bayes_tyre.report.wording import AXIS_NAMES

_TITLES = {
    "speed_km_h": "by speed (km/h)",
    "initial_load_kN": "by initial load (kN)",
    "step_size_kN": "by size of the step (kN)",
}
_PRINTED = {"marker": "D", "markersize": 5, "markerfacecolor": "none", "markeredgecolor": INK, "linestyle": "none"}
#: Distance between configurations at a level, and of a printed value from its marker, in levels.
_APART, _BESIDE = 0.3, 0.1


@matplotlib.style.context(STYLE)
def by_levels(means: pd.DataFrame, setting: Setting) -> Figure:
    """Return means of k and beta over matched cases: a column a word, a row a parameter, a marker a configuration.

    Parameters
    ----------
    means:
        As `support.level_means.level_means` gives them.
    setting:
        What all figures of the result share.
    """
    columns = [by for by in _TITLES if (means["by"] == by).any()]
    appearance = setting.looks(means["configuration"])
    figure = layout.page(WIDTH, 5.8)
    axes = figure.subplots(len(CASE_PARAMETERS), len(columns), sharey="row", squeeze=False)
    for row, parameter in zip(axes, CASE_PARAMETERS, strict=True):
        for ax, by in zip(row, columns, strict=True):
            here = means[(means["by"] == by) & (means["parameter"] == parameter)]
            _panel(ax, here, appearance)
            ax.set_xlabel(f"{_TITLES[by].removeprefix('by ')}")
        row[0].set_ylabel(f"{AXIS_NAMES[parameter]} ({RECORD_UNITS[parameter]})")
    for ax, by in zip(axes[0], columns, strict=True):
        counts = sorted(set(means.loc[means["by"] == by, "cases"]))
        ax.set_title(f"{_TITLES[by].split(' (')[0]}: mean of {' or '.join(map(str, counts))} cases")
    entries = [(look.interval_handle, configuration_label(name)) for name, look in appearance.items()]
    if means["printed"].notna().any():
        entries.append((Line2D([], [], **_PRINTED), "mean of the printed values"))
    layout.legend(figure, entries)
    contents = " or ".join(interval_name(one) for one in sorted(set(means["interval"])))
    note = (
        f"Marker: median. Line: {contents}, equal-tailed. The levels of a panel average the same cases, those measured "
        "at all of them: nothing but the named quantity changes within a panel. Panels average different cases."
    )
    return layout.finish(figure, setting, note)


def _panel(ax: Axes, means: pd.DataFrame, appearance: dict[str, Look]) -> None:
    levels = sorted(set(means["level"]))
    for i, (configuration, look) in enumerate(appearance.items()):
        mine = means[means["configuration"] == configuration]
        at = mine["level"].map(levels.index) + _APART * (i - (len(appearance) - 1) / 2)
        ax.vlines(at, mine["lower"], mine["upper"], color=look.colour, linewidth=1.8)
        ax.plot(at, mine["median"], look.marker, color=look.colour)
        ax.plot(at + _BESIDE, mine["printed"], **_PRINTED, markeredgewidth=0.8)
    ax.set_xticks(range(len(levels)), [f"{level:g}" for level in levels])
    ax.set_xlim(-0.5, len(levels) - 0.5)
    ax.grid(axis="y")
    ax.grid(visible=False, axis="x")
