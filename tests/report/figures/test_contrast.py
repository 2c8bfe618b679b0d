"""Ratios as a figure: what is listed, where the markers stand, and what probabilities claim."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import MEASURED, contrasts, markers, said, segments

from bayes_tyre.report.figures.contrast import contrasts_by_case


def test_averages_stand_above_the_cases_they_average_and_values_where_the_table_has_them():
    table = contrasts()
    left, right = contrasts_by_case(table, MEASURED).get_axes()
    labels = [tick.get_text() for tick in left.get_yticklabels()]
    assert labels[:3] == ["single / dual, same case", "average", "loading (0)10-15"]
    assert labels[-3:] == ["loading / unloading, same span", "average, single", "average, dual"]
    for ax, parameter in ((left, "k"), (right, "beta")):
        mine = table[table["parameter"] == parameter]
        np.testing.assert_allclose(np.sort(markers(ax, "o")[:, 0]), np.sort(mine["median"]))
        ends = np.sort([segment[:, 0] for segment in segments(ax)], axis=0)
        np.testing.assert_allclose(ends, np.sort(mine[["lower", "upper"]], axis=0))
    assert right.get_xscale() == "log"
    assert left.get_xscale() == "linear"


def test_cases_of_contrasts_between_directions_are_left_to_the_table():
    table = contrasts()
    cases = table[table["matching"] == "same case"].assign(contrast="loading / unloading", matching="same span")
    rows = cases[cases["step_kN"].notna()]
    texts = said(contrasts_by_case(table, MEASURED))
    more = said(contrasts_by_case(pd.concat([table, rows], ignore_index=True), MEASURED))
    assert texts == more


def test_cases_of_a_configuration_that_is_called_after_a_direction_are_drawn():
    table = contrasts()
    same = table["matching"] == "same case"
    table.loc[same, "contrast"] = "loading rig A / loading rig B"
    left, _ = contrasts_by_case(table, MEASURED).get_axes()
    labels = [tick.get_text() for tick in left.get_yticklabels()]
    assert labels[:3] == ["loading rig A / loading rig B, same case", "average", "loading (0)10-15"]


def test_cases_that_differ_by_speed_alone_are_named_by_it():
    table = contrasts()
    same = table[table["matching"] == "same case"]
    averages, cases = same[same["step_kN"].isna()], same[same["step_kN"].notna()].drop_duplicates("parameter")
    without_loads = cases.assign(speed_km_h=25.0, initial_load_kN=np.nan, step_kN=np.nan)
    left, _ = contrasts_by_case(pd.concat([averages, without_loads]), MEASURED).get_axes()
    labels = [tick.get_text() for tick in left.get_yticklabels()]
    assert labels[1:] == ["average", "loading (25)"]


@pytest.mark.parametrize(
    ("p", "shown"), [(4000.5 / 4001, ">= 0.9998"), (0.5 / 4001, "<= 0.0002"), (0.994, "0.99"), (0.5, "0.50")]
)
def test_a_probability_that_only_rounds_to_one_does_not_claim_it(p, shown):
    texts = said(contrasts_by_case(contrasts().assign(p_greater_than_1=p), MEASURED))
    assert shown in texts
    assert "1.00" not in texts


def test_what_the_ratios_are_of_joins_the_note():
    figure = contrasts_by_case(contrasts(), MEASURED, "They are of something else.")
    assert any("They are of something else." in text for text in said(figure))


def test_nothing_that_matches_is_said():
    figure = contrasts_by_case(contrasts().iloc[:0], MEASURED)
    assert any("No two configurations or directions" in text for text in said(figure))
