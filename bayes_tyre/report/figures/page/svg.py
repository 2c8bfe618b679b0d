"""A figure as SVG for a page: the same bytes each time, small, its dense layers as images."""

import io
import re

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.figure import Figure

from bayes_tyre.report.figures.page.layout import STYLE

#: Points of a line, and markers, in one layer above which it is drawn as an image inside the SVG: each marker costs as
#: much as many points. The image's dots an inch.
DENSE, DENSE_MARKERS, DOTS = 1500, 100, 150
# What a page can do without: comments, indents, and of a path's shape, in points or units of its font, all below a
# hundredth, which no printer shows.
_SPARE = re.compile(r"<!--.*?-->|(?<=\n)\s+", re.DOTALL)
# Names that matplotlib makes of what it clips, marks or embeds; not all of them are the same in another run.
_NAME = re.compile(r'(?<=id=")[a-z]+[0-9a-f]{10}(?=")|(?<=#)[a-z]+[0-9a-f]{10}(?=[")])')
_SHAPE, _LONG_NUMBER = re.compile(r'(?<= d=")[^"]+'), re.compile(r"-?\d+\.\d{3,}")


def notes(figure: Figure) -> str:
    """Return the notes at a figure's foot as one text, from the upper line to the lower."""
    lines = sorted(figure.texts, key=lambda text: (-text.get_position()[1], text.get_position()[0]))
    return " ".join(text.get_text().replace(r"\$", "$") for text in lines)


@matplotlib.style.context(STYLE)
def svg(figure: Figure, name: str) -> bytes:
    """Return a figure as SVG, the same bytes each time: text as paths, dense layers as images."""
    _rasterise_dense(figure)
    written = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(written, format="svg", dpi=DOTS, metadata={"Date": None, "Creator": None})
    text = _SPARE.sub("", written.getvalue().decode("utf-8"))
    places: dict[str, str] = {}
    text = _NAME.sub(lambda name: places.setdefault(name[0], f"n{len(places)}"), text)
    return _SHAPE.sub(_shorter, text).encode("utf-8")


def _shorter(shape: re.Match[str]) -> str:
    return _LONG_NUMBER.sub(lambda number: f"{float(number[0]):.2f}", shape[0])


def _rasterise_dense(figure: Figure) -> None:
    for ax in figure.get_axes():
        for line in ax.lines:
            marked = line.get_marker() not in ("", "None", None)
            if len(np.asarray(line.get_xydata())) > (DENSE_MARKERS if marked else DENSE):
                line.set_rasterized(True)
        for collection in ax.collections:
            vertices = sum(len(np.asarray(path.vertices)) for path in collection.get_paths())
            if max(len(np.asarray(collection.get_offsets())), vertices) > DENSE:
                collection.set_rasterized(True)
