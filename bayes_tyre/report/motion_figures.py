"""A picture of a record's motion: readings of the three channels, what the fitted motion expects, what is left over."""

import io

import matplotlib.style
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from bayes_tyre.inference.motion_window import Window
from bayes_tyre.report import page
from bayes_tyre.report.colours import INK, Setting
from bayes_tyre.report.labels import plain
from bayes_tyre.report.page import STYLE
from bayes_tyre.report.process_figures import PEN

_FITTED = "#0072B2"
_CHANNELS = ("acceleration (m/s²)", "laser (mm)", "cylinder load (kN)")


@matplotlib.style.context(STYLE)
def motion_figure(
    record: str, window: Window, expected: Float[np.ndarray, "3 blocks"], status: str, origin: str
) -> Figure:
    """Return the picture of one record: readings and motion at the left, residuals in standard deviations at the right.

    Parameters
    ----------
    record:
        Its name.
    window:
        Readings that were fitted, and how noisy they are.
    expected:
        What the fitted motion would have the sensors read, m/s^2, mm, kN.
    status:
        What the check said of the estimate.
    origin:
        `measured` or `simulated`; it stands in the corner.
    """
    readings, weight = np.asarray(window.readings), np.asarray(window.weight)
    time_s = (np.arange(readings.shape[1]) + 0.5) * float(window.block_s)
    figure = page.page(8.5, 6.0)
    axes = figure.subplots(3, 2, sharex=True, width_ratios=(1.4, 1.0))
    for row, label, read, fitted, weighed in zip(axes, _CHANNELS, readings, expected, weight, strict=True):
        there = weighed > 0
        row[0].plot(time_s[there], read[there], ".", color="#9a9a9a", markersize=2)
        row[0].plot(time_s[there], fitted[there], color=_FITTED, linewidth=0.8)
        row[0].set_ylabel(label)
        row[1].axhline(0.0, color=INK, linewidth=0.6)
        row[1].plot(time_s[there], ((read - fitted) * weighed)[there], ".", color=INK, markersize=1.5)
        row[1].set_ylabel("left over (sd of a reading)")
    for ax in axes[-1]:
        ax.set_xlabel("time from the window's start (s)")
    figure.suptitle(plain(f"{record}, motion", 60), fontsize=9)
    note = f"Grey: readings, means over {1e3 * float(window.block_s):g} ms. Line: fitted motion. Estimate: {status}."
    return page.finish(figure, Setting(origin), plain(note, 400))


def motion_png(record: str, window: Window, expected: Float[np.ndarray, "3 blocks"], status: str, origin: str) -> bytes:
    """Return the picture of `motion_figure` as PNG; one thread at a time draws."""
    png = io.BytesIO()
    with PEN:
        motion_figure(record, window, expected, status, origin).savefig(png, format="png")
    return png.getvalue()
