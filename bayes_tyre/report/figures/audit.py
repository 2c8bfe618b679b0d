"""Figures of the audit: what each method returns against known truths, and what moves it."""

import math
from collections.abc import Iterable, Iterator, Mapping

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, SIMULATED, Look, looks_of_none
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH
from bayes_tyre.report.wording import text_name

_IDENTITY = {"color": INK, "linewidth": 0.8, "linestyle": "--"}
#: Of all figures here: each keeps its look where others are not shown.
_METHODS = ("inertia", "motion", "thesis")
#: What has no name of its own in `labels`.
_NAMES = {"energy_with_true_x": "energy with the true x"}
#: An axis of beta ends at so many times the largest truth.
_TIMES = 10.0


def draw(
    table: pd.DataFrame,
    bias_of_k: pd.DataFrame,
    shown: pd.DataFrame,
    windows: pd.DataFrame,
    factors: Mapping[str, tuple[str, str]],
    typical: Mapping[str, float],
) -> Iterator[tuple[str, Figure]]:
    """Yield the name and the figure of each kind: `audit.csv`, then the tables that each function below takes."""
    source_window = int(typical["window_samples"])
    yield "beta_returned", beta_returned(table, source_window)
    yield "k_bias", k_bias(bias_of_k, factors, typical)
    yield "coverage", coverage(shown)
    yield "beta_window", beta_window(windows, source_window)


@matplotlib.style.context(STYLE)
def beta_returned(table: pd.DataFrame, source_window: int) -> Figure:
    """Return the median beta returned against the true one, a panel a method, both logarithmic, with the identity.

    Parameters
    ----------
    table:
        As `audit.csv`.
    source_window:
        Of the moving mean, samples: other lengths are drawn pale.
    """
    rows = _positive(table[table["parameter"] == "beta"])
    methods, top = list(dict.fromkeys(table["method"])), _top(rows)
    figure = layout.page(WIDTH, 3.4)
    axes = figure.subplots(1, len(methods), sharex=True, sharey=True, squeeze=False)[0]
    appearance = method_looks(methods)
    for ax, method in zip(axes, methods, strict=True):
        mine, look = rows[rows["method"] == method], appearance[method]
        window = mine["window_samples"].to_numpy(float, na_value=np.nan)  # a method without one has none
        other = ~np.isnan(window) & (window != source_window)
        ax.plot(mine["truth"][other], mine["median"][other], ".", color=PALE, markersize=3, zorder=1)
        ax.plot(mine["truth"][~other], mine["median"][~other], look.marker, color=look.colour, markersize=4, zorder=2)
        for part, colour in ((other, PALE), (~other, look.colour)):
            _arrows(ax, mine["truth"][part], mine["median"][part], top, colour)
        ends = [rows["truth"].min(), rows["truth"].max()] if len(rows) else [0.01, 0.1]
        layout.log_axis(ax, 0.8 * ends[0], 1.25 * ends[1], crowd=2.0)
        _log_up_to(ax, rows["median"], top)
        ax.tick_params(labelsize=7)
        ax.plot(ends, ends, **_IDENTITY)
        ax.set_title(method, fontsize=9)
        ax.set_xlabel("true beta (mm, log scale)", fontsize=8)
    axes[0].set_ylabel("beta returned, median\n(mm, log scale)", fontsize=8)
    handles = [
        (Line2D([], [], **_IDENTITY), "the truth"),
        (Line2D([], [], color=PALE, marker=".", linestyle=""), "thesis, other windows"),
    ]
    layout.legend(figure, handles)
    note = (
        f"Simulated records of a stationary axle; a point a truth (k, x, beta, damping, rise time, step). thesis with "
        f"the source's window of {source_window} samples, and pale with others; the other methods smooth nothing."
        f"{_beyond(rows['median'], top)}"
    )
    return layout.finish(figure, SIMULATED, note)


@matplotlib.style.context(STYLE)
def k_bias(rows: pd.DataFrame, factors: Mapping[str, tuple[str, str]], typical: Mapping[str, float]) -> Figure:
    """Return the bias of k by method against each factor, the others typical.

    Parameters
    ----------
    rows:
        `method, factor, level, bias_percent`; the level is NaN where the method has no such factor.
    factors:
        Name and unit by factor, a panel each.
    typical:
        The level of each factor that the others are varied about.
    """
    appearance = method_looks(rows["method"])
    figure = layout.page(WIDTH, 4.8)
    axes = figure.subplots(2, math.ceil(len(factors) / 2), sharey=True, squeeze=False)
    for ax in axes.ravel()[len(factors) :]:
        ax.set_visible(False)
    for ax, (factor, (name, unit)) in zip(axes.ravel(), factors.items(), strict=False):
        for method, look in appearance.items():
            _draw_against(ax, rows[(rows["method"] == method) & (rows["factor"] == factor)], look)
        ax.axhline(0.0, **_IDENTITY)
        ax.set_xlabel(f"{name} ({unit})", fontsize=7)
    for ax in axes[:, 0]:
        ax.set_ylabel("bias of k, median (%)", fontsize=8)
    layout.legend(figure, [(look.interval_handle, method) for method, look in appearance.items()])
    about = ", ".join(
        f"{name} {typical[factor]:g} {unit}".replace("-", "\u2212") for factor, (name, unit) in factors.items()
    )
    note = (
        f"Simulated records of a stationary axle; one factor varied at a time about {about}. The window is thesis's. "
        "Dashed: no bias."
    )
    return layout.finish(figure, SIMULATED, note)


def _draw_against(ax: Axes, rows: pd.DataFrame, look: Look) -> None:
    style = {"color": look.colour, "linestyle": look.line, "linewidth": 1}
    at = rows["level"].to_numpy()
    if len(rows) and np.isnan(at).all():  # the method has no such factor
        ax.axhline(float(rows["bias_percent"].iloc[0]), **style)
    else:
        ax.plot(at, rows["bias_percent"], marker=look.marker, markersize=4, **style)


@matplotlib.style.context(STYLE)
def coverage(shown: pd.DataFrame) -> Figure:
    """Return the share of 95 % intervals that hold the truth, by parameter and method, with its own 95 % interval.

    Of `shown`: `method, parameter, intervals, coverage_95, coverage_low, coverage_high`, the last three shares.
    """
    rows = shown[shown["intervals"] > 0].reset_index(drop=True)
    appearance = method_looks(shown["method"])
    figure = layout.page(WIDTH, 1.4 + 0.25 * max(4, len(rows)))
    ax = figure.subplots()
    for i, (_, row) in enumerate(rows.iterrows()):
        look = appearance[row["method"]]
        ax.plot([100 * row["coverage_low"], 100 * row["coverage_high"]], [i, i], color=look.colour, linewidth=1.6)
        ax.plot(100 * row["coverage_95"], i, look.marker, color=look.colour, markersize=5)
    ax.axvline(95.0, **_IDENTITY)
    ax.set_yticks(
        range(len(rows)),
        [f"{_NAMES.get(p, text_name(p))}, {m}" for p, m in zip(rows["parameter"], rows["method"], strict=True)],
    )
    ax.set_ylim(max(1, len(rows)) - 0.5, -0.5)
    ax.set_xlim(-3, 103)
    ax.set_xlabel("95 % intervals that hold the truth (%)", fontsize=8)
    note = (
        "Simulated records of a stationary axle, all points together; thesis with the source's window. Marker: share; "
        "line: its own 95 % interval (exact binomial); dashed: 95 %. thesis and inertia: least squares' standard "
        "errors; motion: its own covariance."
    )
    return layout.finish(figure, SIMULATED, note)


@matplotlib.style.context(STYLE)
def beta_window(rows: pd.DataFrame, source_window: int) -> Figure:
    """Return beta by `thesis` against its smoothing window, a line a rise time and a panel a true beta.

    Of `rows`: `truth` and `median` (mm), `rise_s`, `window_samples`; `source_window` as of `beta_returned`.
    """
    determined = _positive(rows)
    betas = sorted(set(determined["truth"]))
    rises, top = sorted(set(determined["rise_s"])), _top(determined)
    by_rise = dict(zip(rises, looks_of_none(map(str, rises)).values(), strict=True))
    figure = layout.page(WIDTH, 3.4)
    axes = figure.subplots(1, max(1, len(betas)), sharex=True, sharey=True, squeeze=False)[0]
    for ax, beta in zip(axes, betas, strict=False):
        for rise, look in by_rise.items():
            line = determined[(determined["truth"] == beta) & (determined["rise_s"] == rise)].sort_values(
                "window_samples"
            )
            style = {"color": look.colour, "marker": look.marker, "linestyle": look.line, "markersize": 3}
            ax.plot(line["window_samples"].astype(float), line["median"], linewidth=1, **style)
            _arrows(ax, line["window_samples"].astype(float), line["median"], top, look.colour)
        ax.axhline(beta, **_IDENTITY)
        _log_up_to(ax, determined["median"], top)
        ax.set_title(f"true beta {beta:g} mm", fontsize=8)
        ax.set_xlabel("window (samples)", fontsize=7)
        ax.tick_params(labelsize=6)
    axes[0].set_ylabel("beta by thesis, median\n(mm, log scale)", fontsize=8)
    handles = [(look.interval_handle, f"rise {1e3 * rise:g} ms") for rise, look in by_rise.items()]
    layout.legend(figure, [*handles, (Line2D([], [], **_IDENTITY), "the truth")])
    note = (
        "Simulated records of a stationary axle, 10 kHz; only the moving mean's length is changed, all else as the "
        f"source has it (its own: {source_window} samples; 1: not smoothed). "
        f"No point where records do not determine beta.{_beyond(determined['median'], top)}"
    )
    return layout.finish(figure, SIMULATED, note)


def method_looks(methods: Iterable[str]) -> dict[str, Look]:
    """Return the look of each method, the same in every figure."""
    appearance = looks_of_none([*_METHODS, *methods])
    return {method: appearance[method] for method in dict.fromkeys(methods)}


def _top(rows: pd.DataFrame) -> float:
    """Return where an axis of beta ends, mm: what failed fits return, hundreds of mm, would leave the rest no room."""
    return _TIMES * float(rows["truth"].max()) if len(rows) else 1.0


def _log_up_to(ax: Axes, values: pd.Series, top: float) -> None:
    ax.set_yscale("log")
    if len(values) and values.max() > top:
        ax.set_ylim(0.7 * values.min(), top)
    if len(values):
        layout.plain_ticks(ax.yaxis, layout.log_steps(values.min(), min(values.max(), top), crowd=1.5))


def _arrows(ax: Axes, x: pd.Series, values: pd.Series, top: float, colour: str) -> None:
    """Mark at the end of the axis what lies beyond it."""
    above = values.to_numpy(float) > top
    ax.plot(x[above], np.full(above.sum(), 0.8 * top), linestyle="", marker=r"$\uparrow$", markersize=7, color=colour)


def _beyond(values: pd.Series, top: float) -> str:
    """Return what a note says of arrows, if there are any."""
    return f" Arrows: beyond the axis, up to {values.max():.3g} mm." if len(values) and values.max() > top else ""


def _positive(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows whose median can stand on a logarithmic axis."""
    return rows[rows["median"] > 0]
