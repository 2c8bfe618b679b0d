"""The figures of the document: SVG inside the page, each with a heading, how to read it, and a text alternative."""

import base64
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

from bayes_tyre.inference.diagnostics.attempts import Attempt, directly
from bayes_tyre.report.answer.formatting import label
from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.figures.catalogue import Result
from bayes_tyre.report.figures.page.svg import Figure, notes, svg

#: What each figure is called, and how somebody reads it who has never seen a posterior.
HEADINGS = {
    "posteriors_by_direction": (
        "How well the parameters are known",
        "The higher the curve, the more probable the values below it. Where two curves hardly overlap, the values "
        "differ.",
    ),
    "forest_of_cases": ("Parameters of each test case", "A marker is the median, its line the interval."),
    "contrasts": (
        "Ratios between configurations, and between loading and unloading",
        "Where a line crosses the dashed 1, the data do not show a difference.",
    ),
    "prior_and_posterior_of_scales": (
        "Priors and posteriors of the hyperparameters",
        "Where both curves are alike, the data do not determine the quantity.",
    ),
    "rank_plot": (
        "Do the chains agree?",
        "Lines inside the grey band: the sampler's chains agree. Some may leave it by chance: the note counts them.",
    ),
    "pair_plot": (
        "Which quantities are correlated",
        "A slanted cloud: the data determine a combination of the two better than each of them.",
    ),
    "prior_predictive_curves": (
        "Records that the priors allow",
        "The data should lie among the curves, and the curves should cover what a tyre can do.",
    ),
    "records_with_bands": (
        "A few records against the fit",
        "Points should lie in the band, and about as often above its middle as below.",
    ),
    "residuals_against_displacement": (
        "Residuals",
        "A wave instead of even noise: the force law does not describe the record.",
    ),
    "energy_per_cycle": (
        "How much energy a cycle loses",
        "The higher the curve, the more probable the energies below it, at the stated amplitude at the wheel centre.",
    ),
    "loops_by_direction": (
        "The loop of a cycle",
        "The wider the loop, the more energy a cycle loses; the band is the interval.",
    ),
    "motion_worst": (
        "The motion of the record that the fit follows worst",
        "Left: the line should go through the points. Right: the residuals should be even noise, most of it in the "
        "grey band; a wave means that the force law does not describe the record.",
    ),
    "motion_second_worst": ("The motion of the record that the fit follows next worst", "Read as the figure above."),
    "motion_typical": ("The motion of a typical record", "Read as the figures of motions above it."),
    "outlier_probabilities": (
        "Which repeats are discordant",
        "A record near 1 does not agree with the other repeats of its test.",
    ),
}
#: The same of the figures beside fits without a posterior.
_OF_SEPARATE_FITS = {
    "load_deflection_loops": (
        "Slow tests",
        "Left: the readings and both lines. Right: the same less the middle line, so that the loop shows.",
    ),
    "loops": (
        "Driven curves with the law of each branch",
        "Points should lie on the line of their branch; the farther the two branches of a cycle lie apart, the more "
        "energy it loses.",
    ),
}


class EmbeddedFigure(NamedTuple):
    """A figure in the page: its name, what stands above and below it, its text alternative, and itself as data."""

    name: str
    heading: str
    reading: str
    alternative: str
    uri: str


def embedded_figures(result: Result, folder: Path, attempt: Attempt = directly) -> Iterator[EmbeddedFigure]:
    """Yield every figure of a result: drawn anew as SVG, and what only the fit could draw as it left it in `folder`.

    Figures of records need the records; where the input of the fit is gone, those that it drew are shown. A figure that
    `attempt` cannot draw is left out.
    """
    drawn = set()
    for name, figure in catalogue.draw(result, attempt):
        if name in drawn:
            continue
        embedded = attempt(f"{name}.png", partial(embedded_figure, name, figure), None)
        if embedded is not None:
            drawn.add(name)
            yield embedded
    stored = set(catalogue.OF_RECORDS) if result.table is None else set()
    yield from stored_figures(folder, set(HEADINGS) - stored | drawn)


def stored_figures(folder: Path, but: set[str]) -> Iterator[EmbeddedFigure]:
    """Yield the figures that a command left as PNG in `folder`, but those of the names given."""
    order = list(HEADINGS)
    by_name = sorted(folder.glob("*.png"))
    for path in sorted(by_name, key=lambda path: order.index(path.stem) if path.stem in order else len(order)):
        if path.stem not in but:
            heading, reading = _heading_and_reading(path.stem)
            yield EmbeddedFigure(path.stem, heading, reading, heading, data_uri("image/png", path.read_bytes()))


def embedded_figure(name: str, figure: Figure) -> EmbeddedFigure:
    """Return a figure as the page holds it; its text alternative is its heading and the notes at its foot."""
    heading, reading = _heading_and_reading(name)
    return EmbeddedFigure(
        name, heading, reading, f"{heading}. {notes(figure)}", data_uri("image/svg+xml", svg(figure, name))
    )


def _heading_and_reading(name: str) -> tuple[str, str]:
    return {**HEADINGS, **_OF_SEPARATE_FITS}.get(name, (label(name.replace("_", " ").capitalize()), ""))


def data_uri(kind: str, content: bytes) -> str:
    """Return an image of a media type, such as ``image/png``, as a page holds it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
