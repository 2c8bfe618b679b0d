"""Text that a spreadsheet would run as a formula is made harmless in every CSV, and comes back as it was."""

import csv
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bayes_tyre.formats.tables.formulas import as_meant, harmless
from bayes_tyre.formats.tables.table_files import read_table, write_table

FORMULAS = ("=cmd()", "+1+1", "-2+3", "@SUM(1)", "\t=1", "\r=1", "\n=1", "=", "-", "-inf", "- 5")
TEXTS = ("single", "a=b", "a-b", " =1", "'single'", "'", "", "x@y", "20-30")
NUMBERS = ("-5", "+49", "-1.5e-3", "-.5", "5.")
#: Whatever a cell of a UTF-8 file can hold: no half of a surrogate pair, and no zero byte.
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)
FORMULA_LIKE = st.text(st.sampled_from("'=+-@\t\r\n\"1.,;x "), max_size=6)


def cells_of(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as lines:
        return list(csv.reader(lines))


@pytest.mark.parametrize("text", FORMULAS)
def test_a_formula_gets_an_apostrophe_and_no_second_one_when_the_file_is_read_and_written_again(text, tmp_path):
    table = pd.DataFrame({"record": [text], "note": [text], text: [1.0]})
    first = write_table(table, tmp_path / "first.csv")
    header, row = cells_of(first)
    assert header == ["record", "note", f"'{text}"]
    assert row == [f"'{text}", f"'{text}", "1.0"]
    again = write_table(read_table(first), tmp_path / "again.csv")
    assert cells_of(again) == [header, row]


@pytest.mark.parametrize("text", [*TEXTS, *NUMBERS])
def test_other_text_and_text_that_is_a_plain_number_stay_as_they_are(text, tmp_path):
    path = write_table(pd.DataFrame({"record": [text], "k": [1.0]}), tmp_path / "table.csv")
    assert cells_of(path)[1] == [text, "1.0"]


def test_numbers_are_never_touched(tmp_path):
    numbers = [-1.5, -np.inf, np.nan, 2.0]
    table = pd.DataFrame(
        {"float": numbers, "whole": [-1, 2, -3, 4], "mixed": pd.Series(["=x", -1.5, -3, None], dtype=object)}
    )
    rows = cells_of(write_table(table, tmp_path / "table.csv"))[1:]
    assert [row[0] for row in rows] == ["-1.5", "-inf", "", "2.0"]
    assert [row[1] for row in rows] == ["-1", "2", "-3", "4"]
    assert [row[2] for row in rows] == ["'=x", "-1.5", "-3", ""]


@pytest.mark.parametrize("dtype", ["str", "object", "category"])
def test_text_is_found_in_every_kind_of_column_and_the_table_given_is_not_changed(dtype, tmp_path):
    table = pd.DataFrame({"record": pd.Series(["=a", "b", "=a"], dtype=dtype)})
    before = table.copy(deep=True)
    assert [row[0] for row in cells_of(write_table(table, tmp_path / "table.csv"))[1:]] == ["'=a", "b", "'=a"]
    pd.testing.assert_frame_equal(table, before)


def test_parquet_holds_text_as_it_is(tmp_path):
    path = write_table(pd.DataFrame({"record": ["=cmd()"], "=x": [1.0]}), tmp_path / "table.parquet")
    assert pd.read_parquet(path).to_dict("list") == {"record": ["=cmd()"], "=x": [1.0]}
    assert read_table(path).to_dict("list") == {"record": ["=cmd()"], "=x": [1.0]}


@given(st.one_of(TEXT, FORMULA_LIKE))
@settings(max_examples=500)
def test_no_text_is_left_that_runs_and_every_one_comes_back(text):
    written = harmless(text)
    assert written[:1] not in tuple("=+-@\t\r\n") or _is_number(written)
    assert as_meant(written) == text


@given(labels=st.lists(st.one_of(TEXT, FORMULA_LIKE), min_size=1, max_size=4))
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_label_comes_back_from_a_csv(labels, tmp_path):
    table = pd.DataFrame({"record": labels, "force_kN": np.arange(len(labels)) + 0.5})
    read = read_table(write_table(table, tmp_path / "table.csv"))
    assert read["record"].to_list() == labels
    assert read["force_kN"].to_list() == table["force_kN"].to_list()


def _is_number(text: str) -> bool:
    try:
        return np.isfinite(float(text))
    except ValueError:
        return False
