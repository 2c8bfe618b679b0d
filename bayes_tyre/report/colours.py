"""What all figures share: the look of a configuration, labels as plain text, and the page."""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.typing import LineStyleType

from bayes_tyre.record import ORIGIN_UNKNOWN

STYLE = str(Path(__file__).with_name("style.mplstyle"))
INK = "#222222"
#: Height kept free below the axes for the notes, inches.
FOOT = 0.42
#: What each parameter is called on an axis, its unit where the table gives none, and its column when printed.
PARAMETERS = {
    "k": ("stiffness k", "kN/mm", "k_kN_per_mm"),
    "beta": ("characteristic deflection beta", "mm", "beta_mm"),
}
# Blue, vermillion, green, purple, sky and orange of Okabe and Ito (2008): apart for all kinds of colour vision.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
_LINES: tuple[LineStyleType, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
_HATCHES = ("", "////", "....", "xxxx", "----")
_MARKERS = ("o", "s", "^", "v", "P", "X", "p")
_ORIGINS = {
    "published": "published tables",
    "reconstructed": "reconstructed, not measured",
    "simulated": "simulated, not measured",
}


class Look(NamedTuple):
    """How one configuration is drawn wherever it appears; colour, marker and line each tell it from the next."""

    colour: str
    marker: str
    line: LineStyleType
    hatch: str

    @property
    def shade(self) -> dict[str, Any]:
        """How an area of it is filled."""
        tint, edge = (self.colour, 0.15), (self.colour, 0.6)
        return {"facecolor": tint, "edgecolor": edge, "hatch": self.hatch, "linewidth": 0}

    @property
    def density_handle(self) -> tuple[Patch, Line2D]:
        """What stands for its densities in a legend."""
        return Patch(**self.shade), Line2D([], [], color=self.colour, linestyle=self.line, marker=self.marker)

    @property
    def interval_handle(self) -> Line2D:
        """What stands for its intervals in a legend."""
        return Line2D([], [], color=self.colour, linewidth=1.6, marker=self.marker)


def looks(configurations: Iterable[str]) -> dict[str, Look]:
    """Return the look of each configuration, always the same for the same set of labels; 210 of them differ."""
    return {
        label: Look(
            _COLOURS[i % len(_COLOURS)],
            _MARKERS[i % len(_MARKERS)],
            _LINES[i % len(_LINES)],
            _HATCHES[i % len(_HATCHES)],
        )
        for i, label in enumerate(sorted(set(configurations)))
    }


@lru_cache(maxsize=1)
def _glyphs() -> frozenset[int]:
    return frozenset(font_manager.get_font(font_manager.findfont("DejaVu Sans")).get_charmap())


def plain(label: object, most: int = 40) -> str:
    """Return a label as text that is drawn as it stands: no mathtext, one line, no missing glyph, not too long."""
    text = " ".join(str(label).split())
    if len(text) > most:
        text = f"{text[: most - 10]}…{text[-9:]}"
    shown = "".join(c if ord(c) in _glyphs() else c.encode("unicode_escape").decode() for c in text)
    return shown.replace("$", r"\$")


def configuration_label(name: str) -> str:
    """Return a configuration as a title or legend shows it."""
    return plain(name or "configuration not stated")


def interval_name(interval: float) -> str:
    """Return an interval's name, such as ``95 % interval``."""
    return f"{100 * interval:g} % interval"


def origin_note(origin: str) -> str:
    """Return the corner text for an origin as `bayes_tyre.record.origin_of` gives it, several joined by a plus."""
    parts = [part.strip() for part in origin.split(" + ") if part.strip()] or [ORIGIN_UNKNOWN]
    return "data: " + "; ".join(_ORIGINS.get(part, part) for part in parts)


def texts(table: pd.DataFrame, column: str) -> pd.Series:
    """Return a column as text, empty where the table has no such column or cell."""
    if column not in table:
        return pd.Series("", index=table.index, dtype=object)
    return table[column].astype(object).where(table[column].notna(), "").astype(str).str.strip()


def numbers(table: pd.DataFrame, column: str) -> pd.Series:
    """Return a column as float, NaN where the table has no such column or the cell no finite number."""
    if column not in table:
        return pd.Series(math.nan, index=table.index)
    found = pd.to_numeric(table[column], errors="coerce").astype(float)
    return found.where(np.isfinite(found))


def page(width: float, height: float) -> Figure:
    """Return an empty figure, inches, that belongs to no window and no global state."""
    foot = FOOT / height
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(rect=(0, foot, 1, 1 - foot)))
    FigureCanvasAgg(figure)
    return figure


def finish(figure: Figure, origin: str, note: str, tables: Sequence[pd.DataFrame]) -> Figure:
    """Add the notes below the axes, say so if the tables' `verdict` is fail, and settle the layout."""
    width, height = figure.get_size_inches()
    left = 0.08 / width
    figure.text(left, 0.26 / height, note, fontsize=7, ha="left", va="center")
    figure.text(1 - left, 0.1 / height, plain(origin_note(origin), 80), fontsize=7.5, ha="right", va="center")
    if any(texts(table, "verdict").eq("fail").any() for table in tables):
        warning = "verdict: fail, not to be trusted"
        figure.text(left, 0.1 / height, warning, fontsize=7.5, ha="left", va="center", weight="bold")
    figure.draw_without_rendering()
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


def name_axis(ax: Axes, parameter: str, table: pd.DataFrame, log: bool) -> str:
    """Write the parameter and its unit on the x axis; return the unit."""
    name, unit, _ = PARAMETERS[parameter]
    unit = next((plain(stated) for stated in table["unit"] if stated), unit)
    ax.set_xlabel(f"{name} ({unit}{', log scale' if log else ''})")
    return unit


def log_axis(ax: Axes, low: float, high: float) -> None:
    """Make the x axis logarithmic from `low` to `high` (> 0), with plain numbers on its ticks."""
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    decades = math.log10(high / low)
    steps = (1.0, 2.0, 5.0) if decades < 2.5 else (1.0, 3.0) if decades < 4 else (1.0,)
    ax.xaxis.set_major_locator(LogLocator(subs=steps))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
