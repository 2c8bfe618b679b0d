"""Lists of cases: every case, its interval and its printed value; the records that are discordant."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import (
    FACTORS,
    MEASURED,
    cases,
    factors_of_cases,
    markers,
    printed_values,
    repeats,
    said,
    segments,
)

from bayes_tyre.report.figures.forest import forest_of_cases, outlier_probabilities
from bayes_tyre.report.figures.page import layout


def test_the_forest_holds_every_case_its_interval_and_its_printed_value():
    table, printed = cases(), printed_values()
    left, right = forest_of_cases(table, printed, MEASURED).get_axes()
    for ax, parameter, column in ((left, "k", "k_kN_per_mm"), (right, "beta", "beta_mm")):
        mine = table[table["parameter"] == parameter]
        ends = np.array([segment[:, 0] for segment in segments(ax)])
        np.testing.assert_allclose(np.sort(ends[:, 0]), np.sort(mine["lower"]))
        np.testing.assert_allclose(np.sort(ends[:, 1]), np.sort(mine["upper"]))
        medians = {y: x for x, y in markers(ax, "o", "s")}
        open_ones = {y: x for x, y in markers(ax, "D")}
        assert sorted(open_ones.values()) == pytest.approx(sorted(printed[column]))
        assert {y: x * 1.01 for y, x in open_ones.items()} == pytest.approx(medians)
    shown = [label.get_text() for label in left.get_yticklabels()]
    assert shown[:3] == ["dual, loading", "(0)10-15", "(0)20-30"]
    assert shown.count("(25)30-20") == 2
    assert right.get_xscale() == "log"


def test_a_forest_of_many_cases_stays_below_the_tallest_and_names_what_fits():
    table = cases(speeds=np.arange(150.0))
    figure = forest_of_cases(table, None, MEASURED, "They are of something else.")
    assert any("They are of something else." in text.get_text() for text in figure.texts)
    assert figure.get_figheight() == layout.TALLEST
    ax = figure.get_axes()[0]
    assert len(segments(ax)) == len(table) / 2
    boxes = [label.get_window_extent() for label in ax.get_yticklabels()]
    assert all(above.y0 >= below.y1 - 1 for above, below in pairwise(boxes))


@pytest.mark.parametrize(
    ("factor_table", "how"),
    [*(([word], "nan") for word in FACTORS), (FACTORS, "absent"), (FACTORS, "empty"), (FACTORS[2:], "absent")],
)
def test_missing_words_do_not_stop_a_figure(factor_table, how):
    blank = {"nan": np.nan, "empty": ""}

    def without(table: pd.DataFrame) -> pd.DataFrame:
        return (
            table.drop(columns=factor_table)
            if how == "absent"
            else table.assign(**dict.fromkeys(factor_table, blank[how]))
        )

    forest = forest_of_cases(without(cases()), without(printed_values()), MEASURED)
    assert len(segments(forest.get_axes()[0])) == len(factors_of_cases())
    figure = outlier_probabilities(without(repeats()), MEASURED)
    assert sum(len(markers(ax, "o", "s")) for ax in figure.get_axes()) == 36


def test_printed_values_without_a_case_are_left_out_and_cases_without_one_stay():
    left, _ = forest_of_cases(cases(speeds=(0.0,)), printed_values(speeds=(0.0, 35.0))[1:], MEASURED).get_axes()
    assert np.isfinite(markers(left, "D")[:, 0]).tolist().count(True) == 5


def test_outliers_are_named_and_missing_probabilities_are_said():
    table = repeats()
    texts = said(outlier_probabilities(table, MEASURED))
    assert texts.count("repeat 2") == 1
    assert not any("no marker" in text for text in texts)
    two = table[table["repeat"] < 3].assign(outlier_probability=np.nan)
    texts = said(outlier_probabilities(two, MEASURED))
    assert any("24 of 24 records have no marker: fewer than three repeats." in text for text in texts)
    texts = said(outlier_probabilities(table.assign(outlier_probability=np.nan), MEASURED))
    assert any("or a model that gives none" in text for text in texts)


def test_outliers_without_words_are_named_by_record():
    figure = outlier_probabilities(repeats()[["record", "outlier_probability"]], MEASURED)
    assert len(figure.get_axes()[0].get_yticklabels()) == 36
    assert said(figure).count("record 4") == 2


def test_tables_without_rows_give_a_figure():
    assert forest_of_cases(cases().iloc[:0], printed_values(), MEASURED).get_axes()
    assert outlier_probabilities(repeats().iloc[:0], MEASURED).get_axes()
