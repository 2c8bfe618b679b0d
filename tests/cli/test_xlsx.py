"""`--xlsx` of `lsq` and `fit`: the tables of the CSV files in one workbook, and none left of an older run."""

import openpyxl
import pandas as pd
import pytest
from helpers.command_line import TABLES, here, small, written
from helpers.quick_fits import put_a_fit_without_checks_and_figures

from bayes_tyre.formats.tables import workbook_writer


@pytest.fixture
def fit(monkeypatch, tmp_path):
    """Return what fits quickly, made-up draws, into the folder `fit`."""
    put_a_fit_without_checks_and_figures(monkeypatch)
    path = written(small(), tmp_path / "records.csv")
    return lambda *options: here("fit", path, "--out", tmp_path / "fit", *options)


def assert_same(sheet, path) -> None:
    """Assert that a sheet holds what a CSV does: texts, numbers and blanks."""
    table = pd.read_csv(path)
    header, *rows = sheet.values
    assert sorted(header) == sorted(table.columns)
    from_sheet = pd.DataFrame(rows, columns=list(header))[list(table.columns)]
    for column, cells in from_sheet.items():  # a column of blanks alone has no type
        typed = cells.astype(float) if pd.api.types.is_numeric_dtype(table[column]) else cells
        pd.testing.assert_series_equal(typed, table[column], check_dtype=False, rtol=1e-15)


def test_lsq_writes_its_table_as_a_workbook_and_removes_an_old_one(tmp_path):
    path = written(small(), tmp_path / "records.csv")
    assert here("lsq", path, "--out", tmp_path, "--xlsx").exit_code == 0
    book = openpyxl.load_workbook(tmp_path / "least_squares.xlsx")
    assert book.sheetnames == ["least_squares"]
    assert_same(book["least_squares"], tmp_path / "least_squares.csv")
    assert here("lsq", path, "--out", tmp_path).exit_code == 0
    assert not (tmp_path / "least_squares.xlsx").exists()


def test_fit_writes_all_four_tables_with_the_verdict_in_front(fit, monkeypatch, tmp_path):
    assert fit("--xlsx", "--limit", "k >= 1.5").exit_code == 4
    book = openpyxl.load_workbook(tmp_path / "fit" / "results.xlsx")
    assert [f"{name}.csv" for name in book.sheetnames] == list(TABLES)
    for name in TABLES:
        assert_same(book[name.removesuffix(".csv")], tmp_path / "fit" / name)
    assert [book["summary"][cell].value for cell in ("A1", "A2")] == ["verdict", "fail"]

    def full(*_: object) -> None:
        raise ValueError("no workbook today")

    monkeypatch.setattr(workbook_writer, "write_workbook", full)
    done = fit("--xlsx")
    assert done.exit_code == 4
    assert "results.xlsx failed: ValueError: no workbook today" in done.stderr
    assert not (tmp_path / "fit" / "results.xlsx").exists()  # the older one
    assert (tmp_path / "fit" / "run.json").exists()
