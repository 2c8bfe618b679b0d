"""The reconstructed campaign gives back the printed numbers, and ceases to when its records lose their digits."""

import numpy as np
import pandas as pd
import pytest
from scipy import optimize, stats

from bayes_tyre.embedded import data_path
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.inference.least_squares.settings import REGIONS, FitSettings
from bayes_tyre.inference.least_squares.table import fit_records
from bayes_tyre.published import tables
from bayes_tyre.published.campaign import (
    FIRST_PART,
    NOISE_KN,
    ORDINARY_WITHIN,
    SD_BETA_OVER_K,
    Reconstruction,
    case_means,
    left_out,
    reconstruct,
    repeat_sd,
)
from bayes_tyre.published.checks import round_trip_rows
from bayes_tyre.record import CASE_FACTORS, FACTORS
from bayes_tyre.record_table import check_record_table
from bayes_tyre.rig.axle import Rig, load_rig
from bayes_tyre.rig.geometry import flat_ground_force, sin_theta

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

NUMBERS = ["time_s", "displacement_mm", "force_kN"]


@pytest.fixture(scope="module")
def campaign() -> Reconstruction:
    return reconstruct()


@pytest.fixture(scope="module")
def truth(campaign) -> pd.DataFrame:
    return campaign.truth.set_index("record", drop=False)


@pytest.fixture(scope="module")
def fits(campaign) -> dict[str, pd.DataFrame]:
    """All 288 fits: 144 records over all points, and over the part that the source fits."""
    return {region: fit_records(campaign.records, FitSettings(region=region)) for region in REGIONS}


def test_there_are_three_repeats_of_every_published_case(campaign):
    repeats = campaign.truth.groupby([*CASE_FACTORS])["repeat"].agg(sorted)
    assert len(repeats) == 48
    assert (repeats.map(tuple) == (1, 2, 3)).all()
    published = tables.case_means()[[*CASE_FACTORS]]
    assert set(map(tuple, published.to_numpy())) == set(repeats.index)
    assert campaign.truth["record"].is_unique
    assert campaign.truth["record"].to_list() == campaign.records["record"].drop_duplicates().to_list()


def test_it_is_a_checked_record_table(campaign):
    pd.testing.assert_frame_equal(check_record_table(campaign.records)[NUMBERS], campaign.records[NUMBERS])
    assert list(campaign.records.columns) == ["record", *FACTORS, *NUMBERS, "origin"]
    assert campaign.records.groupby("record").size().between(225, 255).all()
    factors = campaign.records.drop_duplicates("record").set_index("record")[[*FACTORS]]
    pd.testing.assert_frame_equal(factors, campaign.truth.set_index("record")[[*FACTORS]])


def test_every_row_says_reconstructed(campaign, fits):
    for table in (campaign.records, campaign.truth, *fits.values()):
        assert (table["origin"] == "reconstructed").all()


def test_it_is_the_same_every_time(campaign):
    again = reconstruct()
    pd.testing.assert_frame_equal(again.records, campaign.records, check_exact=True)
    pd.testing.assert_frame_equal(again.truth, campaign.truth, check_exact=True)


def test_another_seed_gives_other_records_with_the_same_means(campaign):
    other = reconstruct(seed=1)
    assert len(other.truth) == 144
    assert (other.truth["k_kN_per_mm"] != campaign.truth["k_kN_per_mm"]).all()
    assert round_trip_rows(case_means(other.truth))["agrees"].all()


def test_the_committed_file_is_what_the_code_gives(campaign):
    committed = check_record_table(read_table(data_path("campaign/records.csv")))
    expect_same(committed, campaign.records, tolerance=2e-9)


def test_the_committed_truth_is_what_the_code_gives(campaign):
    expect_same(read_table(data_path("campaign/records_truth.csv")), campaign.truth, tolerance=2e-9)


def expect_same(committed: pd.DataFrame, made: pd.DataFrame, tolerance: float) -> None:
    """Text exactly; numbers within a few units of the last decimal, where machines may round apart."""
    assert list(committed.columns) == list(made.columns)
    assert len(committed) == len(made)
    for column in made:
        if pd.api.types.is_float_dtype(made[column]):
            np.testing.assert_allclose(committed[column], made[column], rtol=0, atol=tolerance, err_msg=str(column))
        else:
            assert (committed[column].to_numpy() == made[column].to_numpy()).all(), column


def test_the_rule_finds_exactly_the_discordant_repeats(truth, fits):
    for table in (truth, *(fit.set_index("record", drop=False) for fit in fits.values())):
        means = case_means(table)
        found = {(*row[:5], row[5]) for row in means[[*CASE_FACTORS, "left_out"]].dropna().to_numpy()}
        discordant = truth.loc[truth["discordant"], [*CASE_FACTORS, "repeat"]]
        assert found == set(map(tuple, discordant.to_numpy()))


def test_six_repeats_are_discordant_all_standing_and_shifted_by_thirty_percent_at_least(truth):
    discordant = truth[truth["discordant"]]
    assert len(discordant) == 6
    assert (discordant["speed_km_h"] == 0).all()
    assert not discordant.duplicated([*CASE_FACTORS]).any()
    for parameter in ("k_kN_per_mm", "beta_mm"):
        printed = discordant.merge(tables.case_means(), on=[*CASE_FACTORS], suffixes=("", "_printed"))
        shift = printed[parameter] / printed[f"{parameter}_printed"] - 1
        assert (shift.abs() >= 0.30 - 1e-12).all()


def test_kept_repeats_average_to_the_printed_values(truth):
    kept = truth[~truth["discordant"]].groupby([*CASE_FACTORS])[["k_kN_per_mm", "beta_mm"]].mean().reset_index()
    both = tables.case_means().merge(kept, on=[*CASE_FACTORS], suffixes=("", "_kept"), validate="one_to_one")
    assert len(both) == 48
    for parameter in ("k_kN_per_mm", "beta_mm"):
        np.testing.assert_allclose(both[f"{parameter}_kept"], both[parameter], rtol=1e-12)


@pytest.mark.parametrize(("parameter", "factor"), [("k_kN_per_mm", 1.0), ("beta_mm", SD_BETA_OVER_K)])
@pytest.mark.parametrize("standing", [True, False])
def test_kept_repeats_scatter_as_stated(truth, parameter, factor, standing):
    kept = truth[~truth["discordant"] & ((truth["speed_km_h"] == 0) == standing)]
    cases = kept.groupby([*CASE_FACTORS])[parameter]
    repeats = cases.transform("size")
    # Deviations from the mean of n repeats are stretched by n / (n - 1) in the square, and cut where they are rare.
    square = (kept[parameter] / cases.transform("mean") - 1) ** 2 * (repeats - 1) / repeats
    stated = factor * repeat_sd(0.0 if standing else 25.0)
    stated *= stats.truncnorm.std(-ORDINARY_WITHIN, ORDINARY_WITHIN)
    # By chance less than 1 time in 1000 (normal deviations; those that are cut scatter less).
    low, high = stats.chi2.interval(1 - 1e-3, len(kept) - len(cases))
    assert low < square.sum() / stated**2 < high


@pytest.mark.parametrize("region", REGIONS)
def test_every_fit_returns_the_truth(truth, fits, region):
    fit = fits[region].set_index("record").loc[truth.index]
    assert len(fit) == 144
    assert (fit["status"] == "ok").all()
    for parameter in ("k_kN_per_mm", "beta_mm"):
        np.testing.assert_allclose(fit[parameter], truth[parameter], rtol=1e-7)


def test_case_means_give_the_printed_numbers(fits):
    rows = round_trip_rows(case_means(fits["thesis"]))
    assert len(rows) == 124
    assert rows.loc[~rows["agrees"], "quantity"].to_list() == []


def test_four_decimals_lose_the_printed_digits(campaign):
    rounded = campaign.records.round(dict.fromkeys(NUMBERS, 4))
    rows = round_trip_rows(case_means(fit_records(rounded, FitSettings(region="thesis"))))
    assert not rows["agrees"].all()


def test_without_the_rule_the_printed_means_do_not_come_back(truth):
    plain = truth.groupby([*CASE_FACTORS])[["k_kN_per_mm", "beta_mm"]].mean().reset_index()
    rows = round_trip_rows(plain)
    cells = rows[rows["quantity"].str.startswith("k (kN/mm)")]
    assert (~cells["agrees"]).sum() == 6


@pytest.fixture(scope="module")
def noise(campaign, truth) -> dict[str, np.ndarray]:
    """Force less Equation 2 at the truth, by record."""
    residuals = {}
    for name, record in campaign.records.groupby("record", sort=False):
        k, c, beta, d_i, F_i = truth.loc[str(name), ["k_kN_per_mm", "C_kN", "beta_mm", "d_i_mm", "F_i_kN"]].astype(
            float
        )
        d = record["displacement_mm"].to_numpy()
        model = F_i + (k * d + c - F_i) * -np.expm1(-np.abs(d - d_i) / beta)
        residuals[str(name)] = record["force_kN"].to_numpy() - model
    return residuals


def test_the_first_point_has_no_noise_and_is_d_i_and_F_i(campaign, truth, noise):
    first = campaign.records.drop_duplicates("record").set_index("record")
    np.testing.assert_array_equal(first["displacement_mm"], truth["d_i_mm"])
    np.testing.assert_array_equal(first["force_kN"], truth["F_i_kN"])
    assert max(abs(residual[0]) for residual in noise.values()) < 1e-12


@pytest.mark.parametrize("part", ["first", "rest"])
def test_noise_has_the_size_that_is_stated(noise, part):
    total, fewest, most = 0.0, 0, 0
    for residual in noise.values():
        end = int(np.ceil(FIRST_PART * len(residual)))
        points = residual[1:end] if part == "first" else residual[end:]
        total += np.sum((points / NOISE_KN) ** 2)
        # At most five tangents are taken out, and at least k's and C's.
        fewest, most = fewest + len(points) - 5, most + len(points) - 2
    # By chance 1 time in 1e5: the sum is chi-squared, with degrees of freedom between these.
    assert stats.chi2.ppf(5e-6, fewest) < total < stats.chi2.isf(5e-6, most)


def test_displacement_is_a_cosine_ramp_in_time(campaign):
    for _, record in campaign.records.groupby("record"):
        d, t = record["displacement_mm"].to_numpy(), record["time_s"].to_numpy()
        ramp = (1 - np.cos(np.pi * t / t[-1])) / 2
        np.testing.assert_allclose(d, d[0] + (d[-1] - d[0]) * ramp, rtol=0, atol=2e-9)
        assert np.sign(d[-1] - d[0]) == np.sign(record["step_kN"].iloc[0])


def test_the_start_is_the_rig_s_geometry_with_the_axle_s_load_in_it(truth):
    for row in truth.drop_duplicates([*CASE_FACTORS]).to_dict("records"):
        rig = load_rig(row["configuration"])
        lever = rig.axle.support_to_load_mm / rig.axle.support_to_wheel_centre_mm
        on_tyre = row["initial_load_kN"] * lever + rig.axle.axle_load_kN
        # Eq. 7 solved for the displacement of the wheel centre by bracketing.
        d_wc = optimize.root_scalar(flat_less, args=(rig, row["d_i_mm"]), bracket=(0.0, 60.0)).root
        assert row["F_i_kN"] == pytest.approx(float(flat_ground_force(rig, on_tyre, d_wc)), rel=1e-8)
        tests = tables.tests_stiffness(row["configuration"], row["direction"], row["speed_km_h"])
        assert row["F_i_kN"] / row["d_i_mm"] == pytest.approx(tests, rel=1e-8)


def flat_less(wheel_centre_mm: float, rig: Rig, less_mm: float) -> float:
    return float(wheel_centre_mm * sin_theta(rig, wheel_centre_mm)) - less_mm


def test_the_offset_is_four_tenths_of_a_kilonewton_in_the_direction_of_the_step(truth):
    size = truth["J_kN"] * np.sign(truth["step_kN"])
    assert (size > 0).all()
    # 144 sizes scatter by 10 %: their mean leaves 3.9 standard errors 1 time in 1e4.
    assert size.mean() == pytest.approx(0.4, abs=3.9 * 0.04 / np.sqrt(144))
    np.testing.assert_allclose(
        truth["C_kN"], truth["J_kN"] + truth["F_i_kN"] - truth["k_kN_per_mm"] * truth["d_i_mm"], atol=1e-12
    )


@pytest.mark.parametrize(
    ("k", "expected"),
    [
        ([1.0, 1.0, 1.0], [False, False, False]),
        ([1.0, 1.01, 1.5], [False, False, True]),
        ([0.5, 1.0, 1.02], [True, False, False]),
        ([1.0, 1.25, 1.0], [False, True, False]),  # 25 % off the others, above 6 times 4 %
        ([1.0, 1.23, 1.0], [False, False, False]),  # 23 %, below
        ([1.0, 1.7, 3.0], [False, False, True]),  # one at most: the most distant
        ([1.0, 5.0], [False, False]),  # of two, neither
        ([1.0], [False]),
    ],
)
def test_the_rule_leaves_out_at_most_the_most_distant_repeat(k, expected):
    assert left_out(np.array(k), repeat_sd(0.0)).tolist() == expected


def test_case_means_say_which_repeat_is_left_out(truth):
    means = case_means(truth)
    assert list(means.columns) == [*CASE_FACTORS, "k_kN_per_mm", "beta_mm", "left_out"]
    assert means["left_out"].notna().sum() == 6
    assert means["left_out"].dropna().isin([1, 2, 3]).all()
