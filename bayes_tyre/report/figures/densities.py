"""Densities: of k and beta by direction, and of each hyperparameter with its prior; drawn by kernel estimates."""

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayes_tyre.inference.diagnostics.power_scaling import CONTRACTION_LEAST
from bayes_tyre.report.figures.page import case_axis, layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Look, Setting
from bayes_tyre.report.figures.page.labels import configuration_label, decimals, interval_name, plain, unit_name
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH
from bayes_tyre.report.wording import AXIS_NAMES, WIDE, panels
from bayes_tyre.results.columns import numbers, texts
from bayes_tyre.results.figure_data.density import density
from bayes_tyre.results.figure_data.prior_posterior import PriorPosterior

#: Panels side by side, the height of a row of them (inches), the most panels.
ACROSS, ROW, MOST_SCALES = 4, 1.35, 60
#: So many parameters have a row of full height each; of more, ticks are as few, for some have long numbers.
_TALL, _FEW = 2, 6
_PRIOR = {"facecolor": (PALE, 0.35), "edgecolor": PALE, "linewidth": 0.8}


@matplotlib.style.context(STYLE)
def posteriors_by_direction(
    group_draws: pd.DataFrame, setting: Setting, interval: float = 0.95, about: str = ""
) -> Figure:
    """Return the posterior densities of k, beta and more, a panel a direction, the configurations in each.

    Parameters
    ----------
    group_draws:
        Draws, long: `configuration`, `direction`, `parameter` (of `wording.AXIS_NAMES`), `unit`, `value`.
    setting:
        What all figures of the result share.
    interval:
        Content of the equal-tailed interval marked.
    about:
        A sentence that joins the note.
    """
    draws = pd.DataFrame(
        {column: texts(group_draws, column) for column in ("configuration", "direction", "parameter", "unit")}
    )
    draws["value"] = numbers(group_draws, "value")
    draws = draws[draws["value"].notna() & draws["parameter"].isin(list(AXIS_NAMES))]
    directions = sorted(set(draws["direction"]), key=case_axis.direction_rank) or [""]
    parameters = panels(draws["parameter"])
    appearance = setting.looks(draws["configuration"])
    each = (2.3 if len(parameters) <= _TALL else 1.7) + 0.1 * len(appearance)
    figure = layout.page(WIDTH, 1.0 + each * len(parameters))
    axes = figure.subplots(len(parameters), len(directions), sharex="row", sharey="row", squeeze=False)
    for row, parameter in zip(axes, parameters, strict=True):
        here = draws[draws["parameter"] == parameter]
        _density_row(list(row), [here[here["direction"] == d] for d in directions], appearance, interval, parameter)
        if len(parameters) > _TALL and row[0].get_xscale() == "linear":
            row[0].locator_params(axis="x", nbins=_FEW)
    for ax, direction in zip(axes[0], directions, strict=True):
        ax.set_title(plain(direction or "direction not stated"))
    layout.legend(figure, [(look.density_handle, configuration_label(name)) for name, look in appearance.items()])
    note = f"Mean over the cases of a direction. Bar, shading: {interval_name(interval)}, equal-tailed. Marker: median."
    return layout.finish(figure, setting, f"{note} {about}".rstrip())


def _density_row(
    axes: list[Axes], panels: list[pd.DataFrame], appearance: dict[str, Look], interval: float, parameter: str
) -> None:
    draws = pd.concat(panels)
    low, high = draws["value"].min(), draws["value"].max()
    log = bool(parameter in WIDE and low > 0 and high > 10 * low)
    strip = min(0.5, 0.08 * len(appearance))
    highest = 0.0
    for ax, panel in zip(axes, panels, strict=True):
        unit = layout.name_axis(ax, parameter, draws, log)
        for i, (configuration, look) in enumerate(appearance.items()):
            values = panel.loc[panel["configuration"] == configuration, "value"].to_numpy()
            if len(values):
                bar = strip * (1 - (i + 0.5) / len(appearance))
                highest = max(highest, _density(ax, values, look, log, interval, bar))
        axes[0].set_ylabel(f"density (per {f'decade of {unit}' if log else unit})")
        ax.axhline(0, color="#666666", linewidth=0.7)
    if log:
        layout.log_axis(axes[0], low, high)
    top = 1.05 * highest or 1.0
    axes[0].set_ylim(-top * strip / (1 - strip), top)
    axes[0].set_yticks([tick for tick in axes[0].get_yticks() if 0 <= tick <= top])


def _density(ax: Axes, values: np.ndarray, look: Look, log: bool, interval: float, bar: float) -> float:
    """Draw one density, and its interval at height `bar` of the panel; return the density's highest point."""
    x, height, lower, median, upper = density(values, interval, decades=log)
    below = ax.get_xaxis_transform()
    ax.plot([lower, upper], [bar, bar], color=look.colour, linewidth=2, transform=below, solid_capstyle="butt")
    ax.plot([median], [bar], color=look.colour, marker=look.marker, markersize=5.5, transform=below)
    if not len(x):
        ax.axvline(median, color=look.colour, linestyle=look.line)
        return 0.0
    ax.plot(x, height, color=look.colour, linestyle=look.line)
    ax.fill_between(x, height, where=((x >= lower) & (x <= upper)).tolist(), **look.shade)
    return float(height.max())


@matplotlib.style.context(STYLE)
def prior_and_posterior_of_scales(hyperparameters: list[PriorPosterior], setting: Setting) -> Figure:
    """Return the prior and posterior density of each hyperparameter, a panel each, with the contraction in the title.

    Parameters
    ----------
    hyperparameters:
        As `bayes_tyre.results.figure_data.prior_posterior.prior_posteriors` gives them.
    setting:
        What all figures of the result share.
    """
    shown = hyperparameters[:MOST_SCALES]
    figure, axes, first_column = layout.panel_grid(len(shown), ACROSS, ROW, 0.9)
    for ax, hyperparameter in zip(axes, shown, strict=True):
        _hyperparameter_panel(ax, hyperparameter)
    for ax in first_column:
        ax.set_ylabel("density / highest\n(no unit)", fontsize=7)
    layout.legend(figure, [(Patch(**_PRIOR), "prior"), (Line2D([], [], color=INK), "posterior")])
    note = (
        "Contraction: 1 - (variance of posterior / prior), of the logarithm on logarithmic axes; 0: posterior as wide "
        f"as the prior, 1: determined by the data. Bold: below {CONTRACTION_LEAST:g}, weakly identified."
    )
    return layout.finish(figure, setting, note + layout.left_out(len(shown), len(hyperparameters)))


def _hyperparameter_panel(ax: Axes, hyperparameter: PriorPosterior) -> None:
    ax.fill_between(hyperparameter.at, hyperparameter.prior, **_PRIOR)
    ax.plot(hyperparameter.at, hyperparameter.posterior, color=INK, linewidth=1.2)
    little = hyperparameter.contraction < CONTRACTION_LEAST
    ax.set_title(
        f"{plain(hyperparameter.name, 32)}\ncontraction {decimals(hyperparameter.contraction)}",
        fontsize=7,
        fontweight="bold" if little else "normal",
    )
    if hyperparameter.log:
        layout.log_axis(ax, hyperparameter.at[0], hyperparameter.at[-1], crowd=1.6)
    else:
        ax.set_xlim(hyperparameter.at[0], hyperparameter.at[-1])
    ax.set_xlabel(
        f"({unit_name(hyperparameter.unit)}{', log scale' if hyperparameter.log else ''})", fontsize=7, labelpad=1
    )
    ax.set(ylim=(0, 1.08), yticks=[])
    ax.tick_params(labelsize=6.5, length=2, pad=1.5)
