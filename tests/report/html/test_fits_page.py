"""The page of fits without a posterior: tables, units, errors, origin, figures; labels are text."""

import re

import pandas as pd
import pytest
from helpers.reported_results import SCRIPT

from bayes_tyre.report.html.figures import stored_figures
from bayes_tyre.report.html.fits_page import fits_document
from bayes_tyre.results.separate_fits import Column, FitTable


def table(origin: str = "simulated") -> FitTable:
    names = Column("test", "", pd.Series(["a", SCRIPT]), pd.Series([float("nan")] * 2), is_text=True)
    k = Column(
        "k", "kN/mm", pd.Series([1.23456789, float("nan")]), pd.Series([0.01234567, float("nan")]), is_text=False
    )
    return FitTable("slow tests", [names, k], pd.Series(["ok", f"no travel {SCRIPT}"]), origin)


def test_numbers_have_their_unit_error_and_all_digits_to_sort_by():
    page = fits_document([table()], [])
    assert "<title>Slow tests</title>" in page
    assert 'k <span class="unit">kN/mm</span>' in page
    cell = '<td data-head="k kN/mm" data-value="'
    assert f'{cell}1.23456789" class="number">1.235 <span class="reach">± 0.01235</span></td>' in page
    assert f'{cell}" class="number"></td>' in page
    assert "Slow tests: 2, 1 not ok" in page
    assert "Simulated: records computed from a model." in page
    assert "Figures" not in page


def test_counts_are_whole_numbers():
    points = Column("points", "", pd.Series([60.0, 1500.0]), pd.Series([float("nan")] * 2), is_text=False)
    page = fits_document([table()._replace(columns=[*table().columns, points])], [])
    assert 'class="number">60</td>' in page
    assert 'class="number">1500</td>' in page


def test_labels_and_statuses_are_text_and_the_page_asks_for_nothing_outside():
    page = fits_document([table()], [])
    assert SCRIPT not in page
    assert page.count("&lt;script&gt;") >= 2
    assert "default-src &#39;none&#39;" in page
    assert not re.findall(r"(?:src|href)=\"(?!data:|#)", page)


@pytest.mark.parametrize("unseen", ["\u202e", "\u2066", "\u200b", "\u200d", "\ufeff", "\u00ad", "\x1b", "\x7f"])
def test_characters_that_show_nothing_or_turn_others_round_are_replaced_everywhere(unseen):
    names = Column(
        "test", "", pd.Series([f"a{unseen}b", f"{unseen}\u00e9 \u05d0"]), pd.Series([float("nan")] * 2), True
    )
    page = fits_document([FitTable(f"slow{unseen} tests", [names], pd.Series(["ok", unseen]), f"measured{unseen}")], [])
    assert unseen not in page
    assert "a\N{REPLACEMENT CHARACTER}b" in page
    assert "\u00e9 \u05d0" in page


def test_figures_stand_in_the_page_with_a_heading(tmp_path):
    (tmp_path / "load_deflection_loops.png").write_bytes(b"\x89PNG")
    page = fits_document([table("measured")], list(stored_figures(tmp_path, set())))
    assert "<h3>Slow tests</h3>" in page
    assert page.count("data:image/png;base64,") == 1
    assert 'class="banner measured"' in page
