"""Natural frequencies of a flexible ring over the mode: as measured, and as fitted with an interval."""

import matplotlib.style
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, Setting, looks_of_none
from bayes_tyre.report.figures.page.labels import interval_name, plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH


@matplotlib.style.context(STYLE)
def frequencies_by_mode(table: pd.DataFrame, condition: pd.Series, setting: Setting, note: str) -> Figure:
    """Return measured frequencies, Hz, over the mode, and the fit to each condition: its median and its interval.

    Parameters
    ----------
    table:
        As `frequencies.csv` holds it.
    condition:
        What each row was measured under, such as ``7 bar``; empty for all where there is one condition.
    setting, note:
        What all figures of the result share; and what stands below.
    """
    figure = layout.page(WIDTH, 4.6)
    ax = figure.subplots()
    looks, entries = looks_of_none(condition), []
    for label, rows in table.sort_values("mode").groupby(condition, sort=False):
        look = looks[str(label)]
        fitted = rows["fitted_Hz"]
        sides = [fitted - rows["lower"], rows["upper"] - fitted]
        style = {"color": look.colour, "linestyle": look.line, "marker": look.marker, "fillstyle": "none"}
        line = ax.errorbar(rows["mode"], fitted, sides, **style, markersize=7, capsize=5, elinewidth=1)
        entries.append((line, plain(f"fitted {label}".strip())))
    errors = 2 * table["standard_deviation_Hz"] if "standard_deviation_Hz" in table else None
    points = ax.errorbar(table["mode"], table["frequency_Hz"], errors, fmt="o", color=INK, markersize=3.5, linewidth=1)
    name = "measured" if errors is None else "measured, ± 2 standard deviations"
    layout.legend(figure, [(points, name), *entries[:8]])
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("mode (waves around the ring)")
    ax.set_ylabel("natural frequency (Hz)")
    bars = f"Bars with caps: {interval_name(float(table['interval'].iloc[0]))} of the fitted frequency. "
    return layout.finish(figure, setting, bars + note)
