"""The tables of a posterior: the contract's columns, and statistics that numpy and ArviZ give too."""

from typing import Literal

import arviz as az
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered

from bayes_tyre.formats.tables.table_files import read_table, write_table
from bayes_tyre.inference.sampling.group_means import group_means
from bayes_tyre.published import tables
from bayes_tyre.results import summary

FACTORS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN"]
FIGURES = [
    *("parameter", "unit", "mean", "sd", "median", "lower", "upper", "interval"),
    *("mcse_mean", "ess_bulk", "ess_tail", "r_hat"),
]
UNITS = {"k": "kN/mm", "beta": "mm", "J": "kN", "C": "kN", "sigma": "kN"}


@pytest.fixture(scope="module")
def factor_table() -> pd.DataFrame:
    return grid()


@pytest.fixture(scope="module")
def tree(factor_table) -> xr.DataTree:
    return posterior(scattered(factor_table, seed=1), factor_table)


def printed_tree() -> xr.DataTree:
    printed = tables.case_means()
    draws = {"k_case": fixed(printed["k_kN_per_mm"]), "beta_case": fixed(printed["beta_mm"])}
    return posterior(draws, printed, origin="published")


def test_columns_are_those_of_the_contract(tree):
    apart = ["apart_probability", "origin", "verdict"]
    assert list(summary.cases(tree, "pass").columns) == [*FACTORS, *FIGURES, *apart]
    outliers = ["outlier_probability", "origin", "verdict"]
    assert list(summary.repeats(tree, "pass").columns) == ["record", *FACTORS, "repeat", *FIGURES, *outliers]
    said = ["contraction", "prior_sensitivity", "likelihood_sensitivity", "decided_by", "origin", "verdict"]
    assert list(summary.summary(tree, "pass").columns) == ["record", *FACTORS, "repeat", *FIGURES, *said]


def test_a_posterior_of_printed_tables_has_the_same_columns_and_no_repeats(tree):
    printed = printed_tree()
    for table in (summary.cases, summary.repeats, summary.summary):
        assert list(table(printed, "pass").columns) == list(table(tree, "pass").columns)
    assert summary.repeats(printed, "pass").empty
    assert len(summary.cases(printed, "pass")) == 96


@pytest.mark.parametrize("verdict", ["pass", "fail"])
def test_every_row_ends_with_the_verdict_and_says_where_its_numbers_come_from(tree, verdict):
    for table in (summary.cases, summary.repeats, summary.summary):
        made = table(tree, verdict)
        assert made.columns[-1] == "verdict"
        assert set(made["verdict"]) == {verdict}
        assert set(made["origin"]) == {"simulated"}


def test_a_case_has_k_and_beta_and_a_record_five_parameters_each_with_its_unit(tree, factor_table):
    cases, repeats = summary.cases(tree, "pass"), summary.repeats(tree, "pass")
    assert cases.groupby("parameter").size().to_dict() == {"k": 8, "beta": 8}
    assert repeats.groupby("parameter").size().to_dict() == dict.fromkeys(UNITS, len(factor_table))
    for table in (cases, repeats):
        assert dict(zip(table["parameter"], table["unit"], strict=True)) == {
            name: UNITS[name] for name in table["parameter"].unique()
        }


def test_a_row_carries_the_words_of_its_own_draws(tree, factor_table):
    posterior_of = tree["posterior"].to_dataset()
    repeats = summary.repeats(tree, "pass").query("parameter == 'beta'").reset_index(drop=True)
    of_record = {record: i for i, record in enumerate(posterior_of["record"].to_numpy())}
    for row in repeats.itertuples():
        mean = posterior_of["beta"][:, :, of_record[row.record]].to_numpy().mean()
        assert row.mean == pytest.approx(mean, rel=1e-12)
    pd.testing.assert_frame_equal(repeats[list(factor_table.columns)], factor_table, check_dtype=False)
    cases = summary.cases(tree, "pass").query("parameter == 'k'").set_index(FACTORS)["mean"]
    unique = factor_table[FACTORS].drop_duplicates().itertuples(index=False, name=None)
    for i, case in enumerate(unique):
        assert cases[case] == pytest.approx(posterior_of["k_case"][:, :, i].to_numpy().mean(), rel=1e-12)


@pytest.mark.parametrize("interval", [0.95, 0.5])
def test_statistics_are_those_of_numpy_and_arviz(interval):
    draws = np.random.default_rng(2).gamma(2.0, size=(3, 200, 2, 4)) + np.arange(4)
    table = summary.describe(xr.DataArray(draws, dims=("chain", "draw", "a", "b")), interval)
    assert len(table) == 8
    assert list(table.columns) == FIGURES[2:]
    assert (table["interval"] == interval).all()
    for row, index in zip(table.itertuples(), np.ndindex(2, 4), strict=True):
        one = draws[:, :, *index]
        tails = np.quantile(one, [(1 - interval) / 2, 0.5, (1 + interval) / 2])
        assert (row.mean, row.sd) == pytest.approx((one.mean(), one.std(ddof=1)), rel=1e-12)
        assert (row.lower, row.median, row.upper) == pytest.approx(tuple(tails), rel=1e-12)
        assert row.mcse_mean == pytest.approx(float(az.mcse(one, method="mean")), rel=1e-9)
        assert row.ess_bulk == pytest.approx(float(az.ess(one, method="bulk")), rel=1e-9)
        assert row.ess_tail == pytest.approx(float(az.ess(one, method="tail", prob=(0.05, 0.95))), rel=1e-9)
        assert row.r_hat == pytest.approx(float(az.rhat(one)), rel=1e-9)


def test_statistics_do_not_depend_on_the_order_of_the_dimensions():
    draws = xr.DataArray(np.random.default_rng(3).normal(size=(2, 100, 5)), dims=("chain", "draw", "case"))
    pd.testing.assert_frame_equal(
        summary.describe(draws.transpose("case", "draw", "chain")), summary.describe(draws), check_exact=True
    )


def test_the_effective_draws_of_independent_ones_are_their_number_and_the_error_follows():
    draws = xr.DataArray(np.random.default_rng(4).normal(size=(4, 2000)), dims=("chain", "draw"))
    row = summary.describe(draws).iloc[0]
    assert row["ess_bulk"] == pytest.approx(8000, rel=0.1)
    assert row["mcse_mean"] == pytest.approx(1 / np.sqrt(8000), rel=0.1)
    assert row["r_hat"] == pytest.approx(1.0, abs=0.005)


def test_one_chain_has_no_r_hat():
    draws = xr.DataArray(np.random.default_rng(5).normal(size=(1, 100, 3)), dims=("chain", "draw", "case"))
    table = summary.describe(draws)
    assert table["r_hat"].isna().all()
    assert table.drop(columns="r_hat").notna().all(axis=None)


def test_what_never_varies_has_no_r_hat_and_no_warning():
    row = summary.describe(xr.DataArray(fixed(1.0, 2, 50), dims=("chain", "draw"))).iloc[0]
    assert (row["mean"], row["sd"], row["lower"], row["upper"]) == (1.0, 0.0, 1.0, 1.0)
    assert np.isnan(row["r_hat"])


def test_the_outlier_probability_is_the_mean_over_draws_and_the_same_for_every_parameter(tree, factor_table):
    expected = tree["posterior"]["outlier_probability"].mean(("chain", "draw")).to_numpy()
    repeats = summary.repeats(tree, "pass")
    for _, rows in repeats.groupby("parameter"):
        np.testing.assert_allclose(rows["outlier_probability"], expected, rtol=1e-12)


def test_the_outlier_probability_is_empty_for_cases_of_fewer_than_three_repeats(tmp_path):
    factor_table = pd.concat([grid(("single",), repeats=3), grid(("dual",), repeats=2)], ignore_index=True)
    repeats = summary.repeats(posterior(scattered(factor_table, seed=6), factor_table), "pass")
    write_table(repeats, tmp_path / "repeats.csv")
    written = pd.read_csv(tmp_path / "repeats.csv", dtype=str, keep_default_na=False)
    for configuration, empty in (("single", False), ("dual", True)):
        cells = written.loc[written["configuration"] == configuration, "outlier_probability"]
        assert len(cells) > 0
        assert ((cells == "") == empty).all()


def test_the_probability_to_stand_apart_is_the_mean_over_draws_and_empty_for_cases_of_one_repeat(factor_table):
    cases = len(factor_table) // 3
    drawn = np.random.default_rng(0).uniform(size=(2, 50, cases))
    for repeats, factors in ((3, factor_table), (1, factor_table[factor_table["repeat"] == 1].reset_index(drop=True))):
        table = summary.cases(posterior(scattered(factors, seed=1) | {"k_apart_probability": drawn}, factors), "pass")
        k, beta = (table.loc[table["parameter"] == name, "apart_probability"] for name in ("k", "beta"))
        assert beta.isna().all()
        if repeats == 1:
            assert k.isna().all()
        else:
            np.testing.assert_allclose(k, drawn.mean(axis=(0, 1)))


def test_three_records_of_two_cases_are_not_three_repeats():
    factor_table = grid(("single",), repeats=3)
    factor_table["speed_km_h"] = factor_table["repeat"].map({1: 0.0, 2: 0.0, 3: 25.0})
    factor_table = factor_table.drop_duplicates(["record"])[: len(factor_table) // 2]
    assert factor_table.groupby(FACTORS).size().max() == 2
    assert summary.outlier_probability(posterior(scattered(factor_table, seed=7), factor_table)).isna().all()


@pytest.mark.parametrize("kept", [[], ["direction"], ["configuration", "speed_km_h"], ["initial_load_kN", "step_kN"]])
def test_missing_words_stay_empty_and_repeats_are_still_counted(kept):
    factor_table = grid(("single",), repeats=3)[["record", *kept]]
    made = posterior(scattered(factor_table, seed=8), factor_table)
    repeats = summary.repeats(made, "pass")
    missing = [word for word in (*FACTORS, "repeat") if word not in kept]
    assert repeats[missing].isna().all(axis=None)
    assert repeats[["record", *kept]].notna().all(axis=None)
    assert repeats["outlier_probability"].notna().all()
    assert len(summary.cases(made, "pass")) == 2 * (len(factor_table[kept].drop_duplicates()) if kept else 1)
    assert summary.summary(made, "pass")[FIGURES[2:]].notna().all(axis=None)


def test_the_summary_has_a_row_for_every_scalar_and_names_levels(tree):
    table = summary.summary(tree, "pass")
    sizes = {name: one[0, 0].size for name, one in tree["posterior"].data_vars.items()}
    named = table["parameter"].str.replace(r"\[.*\]", "", regex=True).value_counts().to_dict()
    assert named == {**sizes, "k_mean": 4, "beta_mean": 4}
    assert {"log_k_speed[0]", "log_k_speed[25]", "k_group[dual loading]", "sigma_typical"} <= set(table["parameter"])
    assert not table.duplicated(["record", *FACTORS, "parameter"]).any()


def test_the_summary_has_no_row_for_what_is_zero_by_construction_but_one_for_what_does_not_vary():
    printed = tables.case_means()
    effects = [0.1, -0.1, -0.1, 0.1, 1e-17]  # loading 10, loading 5, unloading 10, unloading 5, unloading 7
    draws = {"k_case": fixed(printed["k_kN_per_mm"]), "beta_case": fixed(printed["beta_mm"])}
    draws |= {"log_beta_direction_step": fixed(effects), "log_k_speed": fixed([0.2, 0.0, -0.1, -0.1])}
    made = posterior(draws, printed, origin="published")
    table = summary.summary(made, "pass")
    rows = table[table["parameter"].str.contains("direction_step")]
    names = ("loading 10", "loading 5", "unloading 10", "unloading 5")
    assert rows["parameter"].tolist() == [f"log_beta_direction_step[{name}]" for name in names]
    np.testing.assert_allclose(rows["mean"], effects[:4], rtol=1e-12)
    assert "log_k_speed[15]" in set(table["parameter"])  # zero in every draw, but a coordinate of its own
    assert "unloading 7" not in made["posterior"]["direction_step"]


def test_the_summary_gives_units_and_leaves_pure_numbers_without(tree):
    units = summary.summary(tree, "pass").set_index("parameter")["unit"].to_dict()
    expected = {"k": "kN/mm", "beta_case": "mm", "k_group[dual loading]": "kN/mm", "beta_mean": "mm", "sigma": "kN"}
    expected |= dict.fromkeys(("sd_log_k_case", "log_k_speed[25]", "outlier_probability"), "")
    assert {name: units[name] for name in expected} == expected


def test_means_over_cases_are_the_printed_averages_of_tables_9_and_11():
    table = summary.summary(printed_tree(), "pass").set_index(["configuration", "direction"])
    columns: dict[str, Literal["k_kN_per_mm", "beta_mm"]] = {"k_mean": "k_kN_per_mm", "beta_mean": "beta_mm"}
    for parameter, column in columns.items():
        printed = tables.means(column).set_index(["configuration", "direction"])
        off = (table.loc[table["parameter"] == parameter, "mean"] - printed[column]).abs()
        assert len(off) == 4
        assert (off - printed["half_digit"] <= 0).all()


def test_means_over_cases_are_taken_draw_by_draw(tree, factor_table):
    means = group_means(tree)
    cases = factor_table[FACTORS].drop_duplicates().reset_index(drop=True)
    assert means["k"].dims == ("chain", "draw", "group")
    for i in range(means.sizes["group"]):
        mine = (cases["configuration"] == str(means["configuration"].to_numpy()[i])) & (
            cases["direction"] == str(means["direction"].to_numpy()[i])
        )
        assert mine.sum() == 2
        expected = tree["posterior"]["beta_case"].to_numpy()[:, :, mine].mean(axis=2)
        np.testing.assert_allclose(means["beta"].to_numpy()[:, :, i], expected, rtol=1e-12)


def test_numbers_are_written_unrounded(tree, tmp_path):
    cases = summary.cases(tree, "pass")
    write_table(cases, tmp_path / "cases.csv")
    read = read_table(tmp_path / "cases.csv")
    np.testing.assert_array_equal(read["mean"], cases["mean"])
    np.testing.assert_array_equal(read["r_hat"], cases["r_hat"])
