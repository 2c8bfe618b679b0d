"""One stiffness from slow tests and step records: weights, spread, tension, and which rows meet."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.inference.load_deflection.pooled_stiffness import shared_stiffness, weighted_mean


def estimates(k, se, **factor_table) -> pd.DataFrame:
    return pd.DataFrame({"k_kN_per_mm": k, "k_kN_per_mm_se": se, **factor_table})


def test_the_combined_k_is_that_of_least_squares_with_one_k():
    row = shared_stiffness(estimates([1.5], [0.03]), estimates([1.56], [0.04])).iloc[0]
    assert row["k_kN_per_mm_combined"] == pytest.approx(np.average([1.5, 1.56], weights=[1 / 0.03**2, 1 / 0.04**2]))
    assert row["k_kN_per_mm_combined_se"] == pytest.approx((1 / 0.03**2 + 1 / 0.04**2) ** -0.5)
    assert row["tension"] == pytest.approx(0.06 / 0.05)
    assert row["status"] == "ok"


def test_repeats_that_scatter_more_than_their_errors_widen_it_and_others_do_not():
    mean, error = weighted_mean([1.4, 1.6], [0.01, 0.01])
    assert mean == pytest.approx(1.5)
    assert error == pytest.approx(0.1)  # standard deviation of the mean of the two
    assert weighted_mean([1.5, 1.5], [0.1, 0.1]) == pytest.approx((1.5, 0.1 / np.sqrt(2)))
    assert weighted_mean([1.5], [0.1]) == (1.5, 0.1)


def test_a_stiffness_below_0_is_a_wrong_sign_and_no_estimate():
    row = shared_stiffness(estimates([1.5], [0.1]), estimates([1.5, -12.0, 1.5], [0.1] * 3)).iloc[0]
    assert (row["k_kN_per_mm_steps"], row["steps"]) == (pytest.approx(1.5), 2)


def test_what_disagrees_is_said_with_its_sign():
    row = shared_stiffness(estimates([1.5], [0.03]), estimates([1.9], [0.04])).iloc[0]
    assert row["tension"] == pytest.approx(8)
    assert row["status"].startswith("they disagree by 8.0 standard errors, step records stiffer")


def test_rows_meet_by_the_words_that_both_tables_have_and_only_those_with_an_error_count():
    factor_table = {"configuration": ["single", "single", "dual"], "speed_km_h": [0, 25, 0]}
    tests = estimates([1.5, 1.6, 1.9], [0.1, 0.1, np.nan], **factor_table)
    steps = estimates([1.7, 1.8, 1.5], 0.1, configuration=["single", "single", "dual"], speed_km_h=["0.0", "0", "0"])
    both = shared_stiffness(tests, steps)
    assert both[["configuration", "speed_km_h", "tests", "steps"]].to_numpy().tolist() == [["single", 0.0, 1, 2]]
    nowhere = shared_stiffness(tests, steps.assign(configuration="other"))
    assert nowhere.empty
    assert list(nowhere.columns) == list(both.columns)
    unnamed = shared_stiffness(tests, steps.assign(configuration="", speed_km_h=""))
    assert unnamed[["tests", "steps"]].to_numpy().tolist() == [[2, 3]]
