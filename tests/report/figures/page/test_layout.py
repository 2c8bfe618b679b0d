"""Labels as plain text, looks, the notes of a page, and how it is written."""

from itertools import pairwise

import numpy as np
import pytest
from helpers.drawings import drawn, said, sticking_out
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.transforms import Bbox
from PIL import Image

from bayes_tyre.report.figures.page import labels, layout
from bayes_tyre.report.figures.page.colours import Setting


@pytest.mark.parametrize(
    ("origin", "note"),
    [
        ("reconstructed", "data: reconstructed, not measured"),
        ("simulated", "data: simulated, not measured"),
        ("published", "data: published tables"),
        ("measured + simulated", "data: measured; simulated, not measured"),
        ("origin not stated", "data: origin not stated"),
        ("", "data: origin not stated"),
    ],
)
def test_the_origin_is_said_plainly(origin, note):
    assert labels.origin_note(origin) == note


def test_plain_text_escapes_mathtext_and_shortens_what_is_long():
    assert labels.plain("a$b$") == r"a\$b\$"
    assert labels.plain("two\n lines") == "two lines"
    assert labels.plain("四") == r"\u56db"
    assert len(labels.plain("y" * 500)) == 40


@pytest.mark.parametrize(
    ("value", "text"), [(0.126, "0.13"), (-0.126, "\u22120.13"), (-0.001, "0.00"), (0.0, "0.00"), (float("nan"), "nan")]
)
def test_decimals_have_a_minus_sign_and_no_negative_zero(value, text):
    assert labels.decimals(value) == text


def test_looks_differ_for_many_configurations_and_neighbours_differ_in_every_way():
    look = list(Setting("measured").looks(f"{i:03d}" for i in range(210)).values())
    assert len({(one.colour, one.marker, one.line) for one in look}) == 210
    for one, following in pairwise(look):
        assert all(mine != other for mine, other in zip(one, following, strict=True))


def test_a_setting_gives_what_is_shown_the_look_it_has_among_all():
    every = Setting("measured").looks(["a", "b", "c"])
    assert Setting("measured", configurations=("c", "a", "b")).looks(["c", "a"]) == {"a": every["a"], "c": every["c"]}
    unknown = Setting("measured", configurations=("b", "c")).looks(["c", "a"])
    assert unknown == {"a": every["c"], "c": every["b"]}


def test_long_notes_are_broken_into_lines_below_the_axes():
    for factor_table in (3, 80):
        figure = layout.page(layout.WIDTH, 3.0)
        ax = figure.subplots()
        ax.set_xlabel("displacement (mm)")
        layout.finish(figure, Setting("measured", "fail"), "nine signs " * factor_table)
        notes = [text for text in figure.texts if "nine signs" in text.get_text()]
        assert (len(notes) > 1) == (factor_table == 80)
        tops = [note.get_window_extent().y1 for note in notes]
        assert max(tops) <= ax.xaxis.label.get_window_extent().y0
        assert not sticking_out(figure)
        assert " ".join(note.get_text() for note in reversed(notes)).count("nine signs") == factor_table


def test_a_legend_shows_labels_that_begin_with_an_underscore():
    figure = drawn("posteriors_by_direction", configurations=("_a", "b"))
    assert {"_a", "b"} <= set(said(figure))


def test_files_appear_whole_and_say_nothing_of_what_wrote_them(tmp_path):
    path = layout.save(drawn("forest_of_cases"), tmp_path / "new" / "figure.png")
    with Image.open(path) as picture:
        assert (picture.format, picture.width, "Software" in picture.info) == ("PNG", 8 * 150, False)
    assert [found.name for found in path.parent.iterdir()] == ["figure.png"]


def test_the_rounding_of_the_layout_s_solver_moves_nothing(monkeypatch):
    executed = ConstrainedLayoutEngine.execute

    def places(off: float) -> list[tuple[float, ...]]:
        def execute(engine: ConstrainedLayoutEngine, figure: Figure) -> None:
            executed(engine, figure)
            for ax in figure.axes:
                ax.set_position(Bbox.from_bounds(*(np.array(ax.get_position(original=True).bounds) + off)))

        monkeypatch.setattr(ConstrainedLayoutEngine, "execute", execute)
        figure, axes, _ = layout.panel_grid(5, 3, 1.2, 1.0)
        layout.finish(figure, Setting("measured"), "a note")
        return [ax.get_position(original=True).bounds for ax in axes]

    assert places(1e-15) == places(-1e-15)
    assert places(1e-3) != places(-1e-3)
