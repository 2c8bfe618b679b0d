"""From a record table to a row a record: which points are used, what is fitted, and what the status says."""

import math

import numpy as np
import pandas as pd
import pytest
from simulated_records import Plan, simulate

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.record_fits import FitSettings, fit_records
from bayes_tyre.record import ORIGIN_UNKNOWN, WORDS, check_record_table

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

K, BETA, J, D_I, F_I = 1.6, 0.1, 0.4, 10.0, 14.0
NOISE_KN = 0.03
COLUMNS = [
    "record",
    "configuration",
    "direction",
    "speed_km_h",
    "initial_load_kN",
    "step_kN",
    "repeat",
    "k_kN_per_mm",
    "k_kN_per_mm_se",
    "C_kN",
    "C_kN_se",
    "beta_mm",
    "beta_mm_se",
    "d_i_mm",
    "d_i_mm_se",
    "F_i_kN",
    "F_i_kN_se",
    "rmse_kN",
    "points",
    "status",
    "origin",
]
NUMBERS = COLUMNS[7:18]
TOO_FEW = "too few points: {} for {} parameters"
NO_TRAVEL = "no travel: the displacement is constant"
FALLS = "force falls as displacement grows: check the signs"
UPPER_BOUND = "beta not determined: only an upper bound, it lies below the spacing of the first points"
LOWER_BOUND = "beta not determined: only a lower bound, beyond the travel it trades against k"
NOT_CONVERGED = "did not converge: give a --start nearer to the data, or fix a parameter"
TOO_LARGE = "numbers above 1e+100: too large to be squared, check the cells"


def record(
    points: int = 30,
    k: float = K,
    beta: float = BETA,
    J: float = J,
    travel: float = 3.0,
    noise_kN: float = NOISE_KN,
    seed: int = 3,
) -> pd.DataFrame:
    """A record of Equation 2 with noise on every point but the first, which d_i and F_i are taken from."""
    u = travel * (1 - np.cos(np.pi * np.linspace(0, 1, points))) / 2
    force = F_I + (np.sign(travel) * J + k * u) * -np.expm1(-np.abs(u) / beta)
    noise = np.random.default_rng(seed).normal(0.0, noise_kN, points) * (np.arange(points) > 0)
    return pd.DataFrame({"displacement_mm": D_I + u, "force_kN": force + noise})


def flattened(points: int = 30) -> pd.DataFrame:
    return record(points).assign(displacement_mm=D_I)


def with_force(row: int, force_kN: float) -> pd.DataFrame:
    spoilt = record()
    spoilt.loc[row, "force_kN"] = force_kN
    return spoilt


#: Of at most 32 points, so that all are of one batch and one compilation.
RECORDS = {
    "loading": record(),
    "unloading": record(travel=-3.0),
    "another": record(23, seed=4),
    "short": record(8, beta=0.8, noise_kN=0.003),
    "exact": record(31, noise_kN=0.0),
    "full": record(32),
    "five": record(5, beta=0.8, noise_kN=0.0),
    "one point": record(1),
    "three points": record(3),
    "no travel": flattened(),
    "falling loading": record(k=-K, J=-J),
    "falling unloading": record(k=-K, J=-J, travel=-3.0),
    # By chance the noise closes the profile of a beta far off in 1 record of 40: not in these.
    "tiny beta": record(beta=1e-6, seed=5),
    "tiny beta exact": record(beta=1e-6, noise_kN=0.0),
    "huge beta": record(k=1600.0, beta=1e3),
    "huge beta unloading": record(k=1600.0, beta=1e3, travel=-3.0),
    "absurd force": with_force(12, 1e300),
    "absurd last force": with_force(29, -1e300),
    "absurd displacement": record() * [1e300, 1.0],
    "absurd both": record() * 1e300,
    "vanishing": record() * 1e-300,
    "absurd and ends meet": record().assign(force_kN=1.7e308 * (-1.0) ** np.arange(30)),
}
LONG = {"longest": record(60, noise_kN=0.0)}


def table_of(records: dict[str, pd.DataFrame]) -> pd.DataFrame:
    return check_record_table(pd.concat([points.assign(record=name) for name, points in records.items()]))


def by_record(fits: pd.DataFrame) -> pd.DataFrame:
    return fits.set_index("record", drop=False)


@pytest.fixture(scope="module")
def fits() -> pd.DataFrame:
    return by_record(fit_records(table_of(LONG | RECORDS)))


@pytest.fixture(scope="module")
def thesis() -> pd.DataFrame:
    return by_record(fit_records(table_of(RECORDS), FitSettings(region="thesis")))


@pytest.fixture(scope="module")
def fixed() -> pd.DataFrame:
    settings = FitSettings(fix={"beta": BETA, "d_i": D_I}, free=("F_i",))
    return by_record(fit_records(table_of(RECORDS), settings))


def test_every_record_has_one_row_in_the_order_of_the_table(fits):
    assert fits["record"].to_list() == [*LONG, *RECORDS]


def test_columns_are_those_of_the_contract(fits, thesis, fixed):
    assert list(fits.columns) == list(thesis.columns) == list(fixed.columns) == COLUMNS


def test_a_table_without_words_has_them_empty_and_no_origin(fits):
    assert (fits[list(WORDS)] == "").all(axis=None)
    assert (fits["origin"] == ORIGIN_UNKNOWN).all()


def test_words_and_origin_come_along_with_each_record():
    words = {"configuration": "single", "direction": "loading", "speed_km_h": 25.0, "initial_load_kN": 20.0}
    given = {name: {**words, "step_kN": 10.0, "repeat": i, "origin": "measured"} for i, name in enumerate(RECORDS)}
    given["loading"] |= {"configuration": "dual", "repeat": 7, "origin": "simulated"}
    fits = by_record(fit_records(table_of({n: RECORDS[n].assign(**given[n]) for n in RECORDS})))
    for name, row in given.items():
        assert fits.loc[name, list(row)].to_dict() == row
    assert fits["repeat"].dtype == np.int64


@pytest.mark.parametrize("name", ["loading", "unloading", "another", "short", "exact", "full", "five", "longest"])
def test_ragged_records_come_back_whatever_their_length(fits, name):
    row = fits.loc[name]
    points = (LONG | RECORDS)[name]
    beta = 0.8 if name in ("short", "five") else BETA
    assert row["status"] == "ok"
    assert row["points"] == len(points)
    assert row["d_i_mm"] == points["displacement_mm"].iloc[0]
    assert row["F_i_kN"] == points["force_kN"].iloc[0]
    # Within five standard errors (exact records: of rounding); by chance 1 time in 1e6 for normal errors.
    assert row["k_kN_per_mm"] == pytest.approx(K, abs=5 * row["k_kN_per_mm_se"])
    assert row["beta_mm"] == pytest.approx(beta, abs=5 * row["beta_mm_se"])
    if name in ("exact", "five", "longest"):
        assert row["k_kN_per_mm"] == pytest.approx(K, rel=1e-10)
        assert row["beta_mm"] == pytest.approx(beta, rel=1e-10)


def equation_2(d: np.ndarray, row: pd.Series) -> np.ndarray:
    line = row["k_kN_per_mm"] * d + row["C_kN"]
    return row["F_i_kN"] + (line - row["F_i_kN"]) * -np.expm1(-np.abs(d - row["d_i_mm"]) / row["beta_mm"])


@pytest.mark.parametrize("name", ["loading", "unloading", "short", "full", "falling loading", "huge beta"])
def test_rmse_is_the_root_of_rss_over_the_points_used(fits, thesis, name):
    for row in (fits.loc[name], thesis.loc[name]):
        d, F = RECORDS[name].iloc[: row["points"]].to_numpy().T
        rss = np.sum((F - equation_2(d, row)) ** 2)
        assert row["rmse_kN"] == pytest.approx(math.sqrt(rss / row["points"]), rel=1e-9)


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
        ("vanishing", NOT_CONVERGED),
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
        assert row[NUMBERS].isna().all()
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
    healed = by_record(fit_records(table_of(RECORDS | {name: record(seed=9) for name in bad})))
    assert (healed.loc[bad, "status"] == "ok").all()
    good = [name for name in RECORDS if name not in bad]
    pd.testing.assert_frame_equal(healed.loc[good, NUMBERS], fits.loc[good, NUMBERS], rtol=1e-12)
    assert healed.loc[good, "status"].to_list() == fits.loc[good, "status"].to_list()


def test_the_order_of_records_does_not_matter_nor_that_their_rows_interleave(fits):
    table = table_of(RECORDS)
    turn = table.groupby("record").cumcount()
    mixed = table.iloc[np.lexsort((table["record"], turn))].reset_index(drop=True)
    assert mixed["record"].iloc[:3].nunique() == 3
    again = by_record(fit_records(mixed)).loc[[*RECORDS]]
    pd.testing.assert_frame_equal(again, fits.loc[[*RECORDS]], rtol=1e-12)


def test_the_table_is_not_changed_and_progress_counts_every_record():
    table = table_of(RECORDS)
    before, done = table.copy(deep=True), []
    fit_records(table, on_progress=done.append)
    pd.testing.assert_frame_equal(table, before)
    assert sum(done) == len(RECORDS)


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
    again = by_record(fit_records(table_of(spoilt), FitSettings(region="thesis")))
    good = ["loading", "unloading", "short", "exact", "full", "five", "falling loading"]
    pd.testing.assert_frame_equal(again.loc[good], thesis.loc[good], rtol=1e-12)


def test_region_thesis_returns_exact_records(thesis):
    assert thesis.loc["exact", "k_kN_per_mm"] == pytest.approx(K, rel=1e-10)
    assert thesis.loc["exact", "beta_mm"] == pytest.approx(BETA, rel=1e-10)


def test_a_start_far_from_the_data_ends_where_the_data_s_own_does(fits):
    started = by_record(fit_records(table_of(RECORDS), FitSettings(start={"k": -50.0, "beta": 1e4})))
    good = ["loading", "unloading", "another", "short", "full", "falling loading"]
    off = (started.loc[good, ["k_kN_per_mm", "beta_mm"]] - fits.loc[good, ["k_kN_per_mm", "beta_mm"]]).abs().to_numpy()
    # To the precision of an optimum where the RSS is flat: a millionth of a standard error.
    assert np.all(off < 1e-6 * fits.loc[good, ["k_kN_per_mm_se", "beta_mm_se"]].to_numpy())
    assert started.loc[good, "status"].to_list() == fits.loc[good, "status"].to_list()


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
    assert fixed.loc["three points", "status"] == TOO_FEW.format(3, 3)
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
