"""Figures of fixed tables look as they did: their perceptual hashes are those stored, and a change is found."""

import json
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from audit_made_up import audited, blind
from drawings import MEASURED, cases, drawn, printed_values
from figure_hash import MOST, STORED, distance, figure_hash
from matplotlib.figure import Figure
from matplotlib.text import Text
from test_motion_loops import cells

from bayes_tyre.report import audit_figures, motion_figures
from bayes_tyre.report.case_figures import forest_of_cases
from bayes_tyre.report.colours import Setting
from bayes_tyre.report.motion_loops import friction_loops, true_loop


def loops() -> Figure:
    return motion_figures.loops_by_direction(friction_loops(cells()), Setting("simulated"), 2.0)


def loop() -> Figure:
    path = true_loop(1.8, 0.45, 0.08, 2.0).rename(columns={"median_kN": "friction_kN"})
    return motion_figures.loop_figure(path.assign(force_kN=1.8 * path["displacement_mm"] + path["friction_kN"]), 2.0)


def audit() -> Figure:
    return audit_figures.beta_returned(audited(blind).table, 801)


def of_tables(name: str) -> Callable[[], Figure]:
    return lambda: drawn.__wrapped__(name)


TABLES = ("posteriors_by_direction", "forest_of_cases", "contrasts", "outlier_probabilities")
FIGURES: Mapping[str, Callable[[], Figure]] = {
    **{name: of_tables(name) for name in TABLES},
    **{"loops_by_direction": loops, "loop_figure": loop, "beta_returned": audit},
}


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
    "a curve is missing": (
        "posteriors_by_direction",
        lambda: changed("posteriors_by_direction", without_a_curve),
    ),
    "the notes are missing": ("loops_by_direction", lambda: changed("loops_by_direction", without_notes)),
}


@pytest.mark.parametrize("what", PLANTED)
def test_a_planted_change_is_found(what):
    name, draw = PLANTED[what]
    assert distance(figure_hash(draw()), figure_hash_of(name)) > MOST
