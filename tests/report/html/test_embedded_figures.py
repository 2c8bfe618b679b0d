"""Figures inside the page: SVG of the same bytes each time, with a text alternative, dense layers as images."""

import base64
import re

import numpy as np
import pytest
from helpers.drawings import drawn

from bayes_tyre.report.figures.page.svg import DENSE_MARKERS, svg
from bayes_tyre.report.html.figures import embedded_figure


@pytest.mark.parametrize("name", ["pair_plot", "forest_of_cases"])
def test_the_same_figure_gives_the_same_bytes(name):
    figures = [svg(drawn.__wrapped__(name), name) for _ in range(2)]
    assert figures[0] == figures[1]
    text = figures[0].decode("utf-8")
    named = re.findall(r'\bid="([^"]+)"', text)
    assert len(set(named)) == len(named)
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(named)


def test_a_figure_has_a_text_alternative_and_is_svg_without_its_labels_as_markup():
    shown = embedded_figure("contrasts", drawn("contrasts"))
    assert shown.alternative.startswith("Ratios between configurations")
    assert "Marker: median." in shown.alternative
    text = base64.b64decode(shown.uri.removeprefix("data:image/svg+xml;base64,")).decode()
    assert text.startswith("<?xml")
    assert "<!--" not in text
    assert "<text" not in text


def test_layers_with_many_markers_are_images_inside_the_svg():
    figure = drawn.__wrapped__("pair_plot")
    most = max(len(np.asarray(line.get_xydata())) for ax in figure.get_axes() for line in ax.lines)
    assert most > DENSE_MARKERS
    assert b"<image" in svg(figure, "pair_plot")
    assert b"<image" not in svg(drawn.__wrapped__("contrasts"), "contrasts")
