"""What holds for every figure: units, origin and verdict, the same colours, any label, nothing changed outside."""

import copy
from typing import Any

import matplotlib.pyplot
import numpy as np
import pandas as pd
import pytest
from helpers import drawings
from helpers.drawings import ALL, OF_CONFIGURATIONS, drawn, said, sticking_out
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from bayes_tyre.report.figures.page import labels, layout
from bayes_tyre.report.figures.page.colours import Setting

HOSTILE = ("a$b_c$", "<script>alert(1)</script>", "_hidden", "x" * 300, "two\nlines \x00", "$\\frac{", "四輪", "")
UNITS = ("mm", "kN", "no unit", "count")


def colours_of(figure: Figure) -> set[str]:
    """Return every colour that lines and areas of the panels have."""
    found: list[Any] = []
    for ax in figure.get_axes():
        found += [line.get_color() for line in ax.lines]
        for collection in (c for c in ax.collections if isinstance(c, Collection)):
            found += [*collection.get_facecolor(), *collection.get_edgecolor()]
    return {to_hex(colour) for colour in found}


@pytest.mark.parametrize("name", ALL)
def test_axes_carry_units_and_a_corner_says_the_origin(name):
    figure = drawn(name, Setting("reconstructed"))
    assert "data: reconstructed, not measured" in said(figure)
    for ax in (ax for ax in figure.get_axes() if ax.get_visible()):
        place = ax.get_subplotspec()
        inner = place is not None and (name in ("pair_plot", "rank_plot") and not place.is_last_row())
        assert any(unit in ax.get_xlabel() for unit in UNITS) or inner
        assert any(unit in ax.get_ylabel() for unit in UNITS) or (place and not place.is_first_col())
        assert all(isinstance(inset, Axes) and "mm, kN" in inset.get_title() for inset in ax.child_axes)


@pytest.mark.parametrize("name", ALL)
def test_a_failed_verdict_is_said(name):
    for verdict in ("pass", "fail"):
        figure = drawn(name, Setting("measured", verdict))
        assert ("verdict: fail, not to be trusted" in said(figure)) == (verdict == "fail")


@pytest.mark.parametrize("name", ALL)
def test_nothing_outside_is_changed(name, monkeypatch):
    tables = drawings.made(name, ("single", "dual"))
    copies = copy.deepcopy(tables)
    monkeypatch.setattr(drawings, "made", lambda *_: tables)
    before = dict(matplotlib.rcParams)
    drawn.__wrapped__(name)
    assert dict(matplotlib.rcParams) == before
    assert matplotlib.pyplot.get_fignums() == []
    for table, kept in zip(tables, copies, strict=True):
        if isinstance(table, pd.DataFrame):
            pd.testing.assert_frame_equal(table, kept)


@pytest.mark.parametrize("name", OF_CONFIGURATIONS)
def test_any_label_is_drawn_as_plain_text(name, tmp_path):
    figure = drawn(name, configurations=HOSTILE)
    layout.save(figure, tmp_path / "figure.png")
    texts = [part.strip() for text in said(figure) for part in text.replace(",", "\n").split("\n")]
    for label in HOSTILE[:4]:
        start = labels.plain(label, 12)[:2]
        assert any(text.startswith(start) or f" {start}" in text for text in texts)
    assert not sticking_out(figure)


@pytest.mark.parametrize("name", ALL)
def test_every_text_lies_within_the_page(name):
    assert not sticking_out(drawn(name, Setting("measured + published + reconstructed", "fail")))


@pytest.mark.parametrize("name", OF_CONFIGURATIONS)
@pytest.mark.parametrize("order", [("single", "dual"), ("dual", "single")])
def test_a_configuration_has_the_same_colour_in_every_figure(name, order):
    look = Setting("measured").looks(["single", "dual"])
    palette = {one.colour.lower() for one in Setting("measured").looks(map(str, range(6))).values()}
    assert colours_of(drawn(name, configurations=order)) & palette == {one.colour.lower() for one in look.values()}


@pytest.mark.parametrize("name", OF_CONFIGURATIONS)
def test_a_configuration_keeps_its_colour_where_others_are_not_shown(name):
    setting = Setting("measured", configurations=("a", "b", "single"))
    third = Setting("measured").looks(setting.configurations)["single"].colour.lower()
    palette = {one.colour.lower() for one in Setting("measured").looks(map(str, range(6))).values()}
    assert colours_of(drawn(name, setting, ("single",))) & palette == {third}


@pytest.mark.parametrize("name", sorted(set(ALL) - set(OF_CONFIGURATIONS)))
def test_what_is_of_no_configuration_has_the_colour_of_none(name):
    palette = {one.colour.lower() for one in Setting("measured").looks(map(str, range(6))).values()}
    assert not colours_of(drawn(name)) & palette


@pytest.mark.parametrize("name", ALL)
def test_saved_files_are_the_same_each_time(name, tmp_path):
    one, two = (layout.save(drawn.__wrapped__(name), tmp_path / f"{i}.png") for i in (1, 2))
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.parametrize("name", ALL)
def test_figures_are_as_wide_as_the_page_and_no_taller_than_the_tallest(name):
    width, height = drawn(name).get_size_inches()
    assert width == layout.WIDTH
    assert 1 < height <= layout.TALLEST
    assert np.isfinite(height)


def test_single_and_dual_look_the_same_in_every_result():
    both = Setting("measured").looks(["single", "dual"])
    for others in (["single"], ["dual"], ["a", "single"], ["dual", "z"], ["a", "single", "dual", "z"]):
        looks = Setting("measured").looks(others)
        assert len({(look.colour, look.marker) for look in looks.values()}) == len(others)
        assert all(looks[name] == both[name] for name in set(others) & set(both))
        assert Setting("measured", configurations=tuple(others)).looks(others) == looks
