"""Further columns of a record table go through to the tables of a fit."""

import pandas as pd
import pytest
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.record_table import check_record_table, record_extras
from bayes_tyre.results import summary

FACTORS = grid(("single",))


def table(**columns: list) -> pd.DataFrame:
    """Two points a record, with further columns given by point."""
    points = FACTORS[["record"]].loc[FACTORS.index.repeat(2)].reset_index(drop=True)
    return check_record_table(points.assign(displacement_mm=0.0, force_kN=1.0, **columns))


def test_numbers_are_averaged_over_a_record_and_text_that_varies_is_named_and_left_out():
    n = 2 * len(FACTORS)
    columns = {"pressure_bar": [7.25] * n, "temperature_C": list(range(n)), "operator": ["A"] * n}
    with pytest.warns(UserWarning, match="^column warning: text that varies within a record, left out"):
        extras = record_extras(table(**columns, warning=list("xy") * (n // 2)))
    assert extras.columns.tolist() == ["record", "pressure_bar", "temperature_C", "operator"]
    assert extras["record"].tolist() == FACTORS["record"].tolist()
    assert extras["temperature_C"].tolist() == [0.5 + 2 * i for i in range(len(FACTORS))]


def test_extras_stand_behind_the_figures_of_each_record_and_never_in_their_place():
    extras = record_extras(table(pressure_bar=[7.25] * 24, median=[1.0] * 24, verdict=["good"] * 24))
    tree = posterior(scattered(FACTORS, seed=1), FACTORS)
    plain, carried = summary.repeats(tree, "pass"), summary.repeats(tree, "pass", extras=extras)
    added = ["pressure_bar", "given_median", "given_verdict"]
    assert carried.columns.tolist() == [*plain.columns[:-2], *added, "origin", "verdict"]
    pd.testing.assert_frame_equal(carried.drop(columns=added), plain)
    assert set(carried["pressure_bar"]) == {7.25}
    assert set(carried["verdict"]) == {"pass"}
