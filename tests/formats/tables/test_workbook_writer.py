"""Workbooks: numbers stay numbers, texts stay texts, whatever they hold; the verdict comes first."""

import string

import numpy as np
import openpyxl
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.formats.tables import workbook_writer
from bayes_tyre.formats.tables.workbook_writer import write_workbook


def sheets(path) -> dict[str, list[tuple]]:
    book = openpyxl.load_workbook(path)
    return {sheet.title: list(sheet.values) for sheet in book}


def test_a_sheet_a_table_with_a_frozen_header_the_verdict_first_and_cells_as_they_are(tmp_path):
    table = pd.DataFrame({"record": ["a", ""], "k_kN_per_mm": [1.8, np.nan], "points": [3, 4], "verdict": "fail"})
    path = write_workbook({"summary": table, "cases": table.drop(columns="verdict")}, tmp_path / "results.xlsx")
    assert sheets(path) == {
        "summary": [("verdict", "record", "k_kN_per_mm", "points"), ("fail", "a", 1.8, 3), ("fail", None, None, 4)],
        "cases": [("record", "k_kN_per_mm", "points"), ("a", 1.8, 3), (None, None, 4)],
    }
    book = openpyxl.load_workbook(path)
    assert [sheet.freeze_panes for sheet in book] == ["A2", "A2"]
    assert all(cell.font.bold for cell in book["summary"][1])
    assert [cell.data_type for cell in book["cases"][2]] == ["s", "n", "n"]
    assert list(table.columns) == ["record", "k_kN_per_mm", "points", "verdict"]


@settings(max_examples=20)
@given(st.text(string.ascii_letters + "=+-@'\"<&; é€", min_size=1), st.floats(-1e300, 1e300))
def test_texts_and_numbers_come_back(tmp_path_factory, text, number):
    path = tmp_path_factory.getbasetemp() / "any.xlsx"
    write_workbook({"sheet": pd.DataFrame({"text": [text], "number": [number]})}, path)
    (cell, value) = sheets(path)["sheet"][1]
    assert cell == (" ".join(text.split()) or None)
    assert value == pytest.approx(number, rel=1e-15, abs=1e-307)  # openpyxl writes 16 digits


def test_what_would_be_a_formula_is_a_text_and_what_no_file_may_hold_is_escaped(tmp_path):
    table = pd.DataFrame({"=name": ["=1+1", "bell\x07", "two\nlines"], "value": [np.inf, -np.inf, 1.0]})
    path = write_workbook({"sheet": table}, tmp_path / "odd.xlsx")
    assert sheets(path)["sheet"] == [("=name", "value"), ("=1+1", "inf"), ("bell\\x07", "-inf"), ("two lines", 1)]
    cells = openpyxl.load_workbook(path)["sheet"]
    assert {cells["A1"].data_type, cells["A2"].data_type} == {"s"}


def test_a_table_too_long_for_a_sheet_is_refused_before_a_file_is_written(monkeypatch, tmp_path):
    monkeypatch.setattr(workbook_writer, "MOST_ROWS", 2)
    with pytest.raises(ValueError, match="cases: 3 rows are more than the 2 of a sheet"):
        write_workbook({"cases": pd.DataFrame({"k": [1, 2, 3]})}, tmp_path / "long.xlsx")
    assert not list(tmp_path.iterdir())
