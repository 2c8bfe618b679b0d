"""Figures of fixed tables look as they did: their perceptual hashes are those stored, and a change is found."""

import json
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from helpers.drawings import MEASURED, cases, printed_values
from helpers.figure_hash import FIGURES, MOST, STORED, distance, figure_hash
from matplotlib.figure import Figure
from matplotlib.text import Text

from bayes_tyre.report.figures.forest import forest_of_cases


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_looks_as_it_did(name):
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    assert distance(figure_hash(FIGURES[name]()), stored[name]) <= MOST


@pytest.mark.parametrize("name", FIGURES)
def test_letters_with_other_edges_are_no_change(name):
    edged = figure_hash(changed(name, without_grey_edges))
    assert edged != figure_hash_of(name)
    assert distance(edged, figure_hash_of(name)) <= MOST


def figure_hash_of(name: str) -> str:
    return json.loads(STORED.read_text(encoding="utf-8"))[name]


def without_an_interval() -> Figure:
    table = cases()
    first = table.index == 0
    for end in ("lower", "upper"):
        table[end] = table[end].mask(first, table["median"])
    return forest_of_cases(table, printed_values(), MEASURED)


def changed(name: str, change: Callable[[Figure], object]) -> Figure:
    figure = FIGURES[name]()
    change(figure)
    return figure


def wider(figure: Figure) -> None:
    low, high = figure.get_axes()[0].get_xlim()
    figure.get_axes()[0].set_xlim(low, high + 0.1 * (high - low))


def without_grey_edges(figure: Figure) -> None:
    for text in figure.findobj(lambda artist: isinstance(artist, Text)):
        text.set(antialiased=False)


def without_a_curve(figure: Figure) -> None:
    max(figure.get_axes()[0].lines, key=lambda line: len(np.asarray(line.get_xydata()))).remove()


def without_notes(figure: Figure) -> None:
    for text in list(figure.texts):
        text.remove()


PLANTED: Mapping[str, tuple[str, Callable[[], Figure]]] = {
    "an interval is missing": ("forest_of_cases", without_an_interval),
    "an axis is a tenth longer": ("forest_of_cases", lambda: changed("forest_of_cases", wider)),
    "an axis has lost its name": (
        "contrasts",
        lambda: changed("contrasts", lambda figure: figure.get_axes()[0].set_xlabel("")),
    ),
    "an axis is logarithmic": (
        "beta_returned",
        lambda: changed("beta_returned", lambda figure: figure.get_axes()[0].set_yscale("linear")),
    ),
    "a curve is missing": ("posteriors_by_direction", lambda: changed("posteriors_by_direction", without_a_curve)),
    "the notes are missing": ("loops_by_direction", lambda: changed("loops_by_direction", without_notes)),
}


@pytest.mark.parametrize("what", PLANTED)
def test_a_planted_change_is_found(what):
    name, draw = PLANTED[what]
    assert distance(figure_hash(draw()), figure_hash_of(name)) > MOST
