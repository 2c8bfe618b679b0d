"""What the status says of a record, and that one bad record stops no other."""

import re

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from helpers.odd_records import BETA, D_I, F_I, RECORDS, J, K, fitted, record, table_of

from bayes_tyre.batch import batches
from bayes_tyre.inference.least_squares.estimate import Estimate
from bayes_tyre.inference.least_squares.settings import FitSettings
from bayes_tyre.inference.least_squares.status import status, unfittable
from bayes_tyre.inference.least_squares.table import NUMBERS

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

TOO_FEW = "too few points: {} for {} parameters"
NO_TRAVEL = "no travel: the displacement is constant"
FALLS = "force falls as displacement grows: check the signs"
UPPER_BOUND = "beta not determined: only an upper bound, it lies below the spacing of the first points"
LOWER_BOUND = "beta not determined: only a lower bound, beyond the travel it trades against k"
TURNS_BACK = "displacement turns back: Equation 2 holds for one direction, cut the record there"
NOT_CONVERGED = "did not converge: give a --start nearer to the data, or fix a parameter"
TOO_LARGE = "numbers above 1e+100: too large to be squared, check the cells"


@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("one point", TOO_FEW.format(1, 3)),
        ("three points", TOO_FEW.format(3, 3)),
        ("no travel", NO_TRAVEL),
        ("falling loading", FALLS),
        ("falling unloading", FALLS),
        ("tiny beta", UPPER_BOUND),
        ("tiny beta exact", UPPER_BOUND),
        ("huge beta", LOWER_BOUND),
        ("huge beta unloading", LOWER_BOUND),
        ("absurd force", TOO_LARGE),
        ("absurd last force", TOO_LARGE),
        ("absurd displacement", TOO_LARGE),
        ("absurd both", TOO_LARGE),
        ("absurd and ends meet", TOO_LARGE),
        ("vanishing", "changes below 1e-100: too small to be squared, check the cells"),
    ],
)
def test_status_says_what_a_record_cannot_give(fits, name, status):
    assert fits.loc[name, "status"] == status


@pytest.mark.parametrize(
    "name", ["one point", "three points", "no travel", "absurd force", "absurd displacement", "vanishing"]
)
def test_a_record_that_cannot_be_fitted_has_no_numbers(fits, thesis, name):
    for row in (fits.loc[name], thesis.loc[name]):
        assert row["status"] != "ok"
        assert row[[*NUMBERS, "rmse_kN"]].isna().all()
        assert row["points"] > 0


def test_no_number_is_infinite(fits, thesis, fixed):
    for table in (fits, thesis, fixed):
        assert not np.isinf(table[NUMBERS].to_numpy(dtype=float)).any()


def test_k_is_still_good_where_beta_is_only_bounded_above(fits):
    row = fits.loc["tiny beta"]
    assert row["k_kN_per_mm"] == pytest.approx(K, abs=5 * row["k_kN_per_mm_se"])


def test_a_bad_record_leaves_its_neighbours_as_they_are(fits):
    # Good records in place of the bad ones: the batch keeps its shape, so that even rounding stays the same.
    bad = [name for name in RECORDS if name.startswith(("absurd", "vanishing", "no travel", "one", "three"))]
    healed = fitted(RECORDS | {name: record(seed=9) for name in bad})
    assert (healed.loc[bad, "status"] == "ok").all()
    good = [name for name in RECORDS if name not in bad]
    pd.testing.assert_frame_equal(healed.loc[good, NUMBERS], fits.loc[good, NUMBERS], rtol=1e-12)
    assert healed.loc[good, "status"].to_list() == fits.loc[good, "status"].to_list()


def test_a_fit_that_did_not_converge_is_said_and_a_lost_parameter_is_named():
    names = ["lost", "not there", "fine", "wide"]
    (batch,) = batches(table_of({name: record(seed=seed) for seed, name in enumerate(names)}))
    none, ones = jnp.zeros(4, bool), jnp.ones((4, 5))
    true = jnp.broadcast_to(jnp.array([K, J + F_I - K * D_I, BETA, D_I, F_I]), (4, 5))
    lost, errors = jnp.zeros((4, 5), bool).at[0, :2].set(True), (0.05 * ones).at[3].set(1.0)
    estimate = Estimate(true, errors, ones[:, 0], lost & False, lost, none, none, jnp.array([True, False, True, True]))
    said = status(
        batch,
        batch.present,
        estimate,
        np.full((2, 5), np.inf),
        unfittable(batch, batch.present, 3),
        FitSettings().free_indices,
    )
    weak = "beta weakly identified: its standard error is as large as itself"
    assert said.tolist() == ["k, C not determined by this record", NOT_CONVERGED, "ok", weak]


def test_a_parameter_on_its_bound_is_said_and_has_no_standard_error(fits):
    bounded = fitted(RECORDS, FitSettings(bounds={"k": (-np.inf, 1.5)}))
    assert bounded.loc["loading", "status"] == "k at its bound 1.5"
    assert bounded.loc["loading", "k_kN_per_mm"] == 1.5
    errors = bounded.loc[["loading"], ["k_kN_per_mm_se", "C_kN_se", "beta_mm_se"]].to_numpy()
    assert np.isnan(errors).tolist() == [[True, False, False]]
    both = fitted(RECORDS, FitSettings(bounds={"k": (-np.inf, 1.5), "C": (-np.inf, -0.6)}))
    assert both.loc["loading", "status"] == "k at its bound 1.5; C at its bound -0.6"
    assert fits.loc[["loading", "unloading"], "status"].to_list() == ["ok", "ok"]


def test_a_beta_on_its_bound_may_also_be_open_to_the_other_side():
    bounded = fitted(RECORDS, FitSettings(bounds={"beta": (0.25, np.inf)}))
    assert bounded.loc["loading", "status"] == "beta at its bound 0.25"
    assert bounded["status"].str.endswith(LOWER_BOUND)["constant force"]
    assert not bounded["status"].str.contains(UPPER_BOUND, regex=False).any()


@pytest.mark.parametrize("fix", [{"beta": 20 * BETA}, {"k": K / 2}])
def test_a_curve_that_a_fixed_value_keeps_from_its_record_is_said(fix):
    row = fitted({"one": record(60, noise_kN=0.0)}, FitSettings(fix=fix)).iloc[0]
    assert row["status"].startswith("the curve is not Equation 2")


def test_beta_below_the_spacing_is_only_bounded_with_a_free_d_i_too():
    """A d_i fitted beside a point would take the point off the start of a curve of small beta."""
    records = {str(seed): record(32, beta=1e-4, seed=seed) for seed in range(20)}
    found = fitted(records, FitSettings(free=("d_i",)))
    # By chance noise closes the profile of a beta far off in 1 record of 40: more than three of 20 in 1e-3 of seeds.
    assert (found["status"] == "ok").sum() <= 3


def test_noise_and_overshoot_do_not_turn_a_record_back():
    noisy = record(32)
    noisy["displacement_mm"] += np.random.default_rng(2).normal(0, 0.1, 32)
    overshoot = record(32)
    overshoot.loc[27:, "displacement_mm"] -= 0.5
    found = fitted({"noisy": noisy, "overshoot": overshoot, "back": pd.concat([record(20), record(20).iloc[:8:-1]])})
    assert (found["status"] == TURNS_BACK).to_list() == [False, False, True]


def smoothed(points: pd.DataFrame, window: int) -> pd.DataFrame:
    """The record after a moving average of force and displacement, without the points that it would reach beyond."""
    weights = np.full(window, 1 / window)
    return points.apply(lambda signal: np.convolve(signal, weights, mode="valid")).reset_index(drop=True)


def following(points: int, rho: float, seed: int) -> np.ndarray:
    """Noise of variance 1 whose lag-1 autocorrelation is `rho`."""
    noise = np.random.default_rng(seed).normal(size=points)
    for i in range(1, points):
        noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * noise[i]
    return noise


def test_residuals_that_follow_each_other_as_those_of_smoothed_signals_do_are_said():
    # Lag-1 of n residuals has standard error sqrt((1 - rho^2) / n): 0.95 is 30 of them above 0, and 7 above 0.8.
    white, few = record(1000, beta=0.3), record(40, beta=0.3, noise_kN=0.0)
    ar1 = record(1000, beta=0.3, noise_kN=0.0)
    ar1["force_kN"] += 0.03 * following(1000, 0.8, seed=6) * (np.arange(1000) > 0)
    few["force_kN"] += 0.03 * np.sin(np.linspace(0, 6, 40))
    found = fitted(
        {"white": white, "smoothed": smoothed(white, 81), "ar1": ar1, "few": few, "exact": record(60, noise_kN=0.0)}
    )
    assert found.drop("smoothed")["status"].eq("ok").all()
    assert re.fullmatch(
        r"residuals follow each other \(lag-1 0\.9[5-9]\d\): signals look smoothed, or the curve is not Equation 2; "
        "beta then reflects the filter, not the tyre",
        str(found.loc["smoothed", "status"]),
    )
    bounded = fitted({"smoothed": smoothed(white, 81)}, FitSettings(fix={"beta": 0.3}))
    assert bounded.loc["smoothed", "status"] == "ok"


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_status_is_the_same_on_any_scale(scale, fits):
    usual = [name for name in RECORDS if "absurd" not in name and "vanishing" not in name]
    scaled = fitted({name: RECORDS[name] * [scale, 1 / scale] for name in usual})
    assert scaled["status"].to_list() == fits.loc[usual, "status"].to_list()
