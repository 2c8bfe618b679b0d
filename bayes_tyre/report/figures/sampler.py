"""Diagnostics of the sampler on the hyperparameters: ranks by chain, and a pair plot."""

from typing import NamedTuple

import matplotlib
import matplotlib.style
import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from bayes_tyre.record import DIRECTIONS
from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, PALE_BAND, Look, Setting
from bayes_tyre.report.figures.page.labels import decimals, plain, unit_name
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH
from bayes_tyre.results.figure_data.density import density
from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter
from bayes_tyre.results.figure_data.ranks import BAND, Ranks, in_words

#: Panels side by side, the height of a row of them (inches), the most panels.
ACROSS, ROW, MOST_RANKED = 4, 1.1, 60
#: Letters of a title above a panel.
_LONGEST = 30
#: Draws that a cloud of a pair plot shows; divergent ones are all shown.
CLOUD = 500
#: Correlation above which two parameters are hard to tell apart: printed bold.
STRONG = 0.5
_CLOUD = {"marker": "o", "markersize": 1.3, "markeredgewidth": 0, "linestyle": "none", "color": PALE, "alpha": 0.6}
_DIVERGENT = {"marker": "x", "markersize": 4, "linestyle": "none", "color": INK}
#: How a parameter looks that belongs to no configuration.
_OF_NONE = Look(INK, "o", "-", "")


class _Paired(NamedTuple):
    """One parameter on its row and column: its name and look, its draws or their logarithms, and the axis's ends."""

    name: str
    look: Look
    values: np.ndarray
    span: tuple[float, float]


@matplotlib.style.context(STYLE)
def rank_plot(ranks: list[Ranks], setting: Setting) -> Figure:
    """Return the rank distribution of each hyperparameter by chain, as differences from the uniform one.

    Parameters
    ----------
    ranks:
        As `bayes_tyre.results.figure_data.ranks.ranks` gives them, one a parameter.
    setting:
        What all figures of the result share.
    """
    # Not ArviZ's rank plot: that one has no band for all chains together, and no fixed size for a page.
    shown = ranks[:MOST_RANKED]
    figure, axes, first_column = layout.panel_grid(len(shown), ACROSS, ROW, 1.1, sharex=True, sharey=True)
    chains = max((len(one.excess) for one in shown), default=1)
    colours = matplotlib.colormaps["viridis"](np.linspace(0, 0.9, chains))
    for ax, one in zip(axes, shown, strict=True):
        ax.fill_between(one.at, -one.band, one.band, **PALE_BAND)
        for excess, colour in zip(one.excess, colours, strict=False):
            ax.plot(one.at, excess, color=colour, linewidth=0.9)
        ax.set_title(_title(one.name), fontsize=7)
        ax.tick_params(labelsize=6.5, length=2, pad=1.5)
    layout.rank_axes(axes, first_column, ACROSS)
    entries = [(Line2D([], [], color=colour), f"chain {i}") for i, colour in enumerate(colours)]
    band = Patch(**PALE_BAND), f"{100 * BAND:g} % band"
    layout.legend(figure, [*(entries if chains <= 8 else []), band])
    note = (
        "Excess: share of a chain's draws up to a rank among all, less the share expected; draws thinned to the "
        "effective size. Above the band are too many low values, below too few."
    )
    left_out = layout.left_out(len(shown), len(ranks), "parameters")
    return layout.finish(figure, setting, " ".join([note, in_words(ranks)]).rstrip() + left_out)


@matplotlib.style.context(STYLE)
def pair_plot(shown: list[Hyperparameter], divergent: Bool[np.ndarray, "chains draws"], setting: Setting) -> Figure:
    """Return the pair plot of the hyperparameters with correlations, and densities on the diagonal.

    Parameters
    ----------
    shown:
        The parameters, draws of shape (chains, draws).
    divergent:
        Draws that ended a divergent transition: marked.
    setting:
        What all figures of the result share.
    """
    # Not ArviZ's pair plot: that one has neither correlations nor a colour by configuration.
    size = max(1, len(shown))
    figure = layout.page(WIDTH, 1.0 + (WIDTH - 0.5) * max(size, 3) / max(size, 4))
    grid = figure.add_gridspec(size, size)
    appearance = setting.looks(one.configuration for one in shown if one.configuration is not None)
    axes = [_paired(one, _OF_NONE if one.configuration is None else appearance[one.configuration]) for one in shown]
    apart = max(1, divergent.size // CLOUD)
    for i, down in enumerate(axes):
        for j, right in enumerate(axes[: i + 1]):
            ax = figure.add_subplot(grid[i, j])
            if i == j:
                _diagonal(ax, down)
            else:
                _cloud(ax, right.values, down.values, divergent, apart)
            _name_edges(ax, i, j, size, right, down)
    figure.align_labels()
    return layout.finish(figure, setting, _pair_note(divergent, apart))


def _title(name: str) -> str:
    """Return a parameter's name above a panel; a long one in two lines, so that its label keeps what tells it apart."""
    parameter, bracket, label = name.partition("[")
    if len(name) <= _LONGEST or not bracket:
        return plain(name, _LONGEST)
    return f"{plain(parameter, _LONGEST)}\n{plain(label.removesuffix(']'), _LONGEST)}"


def _cloud(ax: Axes, right: np.ndarray, down: np.ndarray, divergent: np.ndarray, apart: int) -> None:
    ax.plot(right.ravel()[::apart], down.ravel()[::apart], **_CLOUD)
    ax.plot(right[divergent], down[divergent], **_DIVERGENT)
    correlation = float(np.corrcoef(right.ravel(), down.ravel())[0, 1])
    strong = "bold" if abs(correlation) > STRONG else "normal"
    place = {"transform": ax.transAxes, "ha": "right", "va": "top", "fontsize": 6}
    ax.text(1.0, 1.0, decimals(correlation), weight=strong, **place)


def _diagonal(ax: Axes, one: _Paired) -> None:
    x, height, *_ = density(one.values.ravel())
    look = one.look
    ax.fill_between(x, height, **look.band)
    ax.plot(x, height, color=look.colour, linestyle=look.line, linewidth=1)
    ax.set_ylim(0, 1.1 * height.max())


def _name_edges(ax: Axes, i: int, j: int, size: int, right: _Paired, down: _Paired) -> None:
    """Give panel i, j its limits, and on the left and lower edge of the matrix its names and ticks."""
    ax.grid(False)
    ax.tick_params(labelsize=6, length=2, pad=1.5, labelbottom=i == size - 1, labelleft=j == 0 and i > 0)
    ax.set_xlim(right.span)
    ax.xaxis.set_major_locator(MaxNLocator(2, min_n_ticks=2))
    ax.yaxis.set_major_locator(MaxNLocator(2, min_n_ticks=2))
    if i == j:
        ax.set_yticks([])
    else:
        ax.set_ylim(down.span)
    if i == size - 1:
        ax.set_xlabel(right.name, fontsize=6, labelpad=2)
        ax.tick_params(axis="x", labelrotation=45)
    if j == 0:
        ax.set_ylabel(down.name, fontsize=6, labelpad=2)


def _paired(one: Hyperparameter, look: Look) -> _Paired:
    """Return a parameter as a pair plot has it: its logarithm where it ranges over more than a decade."""
    low, high = float(one.draws.min()), float(one.draws.max())
    log = low > 0 and high > 10 * low
    values = np.log10(one.draws) if log else one.draws
    low, high = float(values.min()), float(values.max())
    room = 0.04 * (high - low)
    return _Paired(_name(one, log), look, values, (low - room, high + room))


def _name(one: Hyperparameter, log: bool) -> str:
    """Return a parameter's name and unit on short lines: ``k_group``, ``dual``, ``loading``, ``(kN/mm)``."""
    name, _, label = one.name.removesuffix("]").partition("[")
    names = name.replace("_repeat", "\n_repeat").replace("_case", "\n_case").replace("_published", "\n_published")
    first, _, last = label.rpartition(" ")
    factors = [first, last] if last in DIRECTIONS else [label]
    lines = ["log10 of" if log else "", names, *(plain(factor, 12) for factor in factors), f"({unit_name(one.unit)})"]
    return "\n".join(line for line in lines if line)


def _pair_note(divergent: np.ndarray, apart: int) -> str:
    count = int(divergent.sum())
    marked = f"Crosses: divergent transitions ({count})." if count else "No transition diverged."
    every = f"one draw in {apart}" if apart > 1 else "every draw"
    return f"Points: {every}. Numbers: correlations, bold above {STRONG:g} in size. {marked}"
