"""Slow load-deflection tests drawn: readings with both lines, and the loop that is left when the middle line is off."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib.style
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, PALE, Setting
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import STYLE, WIDTH

#: The most cases on a figure.
MOST_CASES = 8
_READINGS: dict[str, dict[str, Any]] = {
    "loading": {"marker": "o", "markersize": 3.2, "linestyle": "none", "markeredgewidth": 0.7},
    "unloading": {"marker": "o", "markersize": 3.2, "linestyle": "none", "markeredgewidth": 0.7, "fillstyle": "none"},
}
_LINES: dict[str, dict[str, Any]] = {"loading": {"linestyle": "-"}, "unloading": {"linestyle": "--"}}
_LAW: dict[str, Any] = {"color": INK, "linewidth": 0.9}
_SETTLED: dict[str, Any] = {"color": INK, "linewidth": 0.8, "linestyle": ":"}
_ENVELOPE: dict[str, Any] = {"color": PALE, "linewidth": 1.2, "linestyle": "-."}
_BETWEEN: dict[str, Any] = {"facecolor": (PALE, 0.25), "edgecolor": "none"}


class LoopPanel(NamedTuple):
    """What a case is drawn from.

    Attributes
    ----------
    label, configuration:
        What it is called, and which look it has.
    readings:
        Of its tests: `direction`, `on_loading_line`, `on_unloading_line`, `flat_ground_mm`, `flat_ground_kN`.
    fit:
        A row as `bayes_tyre.inference.load_deflection.table.fit_tests` gives it: of the average where there is one.
    loop:
        The law's closed loop, mm and kN, shape (n, 2); None where there is no law.
    """

    label: str
    configuration: str
    readings: pd.DataFrame
    fit: Mapping[str, Any]
    loop: Float[np.ndarray, "n 2"] | None


@matplotlib.style.context(STYLE)
def load_deflection_loops(panels: Sequence[LoopPanel], setting: Setting, place: str = "as on flat ground") -> Figure:
    """Return each case's readings with its loading and unloading lines, and beside it the loop about its middle line.

    Parameters
    ----------
    panels:
        A case each; the first eight are drawn.
    setting:
        What all figures of the result share.
    place:
        Where forces (kN) and displacements (mm) are; the note says it.
    """
    shown = panels[:MOST_CASES]
    figure = layout.page(WIDTH, 1.1 + 2.3 * max(1, len(shown)))
    axes = figure.subplots(max(1, len(shown)), 2, squeeze=False, width_ratios=[1.0, 1.25])
    looks = setting.looks(panel.configuration for panel in shown)
    for row, panel in zip(axes, shown, strict=False):
        colour = looks[panel.configuration].colour
        _both_lines(row[0], panel, colour)
        _loop(row[1], panel, colour)
    for ax in axes[-1]:
        ax.set_xlabel("displacement (mm)")
    layout.legend(figure, _entries(shown))
    note = (
        f"Displacement and force {place}; energies at the wheel centre. Readings of all tests of a case; lines and law "
        "are fitted to their average where they were averaged. Right: force less the law's middle line k d + C; "
        "± behind a number: one standard error."
    )
    return layout.finish(figure, setting, note + layout.left_out(len(shown), len(panels), "cases"))


def _entries(panels: Sequence[LoopPanel]) -> list[tuple[Any, str]]:
    entries: list[tuple[Any, str]] = []
    for name in ("loading", "unloading"):
        entries.append((Line2D([], [], color=INK, **_READINGS[name]), f"{name} readings"))
        entries.append((Line2D([], [], color=INK, **_LINES[name]), f"{name} line"))
    if any(panel.loop is not None for panel in panels):
        entries += [(Line2D([], [], **_LAW), "law"), (Line2D([], [], **_SETTLED), "± (x - k beta)")]
    if any(np.isfinite(panel.fit["x_kN"]) for panel in panels):
        entries.append((Line2D([], [], **_ENVELOPE), "envelopes, ± x"))
    if any(_between(panel.fit) for panel in panels):
        entries.append((Patch(**_BETWEEN), "x, 95 % interval"))
    return entries


def _between(fit: Mapping[str, Any]) -> bool:
    return not np.isfinite(fit["x_kN"]) and bool(np.isfinite(fit["x_high_kN"]))


def _both_lines(ax: Axes, panel: LoopPanel, colour: str) -> None:
    fit = panel.fit
    stiffnesses = []
    for name in ("loading", "unloading"):
        d, F = _of(panel.readings, name)
        ax.plot(d, F, color=colour, **_READINGS[name])
        k, C = fit[f"k_{name}_kN_per_mm"], fit[f"C_{name}_kN"]
        if len(d) and np.isfinite(k):
            line = panel.readings.loc[panel.readings[f"on_{name}_line"], "flat_ground_mm"]
            ends = np.array([line.min(), line.max()])
            ax.plot(ends, C + k * ends, color=colour, linewidth=1.0, **_LINES[name])
            stiffnesses.append(f"{name} {k:.3f}")
    ax.set_ylabel("force (kN)")
    ax.set_title(
        "\n".join([plain(panel.label), f"k {', '.join(stiffnesses)} kN/mm" if stiffnesses else "no line"]), fontsize=8
    )


def _loop(ax: Axes, panel: LoopPanel, colour: str) -> None:
    fit = panel.fit
    ax.set_ylabel("force less k d + C (kN)")
    if panel.loop is None:
        ax.set_title("no law fitted", fontsize=8)
        ax.set_axis_off()
        ax.text(0.5, 0.5, "see status", ha="center", transform=ax.transAxes)
        return
    k, C, settled = (float(fit[column]) for column in ("k_kN_per_mm", "C_kN", "x_less_k_beta_kN"))
    seen = [np.array([-settled, settled])]
    if np.isfinite(fit["x_kN"]):
        for side in (-fit["x_kN"], fit["x_kN"]):
            ax.axhline(side, **_ENVELOPE)
            seen.append(np.array([side]))
    elif _between(fit):
        for sign in (-1, 1):
            ax.axhspan(sign * fit["x_low_kN"], sign * fit["x_high_kN"], **_BETWEEN)
    for side in (-settled, settled):
        ax.axhline(side, **_SETTLED)
    mm, kN = panel.loop.T
    ax.plot(mm, kN - k * mm - C, **_LAW)
    for name in ("loading", "unloading"):
        d, F = _of(panel.readings, name)
        ax.plot(d, F - k * d - C, color=colour, **_READINGS[name])
        seen.append(F - k * d - C)
    values = np.concatenate(seen)
    room = 0.15 * np.ptp(values)
    ax.set_ylim(values.min() - room, values.max() + room)
    error = f" ± {fit['x_less_k_beta_kN_se']:.2g}" if np.isfinite(fit["x_less_k_beta_kN_se"]) else ""
    energy = f"{fit['energy_per_cycle_J']:.3g} J a cycle over {fit['stroke_mm']:.3g} mm"
    ax.set_title(f"x - k beta {settled:.2g}{error} kN\n{energy} at the wheel centre", fontsize=8)


def _of(readings: pd.DataFrame, direction: str) -> tuple[np.ndarray, np.ndarray]:
    mine = readings[readings["direction"] == direction]
    return mine["flat_ground_mm"].to_numpy(float), mine["flat_ground_kN"].to_numpy(float)
