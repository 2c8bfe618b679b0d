"""The record table: what is taken, what is refused and in which words."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.record import FACTORS, ORIGIN_UNKNOWN
from bayes_tyre.record_table import check_record_table, origin_of, record_extras, record_factors

MINIMAL = pd.DataFrame(
    {
        "record": ["a", "a", "a", "b", "b"],
        "displacement_mm": [0.0, 1.0, 2.0, 0.0, 0.5],
        "force_kN": [10.0, 12.0, 13.0, 9.0, 8.0],
    }
)
WORDED = MINIMAL.assign(
    configuration=["single"] * 3 + ["dual"] * 2,
    direction=["loading"] * 3 + ["unloading"] * 2,
    speed_km_h=[0, 0, 0, 25, 25],
    initial_load_kN=["20"] * 5,
    step_kN=[10.0] * 3 + [-10.0] * 2,
    repeat=["1"] * 3 + ["2"] * 2,
    time_s=[0.0, 0.1, 0.1, 0.0, 0.2],
    origin="simulated",
)


def refusal(table: pd.DataFrame) -> str:
    """The one line that a table is refused with."""
    with pytest.raises(BadInput) as caught:
        check_record_table(table, "records.csv")
    message = str(caught.value)
    assert message.startswith("records.csv: ")
    assert message.isprintable()  # a line break is not
    assert "; " in message  # what is wrong; what to do
    return message


def with_cell(row: int, column: str, cell: object) -> pd.DataFrame:
    cells: list[object] = WORDED[column].to_list()
    cells[row] = cell
    return WORDED.assign(**{column: pd.Series(cells, dtype=object)})


def test_a_minimal_table_is_taken_as_it_is():
    pd.testing.assert_frame_equal(check_record_table(MINIMAL), MINIMAL)


def test_words_are_typed():
    table = check_record_table(WORDED)
    for column in ("speed_km_h", "initial_load_kN", "step_kN", "repeat", "time_s"):
        assert table[column].dtype == np.float64
    assert table["initial_load_kN"].to_list() == [20.0] * 5
    assert check_record_table(MINIMAL.assign(record=[1, 1, 1, 2, 2]))["record"].to_list() == ["1", "1", "1", "2", "2"]


def test_further_columns_and_the_order_of_rows_are_kept():
    shuffled = MINIMAL.assign(note=pd.Series(["", "x", np.nan, 3, None], dtype=object), laser_V=1.5).iloc[
        [3, 0, 4, 1, 2]
    ]
    table = check_record_table(shuffled)
    assert list(table.columns) == [*MINIMAL.columns, "note", "laser_V"]
    pd.testing.assert_series_equal(table["note"], shuffled["note"].reset_index(drop=True))
    assert table["record"].to_list() == ["b", "a", "b", "a", "a"]


@pytest.mark.parametrize("table", [MINIMAL, WORDED, with_cell(1, "force_kN", "text")], ids=["minimal", "words", "bad"])
def test_the_table_given_is_never_changed(table):
    given = table.set_index(pd.Index([7, 7, 3, 2, 1]))
    before = given.copy(deep=True)
    try:
        taken = check_record_table(given)
        taken["force_kN"] = 0.0
    except BadInput:
        pass
    pd.testing.assert_frame_equal(given, before)


@pytest.mark.parametrize("column", ["record", "displacement_mm", "force_kN"])
def test_a_missing_column_is_named_beside_those_found(column):
    message = refusal(MINIMAL.drop(columns=column))
    assert f"missing column {column}" in message
    assert all(other in message for other in MINIMAL.columns)


def test_a_header_with_line_breaks_is_told_in_one_line():
    assert "found Disp mm, Load kN" in refusal(pd.DataFrame({"Disp\nmm": [1.0], "Load\nkN": [1.0]}))


def test_a_table_without_rows_is_refused():
    assert "no rows" in refusal(MINIMAL.iloc[:0])


def test_a_column_that_stands_twice_is_refused():
    twice = pd.concat([MINIMAL, MINIMAL[["force_kN"]]], axis=1)
    assert "column force_kN stands twice" in refusal(twice)


@pytest.mark.parametrize("column", ["displacement_mm", "force_kN", "time_s", "speed_km_h", "step_kN", "repeat"])
@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("1,5", "holds '1,5'"),
        ("twelve\nkN", r"holds 'twelve\nkN'"),
        ("", "is empty"),
        ("  ", "is empty"),
        (None, "is empty"),
        (np.nan, "is empty"),
        ("NA", "holds 'NA'"),
        ("nan", "holds 'nan'"),
        (np.inf, "finite"),
        ("-inf", "finite"),
    ],
)
def test_a_cell_that_is_no_finite_number_is_named_by_row_and_column(column, cell, said):
    message = refusal(with_cell(3, column, cell))
    assert "row 4 (line 5)" in message
    assert f"column {column}" in message
    assert said in message


def test_a_cell_that_is_no_number_is_named_by_record():
    assert "record 'b'" in refusal(with_cell(3, "force_kN", "twelve"))


def test_of_several_bad_cells_the_first_is_named_and_the_others_are_counted():
    infinite = MINIMAL.assign(force_kN=[1.0, np.inf, 3.0, 4.0, -np.inf], displacement_mm=[0.0, 1.0, 2.0, np.inf, 1.0])
    message = refusal(infinite)
    assert "row 2 (line 3), column force_kN" in message
    assert "2 more" in message


@pytest.mark.parametrize("column", ["record", "configuration", "direction", "origin"])
@pytest.mark.parametrize("cell", ["", "  ", None, np.nan])
def test_an_empty_word_is_refused(column, cell):
    message = refusal(with_cell(3, column, cell))
    assert "row 4 (line 5)" in message
    assert f"column {column}" in message


@pytest.mark.parametrize(
    ("column", "allowed"),
    [("direction", "loading, unloading"), ("origin", "measured, published, reconstructed, simulated")],
)
def test_an_unknown_word_is_told_what_is_allowed(column, allowed):
    message = refusal(WORDED.assign(**{column: "upwards"}))
    assert "row 1 (line 2)" in message
    assert f"column {column}" in message
    assert f"'upwards' is none of {allowed}" in message


@pytest.mark.parametrize("repeat", [1.5, 1e300])
def test_a_repeat_is_a_whole_number(repeat):
    message = refusal(with_cell(2, "repeat", repeat))
    assert "row 3 (line 4), column repeat" in message
    assert "not a whole number" in message


@pytest.mark.parametrize(
    ("column", "other"),
    [
        ("configuration", "triple\ntyre"),
        ("direction", "unloading"),
        ("speed_km_h", 55),
        ("initial_load_kN", 30),
        ("step_kN", 5.0),
        ("repeat", 2),
        ("origin", "measured"),
    ],
)
def test_words_that_contradict_each_other_within_a_record_are_refused(column, other):
    message = refusal(with_cell(1, column, other))
    assert f"record 'a', column {column}: contradicts itself" in message
    assert " ".join(str(other).split()) in message


@pytest.mark.parametrize(("record", "step"), [("a", -10.0), ("b", 10.0)])
def test_a_direction_against_the_sign_of_the_step_is_refused(record, step):
    message = refusal(WORDED.assign(step_kN=WORDED["step_kN"].where(WORDED["record"] != record, step)))
    assert f"record '{record}', column step_kN: {step:g} contradicts direction" in message


@pytest.mark.parametrize(
    "cells",
    [
        pd.to_datetime(["2024-01-01"] * 5),
        pd.to_timedelta([1, 2, 3, 4, 5], unit="s"),
        [True, False, True, True, False],
        pd.Series([1.0, 2.0, True, 3.0, 4.0], dtype=object),
    ],
)
def test_dates_durations_and_truth_values_are_no_numbers(cells):
    """A spreadsheet makes a date of 1.5."""
    assert "column force_kN holds" in refusal(WORDED.assign(force_kN=cells))


def test_a_speed_below_0_is_refused():
    assert "column speed_km_h: '-25.0' is below 0" in refusal(WORDED.assign(speed_km_h=-25))


def test_labels_are_without_the_spaces_around_them_but_for_a_record_s():
    spaced = WORDED.assign(configuration=["single", " single", "single ", "dual\n", "dual\t"])
    pd.testing.assert_frame_equal(check_record_table(spaced), check_record_table(WORDED))
    tab = check_record_table(WORDED.assign(configuration="\t@SUM(1)"))  # a formula made harmless
    assert set(tab["configuration"]) == {"\t@SUM(1)"}


def test_further_columns_may_lack_readings_or_hold_what_cannot_be_compared():
    lists = pd.Series([[1], [2], [1], [3], [3]], dtype=object)
    bar = pd.Series(["7.25", "", "7.75", "8", " "], dtype="str")
    numbers = pd.Series(["001", "001", "001", "002", "002"], dtype="str")
    with pytest.warns(UserWarning, match="column tags: text that varies within a record"):
        extras = record_extras(MINIMAL.assign(bar=bar, tags=lists, tyre=numbers))
    pd.testing.assert_frame_equal(
        extras, pd.DataFrame({"record": ["a", "b"], "bar": [7.5, 8.0], "tyre": ["001", "002"]}), check_dtype=False
    )


def test_time_that_runs_backwards_is_refused():
    message = refusal(with_cell(2, "time_s", 0.05))
    assert "row 3 (line 4), record 'a', column time_s: time runs backwards" in message


def test_time_may_start_again_in_the_next_record_and_stand_still():
    together = check_record_table(WORDED.iloc[[0, 3, 1, 4, 2]])
    assert together["time_s"].to_list() == [0.0, 0.0, 0.1, 0.2, 0.1]


def test_record_words_are_a_row_a_record_in_order_of_appearance():
    factors = record_factors(check_record_table(WORDED.iloc[[3, 0, 4, 1, 2]]))
    assert list(factors.columns) == ["record", *FACTORS]
    assert factors["record"].to_list() == ["b", "a"]
    assert factors["repeat"].to_list() == [2, 1]
    assert factors["repeat"].dtype == np.int64
    assert factors["direction"].to_list() == ["unloading", "loading"]


def test_record_words_are_those_that_the_table_has():
    factors = record_factors(check_record_table(WORDED[[*MINIMAL.columns, "step_kN", "configuration"]]))
    assert list(factors.columns) == ["record", "configuration", "step_kN"]
    assert list(record_factors(MINIMAL).columns) == ["record"]


def test_origins_are_named_once_each_and_their_absence_too():
    assert origin_of(MINIMAL) == ORIGIN_UNKNOWN
    assert origin_of(WORDED) == "simulated"
    assert origin_of(WORDED.assign(origin=["simulated"] * 3 + ["measured"] * 2)) == "measured + simulated"
