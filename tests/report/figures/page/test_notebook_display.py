"""Figures as a notebook shows them: by their name, small, the same each time, with their notes as text."""

from io import BytesIO

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import contrasts, markers, said, sticking_out
from helpers.hand_made_posteriors import grid, posterior, scattered
from helpers.quick_fits import write_result
from PIL import Image
from support import reproduction_figures, results
from support.average_contrast_figures import average_contrasts
from support.stored_figure import StoredFigure

import bayes_tyre as bt
from bayes_tyre.errors import BadInput
from bayes_tyre.published import checks, recompute, tables
from bayes_tyre.report.figures import catalogue
from bayes_tyre.report.figures.page.colours import Setting


@pytest.fixture(scope="module")
def tree():
    factor_table = grid()
    return posterior(scattered(factor_table, seed=5), factor_table)


def test_a_figure_is_asked_for_by_its_name_and_says_its_notes(tree, tmp_path):
    picture = bt.figure(tree, "contrasts")
    png = picture._repr_png_()
    assert png.startswith(b"\x89PNG")
    assert b"Software" not in png
    assert png == bt.figure(tree, "contrasts")._repr_png_()
    text = repr(picture)
    assert text.splitlines()[0] == "Figure."
    assert "data: simulated, not measured" in text
    assert text.index("Marker: median") < text.index("Thick: averages")
    assert picture.save(tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")


def test_a_figure_that_was_written_is_shown_small_and_says_what_its_data_are(tmp_path, monkeypatch):
    monkeypatch.setattr(catalogue, "ALWAYS", {catalogue.CONTRASTS: catalogue.ALWAYS[catalogue.CONTRASTS]})
    monkeypatch.setattr(catalogue, "OF_RECORDS", {})
    write_result(tmp_path / "fit", figures=True)
    kept = StoredFigure(tmp_path / "fit", "contrasts")
    with Image.open(tmp_path / "fit/figures/contrasts.png") as whole, Image.open(BytesIO(kept._repr_png_())) as shown:
        assert shown.size[0] == 800 < whole.size[0]
        assert shown.size[1] / 800 == pytest.approx(whole.size[1] / whole.size[0], abs=0.002)
    assert repr(kept) == "Figure contrasts.\ndata: simulated, not measured"
    with pytest.raises(BadInput, match=r"name the run\.json in a folder that fit wrote"):
        StoredFigure(tmp_path, "contrasts")
    with pytest.raises(BadInput, match=r"energy_per_cycle\.png: no such figure"):
        StoredFigure(tmp_path / "fit", "energy_per_cycle")


def test_what_cannot_be_drawn_is_said(tree):
    with pytest.raises(BadInput, match=r"'contrast' is unknown; use one of .*contrasts"):
        bt.figure(tree, "contrast")
    with pytest.raises(BadInput, match="records_with_bands shows records"):
        bt.figure(tree, "records_with_bands")


def test_average_ratios_of_two_results_stand_side_by_side(tree):
    ratios = {"one": contrasts(), "other": contrasts().assign(median=lambda table: table["median"] + 0.1)}
    figure = average_contrasts(ratios, Setting("published + reconstructed"))
    assert "data: published tables; reconstructed, not measured" in said(figure)
    assert not sticking_out(figure)
    left, _ = figure.get_axes()
    of = contrasts().query("parameter == 'k'")
    averages = np.sort(of[of["step_kN"].isna()]["median"])
    np.testing.assert_allclose(np.sort(markers(left, "o")[:, 0]), averages)
    np.testing.assert_allclose(np.sort(markers(left, "s")[:, 0]), averages + 0.1)
    table = results.average_table([bt.contrasts(tree)], "k")
    assert set(table["origin"]) == {"simulated"}
    assert len(table) == bt.contrasts(tree).query("parameter == 'k'")["step_kN"].isna().sum()
    assert results.setting(tree) == Setting("simulated", bt.diagnose(tree).verdict, ("dual", "single"))


def test_the_signs_that_print_lost_stand_out():
    figure = reproduction_figures.calibration_lines(tables.raw_sample(False), tables.raw_sample(), recompute.SENSORS)
    counts = [len(markers(ax, "x")) for ax in figure.get_axes()]
    assert counts == [7, 0, 0]
    assert not sticking_out(figure)


def test_what_does_not_come_back_lies_outside_the_shade():
    check = checks.round_trip_rows(tables.case_means())
    check = check[~check["quantity"].str.startswith("tests")]
    check.loc[check.index[0], "recomputed"] += 4 * check["tolerance"].iloc[0]
    (ax,) = reproduction_figures.returned_numbers(check, "reconstructed").get_axes()
    drawn = markers(ax, "o")[:, 0]
    assert len(drawn) == len(check)
    off = (check["recomputed"] - check["published"]) / check["tolerance"]
    np.testing.assert_allclose(np.sort(drawn), np.sort(off))
    assert ax.get_xlim()[1] > pd.Series(drawn).max() > 3.9
