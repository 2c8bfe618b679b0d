"""Densities with their intervals; prior beside posterior with the contraction."""

import matplotlib.pyplot
import numpy as np
import pytest
from helpers.drawings import FACTORS, MEASURED, cells, prior_posteriors, said
from matplotlib.collections import PolyCollection

from bayes_tyre.report.figures import densities as density_figures
from bayes_tyre.report.figures.densities import posteriors_by_direction, prior_and_posterior_of_scales
from bayes_tyre.report.figures.page.colours import Setting


def test_posteriors_show_a_density_and_an_interval_for_each_configuration_and_direction():
    draws = cells(("a", "b", "c"))
    figure = posteriors_by_direction(draws, MEASURED, 0.9)
    assert any("90 % interval" in text for text in said(figure))
    axes = figure.get_axes()
    assert [ax.get_title() for ax in axes] == ["loading", "unloading", "", ""]
    for ax in axes:
        assert sum(isinstance(c, PolyCollection) for c in ax.collections) == 3
    chosen = draws.query("configuration == 'b' and direction == 'loading' and parameter == 'k'")["value"]
    look = Setting("measured").looks("abc")["b"]
    bars = [np.asarray(line.get_xydata()) for line in axes[0].lines if line.get_color() == look.colour]
    ends = next(bar[:, 0] for bar in bars if len(bar) == 2)
    np.testing.assert_allclose(ends, np.quantile(chosen, [0.05, 0.95]))


@pytest.mark.parametrize(("spread", "scale"), [(0.05, "linear"), (1.0, "log")])
def test_beta_stands_on_a_logarithmic_axis_when_it_spreads_over_more_than_a_decade(spread, scale):
    axes = posteriors_by_direction(cells(spread=spread), MEASURED).get_axes()
    assert [ax.get_xscale() for ax in axes] == ["linear", "linear", scale, scale]


def test_posteriors_of_one_configuration_without_words():
    figure = posteriors_by_direction(cells(("single",)).drop(columns=FACTORS[:2]), MEASURED)
    assert {"configuration not stated", "direction not stated"} <= set(said(figure))
    assert posteriors_by_direction(cells(("single",)).assign(value=0.5), MEASURED).get_axes()
    assert posteriors_by_direction(cells().iloc[:0], MEASURED).get_axes()


def test_each_scale_has_a_panel_with_both_densities_and_its_contraction():
    shown = prior_posteriors()
    figure = prior_and_posterior_of_scales(shown, MEASURED)
    axes = [ax for ax in figure.get_axes() if ax.get_visible()]
    assert len(axes) == len(shown)
    for ax, scale in zip(axes, shown, strict=True):
        assert ax.get_title() == f"{scale.name}\ncontraction {scale.contraction:.2f}"
        assert ax.get_xscale() == ("log" if scale.log else "linear")
        assert ("log scale" in ax.get_xlabel()) == scale.log
        (posterior,) = ax.lines
        np.testing.assert_array_equal(np.asarray(posterior.get_xydata()), np.stack([scale.at, scale.posterior], 1))
        (prior,) = (c for c in ax.collections if isinstance(c, PolyCollection))
        outline = np.asarray(prior.get_paths()[0].vertices)
        assert set(zip(scale.at, scale.prior, strict=True)) <= set(map(tuple, outline))


def test_scales_that_the_data_said_little_of_are_bold():
    figure = prior_and_posterior_of_scales(prior_posteriors((0.9, 0.1, 0.5, -0.3)), MEASURED)
    assert [ax.title.get_fontweight() for ax in figure.get_axes()] == ["normal", "bold", "normal", "bold"]


@pytest.mark.parametrize("count", [0, 1, 4, 7])
def test_any_number_of_scales_gives_a_figure_of_those_that_fit(count, monkeypatch):
    monkeypatch.setattr(density_figures, "MOST_SCALES", 6)
    figure = prior_and_posterior_of_scales(prior_posteriors((0.5,) * count), MEASURED)
    assert sum(ax.get_visible() for ax in figure.get_axes()) == min(count, 6)
    assert any("first 6 of 7." in text for text in said(figure)) == (count == 7)


def test_no_window_holds_a_figure():
    prior_and_posterior_of_scales(prior_posteriors(), MEASURED)
    assert matplotlib.pyplot.get_fignums() == []
