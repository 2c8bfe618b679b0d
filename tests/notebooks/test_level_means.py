"""Means by speed, load and step: over the same cases at each level, and drawn where the table has them."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import markers, said, segments, sticking_out
from helpers.hand_made_posteriors import fixed, posterior
from support.level_figures import by_levels
from support.level_means import BY, level_means

from bayes_tyre.published import tables
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.report.figures.page.colours import Setting


@pytest.fixture(scope="module")
def printed() -> pd.DataFrame:
    return tables.case_means()


@pytest.fixture(scope="module")
def means(printed) -> pd.DataFrame:
    draws = {"k_case": fixed(printed["k_kN_per_mm"]), "beta_case": fixed(printed["beta_mm"])}
    return level_means(posterior(draws, printed[list(CASE_FACTORS)], origin="published"), printed)


def test_levels_of_the_source_average_the_same_cases(means, printed):
    one = means[(means["configuration"] == "dual") & (means["parameter"] == "k")]
    found = {by: (of["level"].tolist(), of["cases"].tolist()) for by, of in one.groupby("by")}
    # Every speed has unloading from 20 and 30 kN by 5 and 10; every load, at standstill, loading by both and unloading
    # by 5; 10 kN unloads by 5 and 7, and stands in no mean by step.
    assert found["speed_km_h"] == ([0, 15, 25, 35], [4] * 4)
    assert found["initial_load_kN"] == ([10, 20, 30], [3] * 3)
    assert found["step_size_kN"] == ([5, 10], [11] * 2)
    of = printed.query("configuration == 'dual' and direction == 'unloading' and initial_load_kN > 10")
    by_speed = one[one["by"] == "speed_km_h"].set_index("level")["median"]
    expected = of.groupby("speed_km_h")["k_kN_per_mm"].mean()
    np.testing.assert_allclose(by_speed, expected.loc[by_speed.index], rtol=1e-12)


def test_a_posterior_that_is_the_printed_values_has_their_means(means):
    for column in ("median", "lower", "upper"):
        np.testing.assert_allclose(means[column], means["printed"], rtol=1e-12)


def test_cases_without_their_words_have_no_means():
    factor_table = pd.DataFrame({"configuration": ["a", "b"], "direction": ["loading"] * 2})
    assert level_means(posterior({"k_case": fixed([1, 2]), "beta_case": fixed([1, 2])}, factor_table)).empty


def test_the_figure_has_a_marker_a_level_and_the_colours_of_every_figure(means):
    moved = means.assign(lower=0.9 * means["median"], upper=1.2 * means["median"])
    figure = by_levels(moved, Setting("published", "fail", ("single", "dual")))
    assert "data: published tables" in said(figure)
    assert "verdict: fail, not to be trusted" in said(figure)
    assert not sticking_out(figure)
    axes = figure.get_axes()
    assert len(axes) == 2 * len(BY)
    for ax, by in zip(axes, BY, strict=False):
        mine = moved[(moved["by"] == by) & (moved["parameter"] == "k")]
        for name, look in Setting("measured").looks(["single", "dual"]).items():
            of = mine[mine["configuration"] == name]
            np.testing.assert_allclose(markers(ax, look.marker)[:, 1], of["median"])
        heights = np.sort([segment[:, 1] for segment in segments(ax)], axis=0)
        np.testing.assert_allclose(heights, np.sort(mine[["lower", "upper"]], axis=0))
