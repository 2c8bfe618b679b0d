"""What to fit, from where: regions, starts, what is fixed and freed, and settings that cannot be."""

import numpy as np
import pandas as pd
import pytest
from helpers.odd_records import BETA, D_I, F_I, RECORDS, K, fitted
from helpers.simulated_records import Plan, simulate

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.least_squares.settings import FitSettings
from bayes_tyre.inference.least_squares.table import fit_records
from bayes_tyre.record_table import check_record_table

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


def test_fixed_parameters_keep_their_value_and_have_no_standard_error(fixed):
    fitted = fixed[fixed["status"] == "ok"]
    assert len(fitted) > 5
    assert (fitted["beta_mm"] == BETA).all()
    assert (fitted["d_i_mm"] == D_I).all()
    assert fixed[["beta_mm_se", "d_i_mm_se"]].isna().all(axis=None)


def test_parameters_not_freed_have_no_standard_error(fits):
    assert fits[["d_i_mm_se", "F_i_kN_se"]].isna().all(axis=None)


def test_a_freed_F_i_is_fitted(fixed):
    row, points = fixed.loc["loading"], RECORDS["loading"]
    assert row["F_i_kN"] != points["force_kN"].iloc[0]
    assert row["F_i_kN"] == pytest.approx(F_I, abs=5 * row["F_i_kN_se"])
    # With beta and d_i known, Equation 2 is a linear regression on these columns.
    d = points["displacement_mm"].to_numpy()
    gone = -np.expm1(-np.abs(d - D_I) / BETA)
    solution = np.linalg.lstsq(np.stack([d * gone, gone, 1 - gone], axis=1), points["force_kN"].to_numpy())[0]
    np.testing.assert_allclose(row[["k_kN_per_mm", "C_kN", "F_i_kN"]].to_numpy(dtype=float), solution, rtol=1e-7)


def test_points_are_counted_against_what_is_fitted(fixed):
    assert fixed.loc["three points", "status"] == "too few points: 3 for 3 parameters"
    assert FitSettings(fix={"beta": 1.0}).free_indices == (0, 1)
    assert FitSettings(free=("F_i", "d_i"), fix={"k": 1.0}).free_indices == (1, 2, 3, 4)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"region": "first"}, "region 'first' is unknown; use all or thesis"),
        ({"fix": {"K": 1.0}}, "parameter 'K' is unknown; use one of k, C, beta, d_i, F_i"),
        ({"free": ("x",)}, "parameter 'x' is unknown"),
        ({"start": {"": 1.0}}, "parameter '' is unknown"),
        ({"fix": {"k": np.nan}}, "k=nan: give a finite number"),
        ({"start": {"C": np.inf}}, "C=inf: give a finite number"),
        ({"fix": {"beta": 0.0}}, "beta=0.0: give a finite number, above 0"),
        ({"start": {"beta": -1.0}}, "beta=-1.0: give a finite number, above 0"),
        ({"fix": {"F_i": 1.0}, "free": ("F_i",)}, "F_i is fixed and also freed or started; choose one"),
        ({"fix": {"k": 1.0}, "start": {"k": 2.0}}, "k is fixed and also freed or started; choose one"),
        ({"start": {"d_i": 1.0}}, "d_i has a start but is not fitted; add --free d_i"),
        ({"bounds": {"K": (0.0, 1.0)}}, "parameter 'K' is unknown"),
        ({"bounds": {"k": (2.0, 1.0)}}, "k=2:1 leaves no room; give a LOW that is less than HIGH"),
        ({"bounds": {"k": (1.0, 1.0)}}, "k=1:1 leaves no room"),
        ({"bounds": {"C": (np.nan, 1.0)}}, "C=nan:1 leaves no room"),
        ({"bounds": {"C": (np.inf, np.inf)}}, "C=inf: leaves no room"),
        ({"bounds": {"C": (-np.inf, np.inf)}}, "C=: bounds neither side; give LOW, HIGH or both"),
        ({"bounds": {"beta": (-1.0, 0.0)}}, "beta=-1:0 excludes every beta, which is above 0; give a HIGH above 0"),
        ({"bounds": {"k": (1.0, 2.0)}, "start": {"k": 3.0}}, "k=1:2 excludes the start 3; give one inside"),
        ({"bounds": {"k": (1.0, np.inf)}, "start": {"k": 0.5}}, "k=1: excludes the start 0.5"),
        ({"bounds": {"k": (0.0, 2.0)}, "fix": {"k": 1.0}}, "k is fixed and also bounded; choose one"),
        ({"bounds": {"F_i": (0.0, 20.0)}}, "F_i has bounds but is not fitted; add --free F_i"),
        ({"fix": {"k": 1.0, "C": 1.0, "beta": 1.0}}, "every parameter is fixed; leave at least one to fit"),
    ],
)
def test_settings_that_cannot_be_are_refused_in_one_line(settings, said):
    with pytest.raises(BadInput) as caught:
        FitSettings(**settings)
    assert str(caught.value).startswith(said)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("region", ["all", "thesis"])
@pytest.mark.parametrize("name", ["k", "C", "beta"])
def test_a_fixed_parameter_is_what_was_given_in_either_region(region, name):
    table, truth = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=1), seed=6)
    d_i = table["displacement_mm"].iloc[0]
    values = {"k": truth["k"][0], "beta": truth["beta"][0], "C": truth["J"][0] + truth["F_i"][0] - truth["k"][0] * d_i}
    settings = FitSettings(region=region, fix={name: 1.01 * values[name]})
    row = fit_records(check_record_table(table), settings).iloc[0]
    column = {"k": "k_kN_per_mm", "C": "C_kN", "beta": "beta_mm"}[name]
    assert row[column] == 1.01 * values[name]
    assert np.isnan(row[f"{column}_se"])


def test_a_start_far_from_the_data_ends_where_the_data_s_own_does(fits):
    started = fitted(RECORDS, FitSettings(start={"k": -50.0, "beta": 1e4}))
    good = ["loading", "unloading", "another", "short", "full", "falling loading"]
    off = (started.loc[good, ["k_kN_per_mm", "beta_mm"]] - fits.loc[good, ["k_kN_per_mm", "beta_mm"]]).abs().to_numpy()
    # To the precision of an optimum where the RSS is flat: a millionth of a standard error.
    assert np.all(off < 1e-6 * fits.loc[good, ["k_kN_per_mm_se", "beta_mm_se"]].to_numpy())
    assert started.loc[good, "status"].to_list() == fits.loc[good, "status"].to_list()


def test_region_thesis_uses_the_first_seven_tenths_rounded_up(thesis):
    for name, points in RECORDS.items():
        assert thesis.loc[name, "points"] == -(-7 * len(points) // 10)
    assert thesis.loc["five", "status"] == "ok"
    assert thesis.loc[["short", "another"], "points"].to_list() == [6, 17]


def test_region_thesis_looks_at_no_point_behind(thesis):
    spoilt = {}
    for name, points in RECORDS.items():
        kept = -(-7 * len(points) // 10)
        spoilt[name] = pd.concat([points.iloc[:kept], 7.0 - points.iloc[kept:] / 3])
    again = fitted(spoilt, FitSettings(region="thesis"))
    good = ["loading", "unloading", "short", "exact", "full", "five", "falling loading"]
    pd.testing.assert_frame_equal(again.loc[good], thesis.loc[good], rtol=1e-12)


def test_region_thesis_returns_exact_records(thesis):
    assert thesis.loc["exact", "k_kN_per_mm"] == pytest.approx(K, rel=1e-10)
    assert thesis.loc["exact", "beta_mm"] == pytest.approx(BETA, rel=1e-10)


def test_bounds_hold_for_every_record_and_change_only_those_that_leave_them(fits):
    bounded = fitted(RECORDS, FitSettings(bounds={"k": (-np.inf, 1.603), "beta": (0.0, 0.5)}))
    assert bounded["k_kN_per_mm"].max() == 1.603
    assert bounded["beta_mm"].max() == 0.5
    inside = [name for name in RECORDS if fits.loc[name, "status"] == "ok" and bounded.loc[name, "status"] == "ok"]
    outside = [name for name in RECORDS if fits.loc[name, "k_kN_per_mm"] > 1.603]
    assert len(inside) >= 3
    assert len(outside) >= 3
    off = (bounded.loc[inside, ["k_kN_per_mm", "beta_mm"]] - fits.loc[inside, ["k_kN_per_mm", "beta_mm"]]).abs()
    assert np.all(off.to_numpy() < 1e-6 * fits.loc[inside, ["k_kN_per_mm_se", "beta_mm_se"]].to_numpy() + 1e-12)
    assert (bounded.loc[outside, "rmse_kN"] >= fits.loc[outside, "rmse_kN"]).all()


@pytest.mark.parametrize("region", ["all", "thesis"])
def test_bounds_hold_in_either_region_and_beside_a_start(region):
    settings = FitSettings(region=region, start={"beta": 0.2}, bounds={"beta": (0.15, 0.3), "k": (1.7, np.inf)})
    bounded = fitted(RECORDS, settings)
    numbers = bounded[bounded["beta_mm"].notna()]
    assert len(numbers) > 10
    assert numbers["beta_mm"].between(0.15, 0.3).all()
    assert (numbers["k_kN_per_mm"] >= 1.7).all()
