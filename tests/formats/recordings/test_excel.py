"""Workbooks: a column map, cached values of formulas, and archives that unpack to more than a recording."""

import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from helpers.flipped_bytes import assert_read_or_refused

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.recordings.excel import read_excel
from bayes_tyre.formats.tables import workbook

NAMES = ["Time (ms)", "note", "Acc m/s^2", "Load [kN]"]
ROWS = [[0, "warm", 1.5, 30], [10, None, -2.5, 29.5], [20, "left", None, 29]]


def written(path: Path, rows: Iterable[Iterable[object]], *more: Iterable[Iterable[object]]) -> Path:
    book = openpyxl.Workbook()
    for i, sheet_rows in enumerate((rows, *more)):
        sheet = book.worksheets[0] if i == 0 else book.create_sheet()
        for row in sheet_rows:
            sheet.append(list(row))
    book.save(path)
    return path


def changed(path: Path, part: str, before: str, after: str) -> Path:
    """Replace text in one part of a workbook."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    parts[part] = parts[part].replace(b"<v></v>", b"<v />")  # as lxml writes it, which openpyxl takes where it is there
    assert before.encode() in parts[part]
    parts[part] = parts[part].replace(before.encode(), after.encode())
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return path


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "step.xlsx"


def test_columns_by_the_names_above(path):
    raw = read_excel(written(path, [["a title"], [], NAMES, *[[row[0], None, *row[2:]] for row in ROWS]]))
    (channels,) = raw.segments
    assert [(one.name, one.unit) for one in channels] == [("note", ""), ("Acc m/s^2", ""), ("Load [kN]", "kN")]
    np.testing.assert_allclose(channels[2].time_s, [0.0, 0.01, 0.02])
    assert channels[1].values.tolist() == [1.5, -2.5]  # shorter: its last cell is blank
    assert channels[2].values.tolist() == [30, 29.5, 29]
    assert len(channels[0].values) == 0
    assert raw.warnings == ("X 'Time (ms)' turned into seconds",)


def test_a_column_of_text_is_left_out_and_said(path):
    for text in (["warm", None, "left"], ["warm", "cold", "left"]):
        rows = [[row[0], cell, *row[2:]] for row, cell in zip(ROWS, text, strict=True)]
        raw = read_excel(written(path, [NAMES, *rows]))
        assert [one.name for one in raw.segments[0]] == ["Acc m/s^2", "Load [kN]"]
        assert raw.segments[0][1].values.tolist() == [30, 29.5, 29]
        assert raw.warnings[0] == "column 'note' is text: left out"


@pytest.mark.parametrize("title", [[], [["a title"]], [["day", "Monday"]], [["rate", 1000]]])
def test_units_below_the_names_are_units_and_said(path, title):
    rows = [["time", "note", "acc", "acc"], ["[ms]", None, "m/s^2", "g"], [0, "a", 1.5, 1], [10, "b", 2.5, 2]]
    raw = read_excel(written(path, [*title, *rows]))
    assert [(one.name, one.unit, one.time_s.tolist()) for one in raw.segments[0]] == [
        ("acc", "m/s^2", [0.0, 0.01]),
        ("acc", "g", [0.0, 0.01]),
    ]
    assert raw.warnings == (
        f"row {2 + len(title)} is taken for the units of the names above it",
        "column 'note' is text: left out",
        "X 'time' turned into seconds",
        "several channels have the name 'acc'",
    )


@pytest.mark.parametrize("above", [["who", "Smith"], ["a title"], ["rate", 1000]])
def test_a_line_of_text_right_above_the_names_makes_them_no_units(path, above):
    (acc,) = read_excel(written(path, [above, ["time", "acc"], [0, 1.5], [1, 2.5]])).segments[0]
    assert (acc.name, acc.unit, acc.values.tolist()) == ("acc", "", [1.5, 2.5])


def test_the_source_s_own_columns(path):
    # Columns 1, 3, 12 and 13 of a sheet below a LabVIEW header, text in others.
    header = [["Reader_Version", 2], ["Samples", *[3] * 12], ["X_Value", *[f"channel {i}" for i in range(1, 14)]]]
    rows = [[0.1 * i, "text", i + 0.5, *["-"] * 8, 660 + i, 30 - i] for i in range(3)]
    columns = {"time": 1, "Acc m/s^2": 3, "Disp mm": 12, "Load kN": 13}
    (channels,) = read_excel(written(path, [*header, *rows]), columns).segments
    assert [one.name for one in channels] == ["Acc m/s^2", "Disp mm", "Load kN"]
    np.testing.assert_allclose(channels[0].time_s, [0.0, 0.1, 0.2])
    assert [one.values.tolist() for one in channels] == [[0.5, 1.5, 2.5], [660, 661, 662], [30, 29, 28]]
    with pytest.raises(BadInput, match="no row of numbers in all of columns 1, 14"):
        read_excel(path, {"time": 1, "load": 14})
    with pytest.raises(BadInput, match=r"sheet 'Sheet', row 5, column B \(note\): 'text' is no number"):
        read_excel(written(path, [*header, [0.0, 1.0], *rows]), {"time": 1, "note": 2})


def test_a_sheet_pasted_from_labview_with_a_comment_in_its_first_row(path):
    rows = [["Samples", 2, 2], ["X_Value", "acc", "Comment"], [0.0, 1.0, "06:04:45"], [0.1, 2.0]]
    (channels,) = read_excel(written(path, rows)).segments
    assert [(one.name, one.values.tolist(), one.time_s.tolist()) for one in channels] == [
        ("acc", [1.0, 2.0], [0.0, 0.1])
    ]


def test_formulas_are_not_computed(path):
    written(path, [["time", "acc"], [0, 1.5], [1, "=1+1"], [2, "=2+2"], [3, 4.5]])
    (acc,) = read_excel(path).segments[0]
    np.testing.assert_array_equal(acc.values, [1.5, np.nan, np.nan, 4.5])
    changed(path, "xl/worksheets/sheet1.xml", "<f>1+1</f><v />", "<f>1+1</f><v>7.25</v>")
    (acc,) = read_excel(path).segments[0]
    np.testing.assert_array_equal(acc.values, [1.5, 7.25, np.nan, 4.5])


def test_errors_are_missing_and_text_is_refused(path):
    (acc,) = read_excel(written(path, [["time", "acc"], [0, 1], [1, "#N/A"], [2, "1.5"], [3, "nan"], [4, 2]])).segments[
        0
    ]
    np.testing.assert_array_equal(acc.values, [1, np.nan, 1.5, np.nan, 2])
    for cell in ("about 3", True):
        with pytest.raises(BadInput, match=r"row 3, column B \(acc\): .* is no number; mend the cell"):
            read_excel(written(path, [["time", "acc"], [0, 1], [1, cell], [2, 3]]))


def test_no_names_no_rows_and_other_sheets(path):
    raw = read_excel(written(path, [], [[0.0, 5.0], [0.5, 6.0]], [["notes"]]))
    assert [(one.name, one.values.tolist()) for one in raw.segments[0]] == [("column 2", [5.0, 6.0])]
    assert raw.warnings == ("sheet 'Sheet1' read; left out: 'Sheet', 'Sheet2'",)
    with pytest.raises(BadInput, match="holds nothing"):
        read_excel(written(path, []))
    with pytest.raises(BadInput, match="no row of numbers"):
        read_excel(written(path, [["time", "acc"], ["a", "b"]]))


def test_what_unpacks_to_too_much_is_refused_before_it_is_unpacked(path, monkeypatch):
    with zipfile.ZipFile(written(path, [["time", "acc"], *ROWS]), "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/media/bomb.xml", b"\0" * 50_000_000)
    monkeypatch.setattr(openpyxl, "load_workbook", lambda *_, **__: pytest.fail("was opened"))
    with pytest.raises(BadInput, match=r"unpacks to \d+ parts, 50\d{6} bytes; "):
        read_excel(path)
    with zipfile.ZipFile(path, "w") as archive:
        for i in range(10_001):
            archive.writestr(str(i), b"")
    with pytest.raises(BadInput, match="unpacks to 10001 parts"):
        read_excel(path)


def test_entities_are_refused(path):
    entities = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><worksheet '
    changed(written(path, [["time", "acc"], [0, 1]]), "xl/worksheets/sheet1.xml", "<worksheet ", entities)
    with pytest.raises(BadInput, match="declares entities"):
        read_excel(path)


def test_sheets_that_go_on_and_on_are_refused(path, monkeypatch):
    written(path, [["time", "acc"], [0, 1], [1, 2]])
    changed(path, "xl/worksheets/sheet1.xml", '<row r="3">', '<row r="99999999">')
    with pytest.raises(BadInput, match="a sheet of over 1048576 rows"):
        read_excel(path)
    written(path, [["time", "acc"], [0, 1], [1, 2]])
    changed(path, "xl/worksheets/sheet1.xml", '<c r="B3"', '<c r="ZZZ3"')
    with pytest.raises(BadInput, match="row 3, cell 18278: a sheet of over"):
        read_excel(path)
    written(path, [["time", "acc"], [0, 1], [1, 2]])
    monkeypatch.setattr(workbook, "_MOST_CELLS", 5)
    with pytest.raises(BadInput, match="row 3"):
        read_excel(path)


def test_what_is_no_workbook_is_refused(path):
    for content in (b"", b"PK\x03\x04", b"time,acc\n0,1\n", b"\xd0\xcf\x11\xe0" * 200):
        path.write_bytes(content)
        with pytest.raises(BadInput, match=r"step\.xlsx: is no workbook .*; save it as \.xlsx"):
            read_excel(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
    with pytest.raises(BadInput, match="cannot be read as a workbook"):
        read_excel(path)


def test_flipped_bytes_give_signals_or_the_one_error(path):
    assert_read_or_refused(written(path, [["time", "acc"], [0, 1.5], [1, 2.5]]), read_excel, times=150)
