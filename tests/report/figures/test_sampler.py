"""Ranks by chain within their band; pairs of population parameters with what diverged."""

from itertools import pairwise

import numpy as np
import pytest
from helpers.drawings import MEASURED, hyperparameters, markers, ranks, said, sticking_out
from matplotlib.collections import PolyCollection

from bayes_tyre.record import DIRECTIONS
from bayes_tyre.report.figures import sampler as sampler_figures
from bayes_tyre.report.figures.page.colours import INK
from bayes_tyre.report.figures.sampler import CLOUD, pair_plot, rank_plot
from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter
from bayes_tyre.results.figure_data.ranks import in_words

QUIET = np.zeros((4, 200), dtype=bool)


def test_each_parameter_has_a_panel_with_a_line_for_each_chain_and_the_band():
    shown = ranks(5, chains=3)
    figure = rank_plot(shown, MEASURED)
    axes = [ax for ax in figure.get_axes() if ax.get_visible()]
    assert [ax.get_title() for ax in axes] == [one.name for one in shown]
    assert [text for text in said(figure) if text.startswith("chain ")] == ["chain 0", "chain 1", "chain 2"]
    assert any(in_words(shown) in text for text in said(figure))
    for ax, one in zip(axes, shown, strict=True):
        for line, excess in zip(ax.lines, one.excess, strict=True):
            np.testing.assert_array_equal(line.get_xydata(), np.stack([one.at, excess], 1))
        (band,) = (c for c in ax.collections if isinstance(c, PolyCollection))
        assert np.asarray(band.get_paths()[0].vertices)[:, 1].max() == one.band.max()


def test_the_lowest_panel_of_each_column_carries_the_ranks():
    axes = rank_plot(ranks(6), MEASURED).get_axes()
    assert [bool(ax.get_xlabel()) for ax in axes] == [False, False, True, True, True, True, False, False]


@pytest.mark.parametrize("count", [0, 1, 4, 7])
def test_any_number_of_parameters_gives_a_rank_plot_of_those_that_fit(count, monkeypatch):
    monkeypatch.setattr(sampler_figures, "MOST_RANKED", 6)
    figure = rank_plot(ranks(count), MEASURED)
    assert sum(ax.get_visible() for ax in figure.get_axes()) == min(count, 6)
    assert any("The first 6 of 7" in text for text in said(figure)) == (count == 7)


def test_many_chains_are_drawn_without_a_name_for_each():
    texts = said(rank_plot(ranks(2, chains=12), MEASURED))
    assert not any(text.startswith("chain ") for text in texts)
    assert "95 % band" in texts


def test_pairs_are_each_parameter_against_each_other_with_their_correlation():
    rng = np.random.default_rng(2)
    one = rng.normal(5, 1, (4, 200))
    shown = [
        Hyperparameter("k_group[a b loading]", "kN/mm", "a b", one),
        Hyperparameter("beta_group[a b loading]", "mm", "a b", -one + 10),
        Hyperparameter("sd_log_k_case", "", None, rng.normal(5, 1, (4, 200))),
    ]
    figure = pair_plot(shown, QUIET, MEASURED)
    axes = figure.get_axes()
    assert len(axes) == 6
    _, below, _, left, _, _ = axes
    apart = 800 // CLOUD
    drawn = np.stack([one.ravel()[::apart], 10 - one.ravel()[::apart]], 1)
    np.testing.assert_array_equal(markers(below, "o"), drawn)
    assert [text.get_text() for text in below.texts] == ["\u22121.00"]
    assert below.texts[0].get_fontweight() == "bold"
    assert below.get_ylabel() == "beta_group\na b\nloading\n(mm)"
    assert left.get_xlabel() == "k_group\na b\nloading\n(kN/mm)"
    assert left.get_ylabel() == "sd_log_k\n_case\n(no unit)"
    assert any("No transition diverged." in text for text in said(figure))


def test_every_divergence_is_marked_whatever_the_cloud_leaves_out():
    shown = hyperparameters(("a", "b"))
    divergent = QUIET.copy()
    divergent[2, [3, 77, 151]] = True
    figure = pair_plot(shown, divergent, MEASURED)
    crosses = markers(figure.get_axes()[1], "x")
    np.testing.assert_array_equal(crosses, np.stack([shown[0].draws[divergent], shown[1].draws[divergent]], 1))
    assert any("divergent transitions (3)" in text for text in said(figure))


def test_a_parameter_over_more_than_a_decade_is_shown_by_its_logarithm():
    wide = Hyperparameter("sd_log_k_case", "", None, np.exp(np.random.default_rng(1).normal(0, 2, (4, 200))))
    (ax,) = pair_plot([wide], QUIET, MEASURED).get_axes()
    assert "log10" in ax.get_xlabel()
    low, high = ax.get_xlim()
    assert low < np.log10(wide.draws).min() < np.log10(wide.draws).max() < high
    assert {line.get_color() for line in ax.lines} == {INK}


def test_the_names_of_ten_parameters_keep_apart_and_within_the_page():
    rng = np.random.default_rng(9)
    cells = [f"{p}_group[{c} {d}]" for p in ("k", "beta") for c in ("single", "x" * 90) for d in DIRECTIONS]
    names = [*cells, "sd_log_k_published", "sd_log_beta_published"]
    wide = [Hyperparameter(name, "kN/mm", None, np.exp(rng.normal(0, 2, (4, 200)))) for name in names]
    figure = pair_plot(wide, QUIET, MEASURED)
    assert not sticking_out(figure)
    below = [ax.xaxis.label.get_window_extent() for ax in figure.get_axes()[-10:]]
    assert [i for i, (one, following) in enumerate(pairwise(below)) if one.x1 >= following.x0] == []
    beside = [ax.yaxis.label.get_window_extent() for ax in figure.get_axes() if ax.get_ylabel()]
    assert [i for i, (one, following) in enumerate(pairwise(beside)) if following.y1 >= one.y0] == []


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_parameters_give_a_figure(count):
    figure = pair_plot(hyperparameters(())[:1] * count, QUIET, MEASURED)
    assert len(figure.get_axes()) == count * (count + 1) // 2


def test_long_names_above_panels_keep_what_tells_them_apart():
    names = [f"k_group[315/80 R22.5 {maker} unloading]" for maker in ("Alpha", "Beta")]
    figure = rank_plot([one._replace(name=name) for one, name in zip(ranks(2), names, strict=True)], MEASURED)
    titles = [ax.get_title() for ax in figure.axes]
    assert titles == [f"k_group\n315/80 R22.5 {maker} unloading" for maker in ("Alpha", "Beta")]
    assert not sticking_out(figure)
