"""Figures of the studies: ranks of truths, methods under discordant repeats, and coverage by kind of data."""

from typing import NamedTuple

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, PALE_BAND, SIMULATED, looks_of_none
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH

#: Panels side by side, and the height of a row of them, inches.
ACROSS, ROW = 5, 1.15
_WRONG = "#CC79A7"
#: Probability, %, below which labels of neighbouring points would overlap.
_APART = 10.0


class RankCurves(NamedTuple):
    """How ranks of truths run against uniform ones.

    Attributes
    ----------
    at, lower, upper:
        Shape (points,): shares from 0 to 1, and the excess that uniform ranks keep between.
    excess:
        By parameter, shape (points,): the share of ranks up to `at`, less `at`.
    calibrated:
        By parameter.
    datasets, draws:
        Numbers of truths, and of draws that each was ranked among.
    together:
        Probability that uniform ranks of all parameters keep inside.
    drawn_from:
        What the truths are drawn from.
    """

    at: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    excess: dict[str, np.ndarray]
    calibrated: dict[str, bool]
    datasets: int
    draws: int
    together: float
    drawn_from: str


@matplotlib.style.context(STYLE)
def calibration_plot(curves: RankCurves) -> Figure:
    """Return the distribution of each parameter's ranks less the uniform one, with bands that hold for all together."""
    names = list(curves.excess)
    figure, axes, first_column = layout.panel_grid(len(names), ACROSS, ROW, 1.1, sharex=True, sharey=True)
    for ax, name in zip(axes, names, strict=True):
        ax.fill_between(curves.at, curves.lower, curves.upper, step="mid", **PALE_BAND)
        ax.plot(curves.at, curves.excess[name], color=INK if curves.calibrated[name] else _WRONG, linewidth=0.9)
        ax.set_title(plain(name, 27), fontsize=6)
        ax.tick_params(labelsize=6, length=2, pad=1.5)
    layout.rank_axes(axes, first_column, ACROSS)
    entries = [(Line2D([], [], color=INK), "calibrated"), (Line2D([], [], color=_WRONG), "not calibrated")]
    layout.legend(figure, [*entries, (Patch(**PALE_BAND), f"{100 * curves.together:g} % band for all panels together")])
    note = (
        f"Ranks of {curves.datasets} truths among {curves.draws} draws of their posteriors: the share up to each rank "
        f"less the share expected. Truths are drawn from {curves.drawn_from}. All above zero: estimates too high; all "
        "below: too low; first below, then above: intervals too wide; first above, then below: too narrow."
    )
    return layout.finish(figure, SIMULATED, note)


@matplotlib.style.context(STYLE)
def outlier_calibration_plot(table: pd.DataFrame) -> Figure:
    """Return the share of records that were discordant against the probability that they are, in bands of it."""
    figure = layout.page(WIDTH, 3.6)
    ax = figure.subplots()
    predicted, share = 100.0 * table["predicted"], 100.0 * table["discordant"]
    ax.plot([0, 100], [0, 100], color=PALE, linewidth=0.8, zorder=0)
    band = ax.vlines(predicted, 100.0 * table["lower"], 100.0 * table["upper"], color=PALE, linewidth=4)
    (shares,) = ax.plot(predicted, share, color=INK, marker="o", linestyle="none", markersize=3.5)
    apart = predicted > _APART
    for x, y, count in zip(predicted[apart], share[apart], table["records"][apart], strict=True):
        ax.annotate(f"{count}", (x, y), (4, -8), textcoords="offset points", fontsize=6)
    ax.set(xlabel="outlier_probability, mean (%)", ylabel="discordant records (%)")
    layout.legend(figure, [(shares, "share of discordant records"), (band, "95 % band for all together")])
    note = (
        "Simulated records with about the same posterior probability of being discordant, and how many of them are. "
        f"Numbers: records, above {_APART:g} %. Bands: where shares of independent records lie if the probabilities "
        "are right."
    )
    return layout.finish(figure, SIMULATED, note)


@matplotlib.style.context(STYLE)
def outlier_plot(table: pd.DataFrame) -> Figure:
    """Return error and coverage of each method against the share of discordant repeats, for case k and beta."""
    shown = table[table["group"] == "all cases"]
    figure = layout.page(WIDTH, 4.6)
    axes = figure.subplots(2, 4, sharex=True, sharey="row")
    columns = [(parameter, kind) for parameter in ("k", "beta") for kind in sorted(set(shown["kind"]))]
    appearance = looks_of_none(shown["method"])
    for j, (parameter, kind) in enumerate(columns):
        panel = shown[(shown["parameter"] == parameter) & (shown["kind"] == kind)]
        for method, rows in panel.groupby("method", sort=False):
            look = appearance[str(method)]
            line = {"color": look.colour, "marker": look.marker, "linestyle": look.line, "markersize": 4}
            x = 100.0 * rows["share"]
            axes[0, j].errorbar(x, 100 * rows["rmse"], 196.0 * rows["rmse_se"], linewidth=1, **line)
            either = rows["coverage"] - rows["coverage_lower"], rows["coverage_upper"] - rows["coverage"]
            axes[1, j].errorbar(x, 100 * rows["coverage"], 100 * np.array(either), linewidth=1, **line)
        axes[0, j].set_title(f"{parameter} of a case, {kind}", fontsize=8)
        axes[0, j].set_yscale("log")
        layout.plain_ticks(axes[0, j].yaxis, (1.0, 2.0, 5.0))
        axes[1, j].axhline(95.0, color=PALE, linewidth=0.8)
        axes[1, j].set_xlabel("discordant repeats (%)", fontsize=8)
    axes[0, 0].set_ylabel("relative error, rms (%)", fontsize=8)
    axes[1, 0].set_ylabel("coverage of\n95 % intervals (%)", fontsize=8)
    handles = [(look.interval_handle, method) for method, look in appearance.items()]
    layout.legend(figure, handles)
    note = (
        "Simulated campaigns of 12 cases x 3 repeats. Scattered: a discordant repeat has six times the usual scatter; "
        "shifted: it is 20 to 40 % off. Bars: 95 % interval of what is shown. The mean and the rules have Student's "
        "interval of the repeats kept."
    )
    return layout.finish(figure, SIMULATED, note)


@matplotlib.style.context(STYLE)
def coverage_plot(table: pd.DataFrame) -> Figure:
    """Return the coverage of 95 % intervals by kind of data, of all data sets and of those whose verdict is `pass`."""
    shown = table[table["interval"] == 0.95].set_index("kind")
    kinds = list(shown.index.unique())
    figure = layout.page(WIDTH, 1.6 + 0.27 * len(kinds))
    titles = {"k": "k of records", "beta": "beta of records", "k_case": "k of cases", "beta_case": "beta of cases"}
    titles |= {"k_ratio": "ratio of k", "beta_ratio": "ratio of beta"}
    axes = figure.subplots(1, len(titles), sharex=True, sharey=True)
    appearance = {"all": "all data sets", "passed": "data sets whose verdict is pass"}
    looks = looks_of_none(appearance)
    for ax, (quantity, title) in zip(axes, titles.items(), strict=True):
        rows = shown[shown["quantity"] == quantity]
        for up, (which, look) in zip((-0.13, 0.13), looks.items(), strict=True):
            share, error = 100.0 * rows[f"coverage_{which}"], 196.0 * rows[f"se_{which}"].fillna(0.0)
            line = {"color": look.colour, "marker": look.marker, "linestyle": "none", "markersize": 3.5}
            ax.errorbar(share, np.arange(len(kinds)) + up, xerr=error, linewidth=1, **line)
        ax.axvline(95.0, color=PALE, linewidth=0.8, zorder=0)
        ax.set_title(title, fontsize=8)
        ax.set_xlabel("coverage (%)", fontsize=8)
    axes[0].set(xlim=(-3, 103), ylim=(len(kinds) - 0.5, -0.5))
    axes[0].set_yticks(range(len(kinds)), [plain(kind.replace("_", " "), 30) for kind in kinds], fontsize=7)
    layout.legend(figure, [(look.interval_handle, appearance[which]) for which, look in looks.items()])
    note = (
        f"Share of 95 % intervals that hold the true value, of {shown['sets'].min()} simulated data sets of each kind. "
        "Bars: 1.96 standard errors over data sets. No point: no data set of the kind passed."
    )
    return layout.finish(figure, SIMULATED, note)
