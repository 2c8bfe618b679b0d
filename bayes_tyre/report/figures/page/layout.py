"""The page of a figure: its size, the notes at its foot, legend and axes, and how it is written."""

import io
import math
import textwrap
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from bayes_tyre.formats.files import write_bytes
from bayes_tyre.record import RECORD_UNITS
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.page.labels import origin_note, plain
from bayes_tyre.report.wording import AXIS_NAMES

STYLE = str(Path(__file__).with_name("style.mplstyle"))
#: Width of a figure, and the tallest, inches.
WIDTH, TALLEST = 8.0, 30.0
#: Height of a line of a note, inches; letters of a note that fit into an inch.
_NOTE_LINE, _LETTERS = 0.14, 19
#: Ticks in a decade of a logarithmic axis, from coarse to fine, and the fewest that an axis should have.
_STEPS = (
    (1.0,),
    (1.0, 3.0),
    (1.0, 2.0, 5.0),
    (1.0, 1.5, 2.0, 3.0, 5.0, 7.0),
    (1.0, 1.2, 1.4, 1.6, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0),
)
_LEAST_TICKS = 3
#: Decimals of a panel's place as a share of the page. The rounding error of the layout's solver depends on where in
#: memory its variables lie, and would now and then move a pixel: a figure drawn again would not have the same bytes.
_PLACES = 9
#: Who holds it draws.
_PEN = threading.Lock()


def wide(panels: int) -> float:
    """Return the width of so many panels side by side, inches: the page's, and more where they would be narrow."""
    return max(WIDTH, 2.9 * panels)


def page(width: float, height: float) -> Figure:
    """Return an empty figure, inches, that belongs to no window and no global state."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def panel_grid(
    count: int, most_across: int, row: float, spare: float, **subplots: Any
) -> tuple[Figure, list[Axes], list[Axes]]:
    """Return a page of `count` panels, at most so many side by side; its panels, and those of the first column.

    A row of panels is `row` inches high, and the page has `spare` inches besides; `subplots` goes to matplotlib.
    """
    across = max(1, min(most_across, count))
    down = max(1, math.ceil(count / across))
    figure = page(WIDTH, spare + row * down)
    axes = list(figure.subplots(down, across, squeeze=False, **subplots).ravel())
    for ax in axes[count:]:
        ax.set_visible(False)
    return figure, axes[:count], axes[:count:across]


def rank_axes(axes: Sequence[Axes], first_column: Sequence[Axes], across: int) -> None:
    """Label panels of ranks less the expected ones, which share their axes, on the left and below the lowest."""
    for ax in first_column:
        ax.set_ylabel("excess share\n(no unit)", fontsize=7)
    for ax in axes[-across:]:
        ax.set_xlabel("rank (share, no unit)", fontsize=7)
        ax.tick_params(labelbottom=True)


def finish(figure: Figure, setting: Setting, note: str) -> Figure:
    """Add the notes below the axes, say so if the verdict is fail, and settle the layout."""
    width, height = figure.get_size_inches()
    left = 0.08 / width
    lines = textwrap.wrap(note, int(_LETTERS * width))
    foot = (0.28 + _NOTE_LINE * len(lines)) / height
    layout = ConstrainedLayoutEngine(rect=(0, foot, 1, 1 - foot))
    figure.set_layout_engine(layout)
    for i, line in enumerate(reversed(lines)):
        figure.text(left, (0.26 + _NOTE_LINE * i) / height, line, fontsize=7, ha="left", va="center")
    source = plain(origin_note(setting.origin), 80)
    figure.text(1 - left, 0.1 / height, source, fontsize=7.5, ha="right", va="center")
    if setting.verdict == "fail":
        warning = "verdict: fail, not to be trusted"
        figure.text(left, 0.1 / height, warning, fontsize=7.5, ha="left", va="center", weight="bold")
    if figure.axes:
        layout.execute(figure)
    figure.set_layout_engine("none")  # settled: to lay it out again for writing would take as long once more
    for ax in figure.axes:
        ax.set_position(Bbox.from_bounds(*np.round(ax.get_position(original=True).bounds, _PLACES)))
    return figure


def legend(figure: Figure, entries: Sequence[tuple[Any, str]]) -> None:
    """Put a legend of (handle, plain text) above the axes; texts may begin with an underscore."""
    if not entries:
        return
    lengths = [len(label) + 8 for _, label in entries]
    columns = len(entries) if sum(lengths) < 110 else max(1, 110 // max(lengths))
    handles = [handle for handle, _ in entries]
    numbers = [str(i) for i in range(len(entries))]
    box = figure.legend(handles, numbers, loc="outside upper center", ncols=columns)
    for text, (_, label) in zip(box.get_texts(), entries, strict=True):
        text.set_text(label)


def left_out(shown: int, total: int, what: str = "") -> str:
    """Return how many of all there are a figure shows, to follow its note; nothing where it shows all."""
    return "" if shown == total else f" The first {shown} of {total} {what}".rstrip() + "."


def name_axis(ax: Axes, parameter: str, table: pd.DataFrame, log: bool) -> str:
    """Write the parameter and its unit on the x axis; return the unit."""
    unit = next((plain(stated) for stated in table["unit"] if stated), RECORD_UNITS[parameter])
    ax.set_xlabel(f"{AXIS_NAMES[parameter]} ({unit}{', log scale' if log else ''})")
    return unit


def log_axis(ax: Axes, low: float, high: float, crowd: float = 1.0) -> None:
    """Make the x axis logarithmic from `low` to `high` (> 0), with plain numbers on its ticks, fewer for more crowd."""
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    plain_ticks(ax.xaxis, log_steps(low, high, crowd))


def log_steps(low: float, high: float, crowd: float = 1.0) -> tuple[float, ...]:
    """Return the steps of a decade that give a logarithmic axis a few ticks, fewer for more crowd."""
    decades = crowd * math.log10(high / low)
    coarse = 2 if decades < 2.5 else 1 if decades < 4 else 0
    enough = (steps for steps in _STEPS[coarse:] if _ticks(low, high, steps) >= _LEAST_TICKS)
    return next(enough, _STEPS[-1])


def _ticks(low: float, high: float, steps: Sequence[float]) -> int:
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return sum(bool(low <= step * 10.0**decade <= high) for decade in decades for step in steps)


def plain_ticks(axis: Axis, steps: Sequence[float]) -> None:
    """Put plain numbers on a logarithmic axis, at these steps of each decade."""
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG at 150 dots an inch, whole or not at all, the same bytes each time; return the path."""
    return write_bytes(png_file(lambda: figure), path)


def png_file(draw: Callable[[], Figure]) -> bytes:
    """Return the figure that `draw` returns as the bytes that `save` writes."""
    figure, written = draw(), io.BytesIO()
    with matplotlib.style.context(STYLE):
        figure.savefig(written, format="png", dpi=150, metadata={"Software": None})
    return written.getvalue()


def png(draw: Callable[[], Figure]) -> bytes:
    """Return the figure that `draw` returns as PNG; one thread at a time draws: matplotlib's style is the process's."""
    written = io.BytesIO()
    with _PEN:
        draw().savefig(written, format="png")
    return written.getvalue()
