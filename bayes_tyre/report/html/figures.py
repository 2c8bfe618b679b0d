"""The figures of the document: SVG inside the page, each with a heading, how to read it, and a text alternative."""

import base64
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.figure import Figure

from bayes_tyre.report.figures import catalogue as figures
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.report.figures.layout import STYLE
from bayes_tyre.report.html.formatting import label

#: What each figure is called, and how somebody reads it who has never seen a posterior.
HEADINGS = {
    "posteriors_by_direction": (
        "How well the parameters are known",
        "The higher the curve, the more believable the value below it; two curves that hardly overlap are two values "
        "that differ.",
    ),
    "forest_of_cases": (
        "Parameters of each test case",
        "A marker is the middle of what is believable, its line the interval.",
    ),
    "contrasts": (
        "Ratios between configurations, and between loading and unloading",
        "Where a line crosses the dashed 1, no difference is shown.",
    ),
    "prior_and_posterior_of_scales": (
        "What was assumed before the data, and what is believed after them",
        "Where both curves are alike, the data said nothing.",
    ),
    "rank_plot": (
        "Do the chains agree?",
        "Lines inside the grey band: the sampler's chains say the same.",
    ),
    "pair_plot": (
        "Which quantities trade against each other",
        "A slanted cloud: one can grow if the other shrinks, and the data hardly tell.",
    ),
    "prior_predictive_curves": (
        "What the assumptions alone would foresee",
        "The data should lie among the curves, which should be no narrower than what a tyre can do.",
    ),
    "records_with_bands": (
        "A few records against the fit",
        "Points should lie in the band, and about as often above its middle as below.",
    ),
    "residuals_against_displacement": (
        "What the fit leaves over",
        "A wave instead of even noise says that the law misses something.",
    ),
    "energy_per_cycle": (
        "How much energy a cycle loses",
        "The higher the curve, the more believable the energy below it, at the stated amplitude at the wheel centre.",
    ),
    "loops_by_direction": (
        "The loop that loses it",
        "The wider the loop, the more a cycle loses; the band is what is believable.",
    ),
    "motion_worst": (
        "The motion of the record that the fit follows worst",
        "Left: the line should go through the points. Right: what is left over should be even noise, most of it in the "
        "grey band; a wave says that the law misses something.",
    ),
    "motion_second_worst": ("The motion of the record that the fit follows next worst", "Read as the figure above."),
    "motion_typical": ("The motion of a typical record", "Read as the figures of motions above it."),
    "outlier_probabilities": (
        "Which repeats are odd",
        "A record near 1 does not agree with the other repeats of its test.",
    ),
}
#: Points of a line, and markers, in one layer above which it is drawn as an image inside the SVG: each marker costs as
#: much as many points. The image's dots an inch.
DENSE, DENSE_MARKERS, DOTS = 1500, 100, 150
# What a page can do without: comments, indents, and of a path's shape, in points or units of its font, all below a
# hundredth, which no printer shows.
_SPARE = re.compile(r"<!--.*?-->|(?<=\n)\s+", re.DOTALL)
# Names that matplotlib makes of what it clips, marks or embeds; not all of them are the same in another run.
_NAME = re.compile(r'(?<=id=")[a-z]+[0-9a-f]{10}(?=")|(?<=#)[a-z]+[0-9a-f]{10}(?=[")])')
_SHAPE, _LONG_NUMBER = re.compile(r'(?<= d=")[^"]+'), re.compile(r"-?\d+\.\d{3,}")


class Picture(NamedTuple):
    """A figure in the page: its name, what stands above and below it, its text alternative, and itself as data."""

    name: str
    heading: str
    reading: str
    alternative: str
    uri: str


def pictures(result: Result, folder: Path) -> Iterator[Picture]:
    """Yield every figure of a result: drawn anew as SVG, and what only the fit could draw as it left it in `folder`.

    Figures of records need the records; where the input of the fit is gone, those that it drew are shown.
    """
    known = set()
    for name, figure in figures.draw(result):
        if name in known:
            continue
        known.add(name)
        yield picture(name, figure)
    kept = set(figures.OF_RECORDS) if result.table is None else set()
    yield from kept_pictures(folder, set(HEADINGS) - kept | known)


def kept_pictures(folder: Path, but: set[str]) -> Iterator[Picture]:
    """Yield the figures that a command left as PNG in `folder`, but those of the names given."""
    known = list(HEADINGS)
    by_name = sorted(folder.glob("*.png"))
    for path in sorted(by_name, key=lambda path: known.index(path.stem) if path.stem in known else len(known)):
        if path.stem not in but:
            heading, reading = _words(path.stem)
            yield Picture(path.stem, heading, reading, heading, _uri("image/png", path.read_bytes()))


def picture(name: str, figure: Figure) -> Picture:
    """Return a figure as the page holds it; its text alternative is its heading and the notes at its foot."""
    heading, reading = _words(name)
    notes = sorted(figure.texts, key=lambda text: (-text.get_position()[1], text.get_position()[0]))
    said = " ".join(text.get_text().replace(r"\$", "$") for text in notes)
    return Picture(name, heading, reading, f"{heading}. {said}", _uri("image/svg+xml", svg(figure, name)))


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


def _words(name: str) -> tuple[str, str]:
    return HEADINGS.get(name, (label(name.replace("_", " ").capitalize()), ""))


def _uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
