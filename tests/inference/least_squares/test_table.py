"""From a record table to a row a record: columns, words, lengths, order, and that each is the record's own fit."""

import math

import numpy as np
import pandas as pd
import pytest
from helpers.odd_records import BETA, LONG, RECORDS, K, by_record, fitted, record, table_of

from bayes_tyre.inference.least_squares.table import fit_records
from bayes_tyre.record import FACTORS, ORIGIN_UNKNOWN

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

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


def test_every_record_has_one_row_in_the_order_of_the_table(fits):
    assert fits["record"].to_list() == [*LONG, *RECORDS]


def test_columns_are_those_of_the_contract(fits, thesis, fixed):
    assert list(fits.columns) == list(thesis.columns) == list(fixed.columns) == COLUMNS


def test_a_table_without_words_has_them_empty_and_no_origin(fits):
    assert (fits[list(FACTORS)] == "").all(axis=None)
    assert (fits["origin"] == ORIGIN_UNKNOWN).all()


def test_words_and_origin_come_along_with_each_record():
    factor_table = {"configuration": "single", "direction": "loading", "speed_km_h": 25.0, "initial_load_kN": 20.0}
    given = {
        name: {**factor_table, "step_kN": 10.0, "repeat": i, "origin": "measured"} for i, name in enumerate(RECORDS)
    }
    given["loading"] |= {"configuration": "dual", "repeat": 7, "origin": "simulated"}
    fits = fitted({n: RECORDS[n].assign(**given[n]) for n in RECORDS})
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


def test_progress_comes_batch_by_batch_and_a_smaller_last_batch_is_fitted_as_alone(fits):
    small = [record(8, beta=0.8, noise_kN=0.003, seed=seed) for seed in range(7)]
    many = pd.concat([small[i % 7].assign(record=f"r{i}") for i in range(4096)])
    last = ["loading", "unloading", "one point", "no travel", "tiny beta"]
    done: list[int] = []
    found = by_record(
        fit_records(pd.concat([many, table_of({name: RECORDS[name] for name in last})]), None, done.append)
    )
    assert done == [4096, len(last)]
    pd.testing.assert_frame_equal(found.loc[last, NUMBERS], fits.loc[last, NUMBERS], rtol=1e-9)
    assert found.loc[last, "status"].to_list() == fits.loc[last, "status"].to_list()
    alike = found.loc[["r6", "r4094"], NUMBERS].to_numpy()
    np.testing.assert_allclose(alike[0], alike[1], rtol=1e-9)


def with_extras() -> pd.DataFrame:
    extras = {
        "loading": {"pressure_bar": 7.25, "lab": "north", "status": "checked", "points": 3},
        "unloading": {"pressure_bar": 7.0, "lab": "", "status": "", "points": 4},
    }
    return table_of({name: RECORDS[name].assign(**row) for name, row in extras.items()})


def test_further_columns_come_along_between_status_and_origin(fits):
    found = by_record(fit_records(with_extras()))
    further = ["pressure_bar", "lab", "given_status", "given_points"]
    assert list(found.columns) == [*COLUMNS[:-1], *further, "origin"]
    assert found[further].to_numpy().tolist() == [[7.25, "north", "checked", 3], [7.0, "", "", 4]]
    assert found["status"].to_list() == ["ok", "ok"]
    pd.testing.assert_frame_equal(found[NUMBERS], fits.loc[["loading", "unloading"], NUMBERS], rtol=1e-9)


def test_numbers_that_vary_within_a_record_are_averaged():
    table = with_extras().assign(temperature_C=lambda t: 20.0 + (t.index % 2))
    assert fit_records(table)["temperature_C"].to_list() == [20.5, 20.5]


def test_text_that_varies_within_a_record_is_left_out_and_said():
    table = with_extras().assign(note=lambda t: t.index.astype(str), warning=lambda t: (t.index % 3).astype(str))
    with pytest.warns(UserWarning, match="^columns note, warning: text that varies within a record, left out") as said:
        found = fit_records(table)
    assert len(said) == 1
    assert not {"note", "warning"} & set(found.columns)


def test_names_that_clash_twice_stay_apart():
    table = with_extras().assign(given_status="theirs", k_kN_per_mm=1.0)
    found = fit_records(table)
    assert found.columns.is_unique
    assert found["given_status"].to_list() == ["theirs"] * 2
    assert found["given_given_status"].to_list() == ["checked", ""]
    assert found["given_k_kN_per_mm"].to_list() == [1.0, 1.0]
    assert (found["k_kN_per_mm"] != 1.0).all()
