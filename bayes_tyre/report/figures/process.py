"""A figure of how a recording became a record: raw channels, the step found, the resulting path."""

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bayes_tyre.record import Samples
from bayes_tyre.report.figures.page import layout
from bayes_tyre.report.figures.page.colours import INK, Setting
from bayes_tyre.report.figures.page.labels import plain
from bayes_tyre.report.figures.page.layout import STYLE
from bayes_tyre.signals.processed import Processed

# The mark is neither single's colour nor dual's.
_RAW, _USED, _MARK = "#9a9a9a", INK, "#009E73"
# Long recordings are drawn as the extremes of so many stretches: nothing is lost to the eye.
_STRETCHES = 1500
_AROUND_S = 0.25


@matplotlib.style.context(STYLE)
def record_figure(processed: Processed, origin: str) -> Figure:
    """Return the figure of one record: three raw channels, all of it and about the step, and force over displacement.

    Parameters
    ----------
    processed:
        A record with the recording that it was made from.
    origin:
        `measured` or `simulated`; it stands in the corner.
    """
    recording, step = processed.recording, processed.recording.step
    figure = layout.page(8.5, 6.0)
    panels = np.atleast_1d(np.asarray(figure.subfigures(1, 2, width_ratios=(1.25, 1.0)), dtype=object))
    axes = panels[0].subplots(3, 2, sharex="col", width_ratios=(1.0, 1.3))
    labels = ("acceleration (m/s²)", "laser (mm)", "cylinder load (kN)")
    time_s = recording.raw.time_s
    onset_s = float(time_s[step.onset])
    near = np.abs(time_s - onset_s) <= _AROUND_S
    for row, label, raw, used in zip(axes, labels, recording.raw[1:], recording.signals[1:], strict=True):
        row[0].set_ylabel(label)
        for ax, part in ((row[0], slice(None)), (row[1], near)):
            _draw_long(ax, time_s[part], raw[part], _RAW)
            if used is not raw:
                _draw_long(ax, time_s[part], used[part], _USED)
        _mark(row[0], row[1], processed)
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    ax = panels[1].subplots()
    ax.plot(processed.displacement_mm, processed.force_kN, ".", markersize=2, color=_USED)
    ax.plot(processed.displacement_mm[:1], processed.force_kN[:1], "o", markersize=5, color=_MARK)
    ax.set_xlabel("displacement, flat ground (mm)")
    ax.set_ylabel("force, flat ground (kN)")
    figure.suptitle(plain(f"{processed.factors.record}, {processed.extras.get('method', '')}"), fontsize=9)
    return layout.finish(figure, Setting(origin), _note(processed))


def _draw_long(ax: Axes, time_s: Samples, values: Samples, colour: str) -> None:
    length = len(values) // _STRETCHES
    if length < 4:
        ax.plot(time_s, values, color=colour, linewidth=0.5)
        return
    cut = len(values) // length * length
    stretches = values[:cut].reshape(-1, length)
    ax.fill_between(
        time_s[:cut:length], stretches.min(axis=1), stretches.max(axis=1), color=colour, linewidth=0.3, edgecolor=colour
    )


def _mark(whole: Axes, near: Axes, processed: Processed) -> None:
    step, time_s = processed.recording.step, processed.recording.raw.time_s
    whole.axvspan(float(time_s[0]), float(time_s[step.pre_step]), color=_MARK, alpha=0.10, linewidth=0)
    near.axvspan(float(processed.time_s[0]), float(processed.time_s[-1]), color=_MARK, alpha=0.15, linewidth=0)
    for at in (time_s[0] + step.ramp.start_s, time_s[0] + step.ramp.end_s):
        near.axvline(float(at), color=_MARK, linewidth=0.8, linestyle=":")
    for ax in (whole, near):
        ax.axvline(float(time_s[step.onset]), color=_MARK, linewidth=0.8)


def _note(processed: Processed) -> str:
    step = processed.recording.step
    mass = f"; mass {processed.extras['mass_kg']:.0f} kg" if "mass_kg" in processed.extras else ""
    return (
        f"load changes by {step.change_kN:.2f} kN, {step.load_clarity:.0f} times its noise; acceleration spikes by "
        f"{step.spike_m_per_s2:.2g} m/s², {step.acceleration_clarity:.0f} times{mass}. Shaded: rest, and the record; "
        "dotted: the load's ramp"
    )
