"""Ratios between cases: the printed tables reproduce, and a row stands only where cases match."""

from typing import Literal

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered

from bayes_tyre.inference.sampling.group_means import group_means
from bayes_tyre.published import tables
from bayes_tyre.results.contrasts import average_ratios, contrasts, with_reference

FACTORS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN"]
COLUMNS = [
    *("contrast", "matching", *FACTORS, "parameter"),
    *("median", "lower", "upper", "interval", "p_greater_than_1", "origin", "verdict"),
]
PRINTED: dict[str, Literal["k_kN_per_mm", "beta_mm"]] = {"k": "k_kN_per_mm", "beta": "beta_mm"}


def of_cases(table: pd.DataFrame) -> xr.DataTree:
    """Return a posterior that holds the k and beta of each case in every draw."""
    return posterior({"k_case": fixed(table["k_kN_per_mm"]), "beta_case": fixed(table["beta_mm"])}, table)


def numbered(factor_table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a case with values that no two ratios share."""
    cases = factor_table.drop(columns=["record", "repeat"], errors="ignore").drop_duplicates(ignore_index=True)
    return cases.assign(k_kN_per_mm=1.0 + np.sqrt(np.arange(len(cases))), beta_mm=np.geomspace(0.01, 0.3, len(cases)))


def medians(table: pd.DataFrame, contrast: str, matching: str, **factor_table: object) -> dict[str, float]:
    """Return the median by parameter of the row that holds just these words fixed."""
    rows = table[(table["contrast"] == contrast) & (table["matching"] == matching)]
    for word in FACTORS:
        rows = rows[rows[word] == factor_table[word]] if word in factor_table else rows[rows[word].isna()]
    assert not rows.duplicated("parameter").any()
    return dict(zip(rows["parameter"], rows["median"], strict=True))


def geometric(ratios: pd.Series) -> float:
    return float(np.exp(np.log(ratios).mean()))


@pytest.fixture(scope="module")
def published() -> pd.DataFrame:
    tree = of_cases(tables.case_means())
    tree.attrs["origin"] = "published"
    return contrasts(tree, "pass")


def test_columns_are_those_of_the_contract(published):
    assert list(published.columns) == COLUMNS
    assert list(contrasts(of_cases(numbered(grid(("one",), speeds=(0.0,)))[:1]), "pass").columns) == COLUMNS


@pytest.mark.parametrize("verdict", ["pass", "fail"])
def test_every_row_ends_with_the_verdict_and_says_where_its_numbers_come_from(verdict):
    factor_table = grid()
    table = contrasts(posterior(scattered(factor_table, seed=1), factor_table, origin="reconstructed"), verdict)
    assert set(table["verdict"]) == {verdict}
    assert set(table["origin"]) == {"reconstructed"}


def test_no_two_rows_say_the_same(published):
    assert not published.duplicated(["contrast", "matching", *FACTORS, "parameter"]).any()


@pytest.mark.parametrize(("matching", "beta"), [("same span", 1.86), ("same initial load", 0.71)])
def test_the_two_matchings_of_directions_disagree_as_the_printed_beta_does(published, matching, beta):
    row = medians(published, "loading / unloading", matching, configuration="single")
    assert row["beta"] == pytest.approx(beta, abs=0.005)


def test_the_pooled_comparison_is_the_ratio_of_the_printed_averages(published):
    for configuration in ("single", "dual"):
        row = medians(published, "loading / unloading", "pooled as published", configuration=configuration)
        for parameter, column in PRINTED.items():
            printed = tables.means(column).set_index(["configuration", "direction"])
            mean, half_digit = printed[column].to_dict(), printed["half_digit"].to_dict()
            up, down = (configuration, "loading"), (configuration, "unloading")
            table = tables.case_means().groupby(["configuration", "direction"])[column].mean().to_dict()
            assert row[parameter] == pytest.approx(table[up] / table[down], rel=1e-12)
            digits = half_digit[up] / mean[up] + half_digit[down] / mean[down]
            assert row[parameter] == pytest.approx(mean[up] / mean[down], rel=digits)
    single = medians(published, "loading / unloading", "pooled as published", configuration="single")
    assert single["k"] == pytest.approx(1.859 / 1.553, abs=1e-3)


def test_dual_is_held_against_single_in_all_24_cells_and_over_them(published):
    printed = tables.case_means().pivot(index=FACTORS[1:], columns="configuration", values=list(PRINTED.values()))
    assert len(printed) == 24
    for parameter, column in PRINTED.items():
        ratio = printed[column]["dual"] / printed[column]["single"]
        for factor_table, expected in ratio.items():
            of = dict(zip(FACTORS[1:], factor_table, strict=True))
            assert medians(published, "dual / single", "same case", **of)[parameter] == pytest.approx(expected)
        over_all = medians(published, "dual / single", "same case")[parameter]
        assert over_all == pytest.approx(geometric(ratio), rel=1e-12)
        for direction, cells in ratio.groupby(level="direction"):
            row = medians(published, "dual / single", "same case", direction=direction)
            assert row[parameter] == pytest.approx(geometric(cells), rel=1e-12)
    rows = published[published["contrast"] == "dual / single"]
    assert len(rows) == 2 * (1 + 2 + 24)


@pytest.mark.parametrize(("matching", "pairs"), [("same span", 4), ("same initial load", 10)])
def test_directions_are_matched_within_a_configuration_and_averaged_over_its_pairs(published, matching, pairs):
    rows = published.query("contrast == 'loading / unloading' and matching == @matching")
    singles = rows[rows["step_kN"].notna()]
    assert len(singles) == 2 * pairs
    assert len(rows) == 2 * (1 + 2 + pairs)
    assert singles["direction"].isna().all()
    for parameter in PRINTED:
        mine = singles[singles["parameter"] == parameter]
        over_all = medians(published, "loading / unloading", matching)[parameter]
        assert over_all == pytest.approx(geometric(mine["median"]), rel=1e-12)
        for configuration, few in mine.groupby("configuration"):
            row = medians(published, "loading / unloading", matching, configuration=configuration)
            assert row[parameter] == pytest.approx(geometric(few["median"]), rel=1e-12)


def test_a_span_is_the_same_two_loads_swapped_and_an_initial_load_the_same_start(published):
    printed = tables.case_means().set_index(FACTORS)["beta_mm"]
    row = {"configuration": "dual", "speed_km_h": 0.0, "initial_load_kN": 20.0, "step_kN": 10.0}
    up = printed["dual", "loading", 0.0, 20.0, 10.0]
    span = medians(published, "loading / unloading", "same span", **row)["beta"]
    assert span == pytest.approx(up / printed["dual", "unloading", 0.0, 30.0, -10.0], rel=1e-12)
    start = medians(published, "loading / unloading", "same initial load", **row)["beta"]
    assert start == pytest.approx(up / printed["dual", "unloading", 0.0, 20.0, -10.0], rel=1e-12)


def test_loads_that_add_up_only_in_decimals_match():
    factor_table = pd.DataFrame(
        [("a", "loading", 0.0, 10.1, 3.3), ("a", "unloading", 0.0, 13.4, -3.3)], columns=FACTORS
    )
    assert 10.1 + 3.3 != 13.4
    assert "same span" in set(contrasts(of_cases(numbered(factor_table)), "pass")["matching"])


def test_no_matched_pair_gives_no_row():
    factor_table = pd.DataFrame(
        [
            ("single", "loading", 0.0, 10.0, 5.0),
            ("dual", "loading", 15.0, 10.0, 5.0),
            ("single", "unloading", 0.0, 30.0, -10.0),
        ],
        columns=FACTORS,
    )
    tree = of_cases(numbered(factor_table))
    assert contrasts(tree, "pass").empty
    tree.attrs["origin"] = "published"
    table = contrasts(tree, "pass")
    assert set(zip(table["contrast"], table["matching"], strict=True)) == {
        ("loading / unloading", "pooled as published")
    }
    assert set(table["configuration"]) == {"single"}
    one_way = contrasts(of_cases(numbered(factor_table[:1])), "pass")
    assert one_way.empty


def test_a_reference_is_below_in_every_ratio_of_two_configurations_and_changes_no_other_row():
    table = contrasts(of_cases(numbered(grid(("c", "a", "b")))), "pass")
    turned = with_reference(table, "a", ["a", "b", "c"])
    assert list(turned["contrast"].unique()[:3]) == ["b / a", "c / a", "b / c"]
    mine, before = turned["contrast"] == "b / a", table["contrast"] == "a / b"
    assert mine.equals(before)
    for column, other in (("median", "median"), ("lower", "upper"), ("upper", "lower")):
        assert turned.loc[mine, column].tolist() == (1.0 / table.loc[before, other]).tolist()
    p = turned.loc[mine, "p_greater_than_1"] + table.loc[before, "p_greater_than_1"]
    assert p.to_numpy() == pytest.approx(1.0, abs=1e-12)
    rest = ~turned["contrast"].isin(["b / a", "c / a"])
    pd.testing.assert_frame_equal(turned[rest], table[rest])


def test_every_pair_of_configurations_has_the_earlier_in_sorted_order_above():
    cases = numbered(grid(("c", "a", "b")))
    table = contrasts(of_cases(cases), "pass")
    assert [c for c in table["contrast"].unique() if c != "loading / unloading"] == ["a / b", "a / c", "b / c"]
    k = cases.set_index(FACTORS)["k_kN_per_mm"]
    factor_table = {"direction": "loading", "speed_km_h": 25.0, "initial_load_kN": 20.0, "step_kN": 10.0}
    for above, below in (("a", "b"), ("a", "c"), ("b", "c")):
        expected = k[above, *factor_table.values()] / k[below, *factor_table.values()]
        assert medians(table, f"{above} / {below}", "same case", **factor_table)["k"] == pytest.approx(
            expected, rel=1e-12
        )


def test_only_the_cells_that_both_configurations_have_are_averaged():
    cases = numbered(grid()).query("not (configuration == 'dual' and speed_km_h == 25.0)").reset_index(drop=True)
    k = cases.set_index(FACTORS)["k_kN_per_mm"]
    both = [("loading", 0.0, 20.0, 10.0), ("unloading", 0.0, 30.0, -10.0)]
    expected = np.exp(np.mean([np.log(k["dual", *cell] / k["single", *cell]) for cell in both]))
    table = contrasts(of_cases(cases), "pass")
    assert medians(table, "dual / single", "same case")["k"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("kept", "found"),
    [
        ([], set()),
        (["configuration"], {"same case"}),
        (["direction"], set()),
        (["configuration", "direction"], {"same case"}),
        (["direction", "initial_load_kN", "step_kN"], {"same span"}),
        (["speed_km_h", "initial_load_kN"], set()),
    ],
)
def test_missing_words_hold_nothing_fixed_and_repeat_no_row(kept, found):
    factor_table = grid()[["record", *kept]]
    table = contrasts(posterior(scattered(factor_table, seed=2), factor_table), "pass")
    assert set(table["matching"]) == found
    missing = [word for word in FACTORS if word not in kept]
    assert table[missing].isna().all(axis=None)
    assert not table.duplicated(["contrast", "matching", *FACTORS, "parameter"]).any()


def test_a_ratio_of_draws_has_their_quantiles_and_the_share_above_one():
    factor_table = pd.DataFrame([("single", "loading"), ("dual", "loading")], columns=FACTORS[:2])
    draws = np.exp(np.random.default_rng(3).normal(0.1, 0.2, size=(4, 300, 2)))
    ratio = (draws[..., 1] / draws[..., 0]).ravel()
    for interval in (0.95, 0.5):
        table = contrasts(posterior({"k_case": draws, "beta_case": draws[..., ::-1]}, factor_table), "pass", interval)
        k, beta = (table[table["parameter"] == name].iloc[0] for name in ("k", "beta"))
        tails = np.quantile(ratio, [(1 - interval) / 2, 0.5, (1 + interval) / 2])
        np.testing.assert_allclose([k["lower"], k["median"], k["upper"]], tails, rtol=1e-12)
        assert k["interval"] == interval
        assert k["p_greater_than_1"] == pytest.approx((np.sum(ratio > 1) + 0.5) / 1201, abs=1e-12)
        assert beta["p_greater_than_1"] == pytest.approx((np.sum(ratio < 1) + 0.5) / 1201, abs=1e-12)
        assert 0.2 < beta["p_greater_than_1"] < 0.8


def test_draws_on_one_side_of_1_do_not_make_it_certain():
    factor_table = pd.DataFrame([("single", "loading"), ("dual", "loading")], columns=FACTORS[:2])
    table = contrasts(posterior({"k_case": fixed([1.0, 1.4]), "beta_case": fixed([1.4, 1.0])}, factor_table), "pass")
    found = table.groupby("parameter")["p_greater_than_1"].first()
    assert found["k"] == pytest.approx(16.5 / 17, abs=1e-12)
    assert found["beta"] == pytest.approx(0.5 / 17, abs=1e-12)


def test_a_common_factor_on_displacement_leaves_every_ratio_as_it_is():
    factor_table = grid()
    draws = scattered(factor_table, seed=4)
    factor = np.exp(np.random.default_rng(5).normal(0, 0.05, size=(*draws["k_case"].shape[:2], 1)))
    moved = draws | {"k_case": draws["k_case"] / factor, "beta_case": draws["beta_case"] * factor}
    before, after = (contrasts(posterior(one, factor_table), "pass") for one in (draws, moved))
    pd.testing.assert_frame_equal(before, after, rtol=1e-10)


def test_the_order_of_dimensions_does_not_matter():
    tree = posterior(scattered(factor_table := grid(), seed=3), factor_table)
    turned = tree.map_over_datasets(lambda dataset: dataset.transpose(..., "draw", "chain", missing_dims="ignore"))
    turned.attrs |= tree.attrs
    pd.testing.assert_frame_equal(contrasts(turned, "pass", 0.9), contrasts(tree, "pass", 0.9))
    xr.testing.assert_allclose(average_ratios(turned, "k"), average_ratios(tree, "k"))
    xr.testing.assert_allclose(group_means(turned), group_means(tree))
