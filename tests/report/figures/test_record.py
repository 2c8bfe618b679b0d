"""Records with bands, their residuals, and records of the priors beside them."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import MEASURED, markers, panels, records, residuals, said
from matplotlib.colors import to_hex
from matplotlib.patches import StepPatch

from bayes_tyre.report.figures.page import colours
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.record import (
    MOST_RECORDS,
    prior_predictive_curves,
    records_with_bands,
    residuals_against_displacement,
)


def test_records_show_points_band_and_residuals_of_six_at_most():
    points, bands = records([f"r{i}" for i in range(8)])
    figure = records_with_bands(points, bands, MEASURED, 0.9)
    titles = [ax.get_title() for ax in figure.get_axes() if ax.get_title()]
    assert titles == [f"r{i}" for i in range(6)]
    assert any("first 6 of 8 records" in text for text in said(figure))
    assert sum("median and 90 % interval" in text for text in said(figure)) == 6
    above, below = figure.get_axes()[:2]
    assert len(markers(above, "o")) == 60
    np.testing.assert_allclose(markers(below, "o")[:, 1], (points["force_kN"] - bands["median_kN"])[:60])
    assert below.get_xscale() == "log"


def test_records_with_a_coarser_band_or_none():
    points, bands = records(["known", "unknown"], points=400)
    coarse = bands[bands["record"] == "known"].iloc[::4]
    figure = records_with_bands(points, coarse, MEASURED)
    expected = (points["force_kN"] - bands["median_kN"])[:400]
    np.testing.assert_allclose(markers(figure.get_axes()[1], "o")[:, 1], expected, atol=0.01)
    assert any("no residuals" in text for text in said(figure))


def test_records_without_a_configuration_are_drawn_without_its_name():
    points, bands = (table.drop(columns="configuration") for table in records())
    texts = said(records_with_bands(points, bands, MEASURED))
    assert texts.count("median and 95 % interval") == 1
    left, every = (table.drop(columns="configuration", errors="ignore") for table in residuals())
    assert "± sigma" in said(residuals_against_displacement(left, every, MEASURED, 0.3))


def test_residuals_stand_against_displacement_with_sigma_and_their_autocorrelation():
    left, every = residuals(("first", "second", "third"))
    figure = residuals_against_displacement(left, every.assign(sigma_kN=[0.01, 0.02, 0.03]), MEASURED, 0.3)
    *axes, last = figure.get_axes()
    assert [ax.get_title() for ax in axes] == [
        "first: lag-1 autocorrelation \u22120.20",
        "second: lag-1 autocorrelation 0.10",
        "third: lag-1 autocorrelation 0.40",
    ]
    for ax, (name, sigma) in zip(axes, (("first", 0.01), ("second", 0.02), ("third", 0.03)), strict=True):
        mine = left[left["record"] == name][["displacement_mm", "residual_kN"]]
        np.testing.assert_array_equal(markers(ax, "o"), mine)
        factors = sorted({float(np.asarray(line.get_ydata())[0]) for line in ax.lines if line.get_marker() == "None"})
        assert factors == [-sigma, 0.0, sigma]
    assert "mean 0.10 (line); a mean above 0.3 (dashed), by more than chance, fails" in last.get_title()


def test_the_histogram_counts_every_record_in_the_colour_of_its_configuration():
    rng = np.random.default_rng(3)
    left, _ = residuals(("r0",))
    names = np.array(["a", "b"])[rng.integers(2, size=200)]
    every = pd.DataFrame({"record": [f"r{i}" for i in range(200)], "configuration": names, "sigma_kN": 0.03})
    every["autocorrelation"] = rng.normal(0, 0.4, 200)
    last = residuals_against_displacement(left, every, MEASURED, 0.3).get_axes()[-1]
    solid, dashed = sorted(float(np.asarray(line.get_xdata())[0]) for line in last.lines)
    assert (dashed, solid) == (0.3, pytest.approx(every["autocorrelation"].mean()))
    counted = {}
    for steps in (patch for patch in last.patches if isinstance(patch, StepPatch)):
        values, _, floor = steps.get_data()
        counted[to_hex(steps.get_facecolor()[:3])] = np.sum(values - floor)
    expected = {look.colour.lower(): np.sum(names == name) for name, look in Setting("measured").looks("ab").items()}
    assert counted == expected


def test_only_a_few_records_are_shown_and_no_more_than_there_are():
    for count in (0, 1, 2, 9):
        names = tuple(f"r{i}" for i in range(count))
        left, every = residuals(names) if count else (table.iloc[:0] for table in residuals())
        figure = residuals_against_displacement(left, every, MEASURED, 0.3)
        assert len(figure.get_axes()) == min(count, MOST_RECORDS) + 1
        points, bands = records(names) if count else (table.iloc[:0] for table in records())
        assert records_with_bands(points, bands, MEASURED)


def test_prior_records_lie_behind_the_data_of_their_case():
    shown = panels(("a", "b"), curves=4)
    axes = prior_predictive_curves(shown, MEASURED, 0.5).get_axes()
    look = Setting("measured").looks("ab")
    for ax, panel in zip(axes, shown, strict=True):
        assert ax.get_title() == f"{panel.configuration}, loading\nlike like"
        *prior, data = ax.lines
        assert len(prior) == 4
        assert {line.get_color() for line in prior} == {colours.PALE}
        assert data.get_color() == look[panel.configuration].colour
        np.testing.assert_array_equal(data.get_xydata(), panel.points[["displacement_mm", "force_kN"]])
        low, high = ax.get_ylim()
        assert low < 5.0 < 60.0 < high


@pytest.mark.parametrize("count", [0, 1, 3, 8])
def test_any_number_of_cells_gives_six_prior_panels_at_most(count):
    figure = prior_predictive_curves(panels([f"c{i}" for i in range(count)]), MEASURED, 0.5)
    assert sum(ax.get_visible() for ax in figure.get_axes()) == min(count, MOST_RECORDS)
    assert "50 % interval" in said(figure)


def test_prior_panels_without_words_are_named_by_their_record():
    (panel,) = panels(("",))
    (ax,) = prior_predictive_curves([panel._replace(direction="")], MEASURED).get_axes()
    assert ax.get_title() == "like like"
