"""Tables of a lab, byte for byte, through a column map: names, units, values and constants come out as ours."""

import csv
import tempfile
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.column_map import ColumnMap, read_column_map
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.record_table import check_record_table

MAP = """
[columns]
record = "Versuch"
displacement_mm = "Weg"
force_kN = "Kraft"
direction = "Prüfrichtung"
[constants]
configuration = "A"
[values.direction]
Belastung = "loading"
Entlastung = "unloading"
"""
ROWS = "Versuch;Prüfrichtung;Weg;Kraft\r\n;;[m];[N]\r\n007;Belastung;0,0015;1000\r\n008;Entlastung;0,0025;-500,5\r\n"
PREAMBLE = "Prüfer;Müller, Hans\r\nDatum;24.11.2026\r\n\r\n"
TABLE = {
    "record": ["007", "008"],
    "direction": ["loading", "unloading"],
    "displacement_mm": [1.5, 2.5],
    "force_kN": [1.0, -0.5005],
    "configuration": ["A", "A"],
}
CONVERTED = [
    "column 'Weg' is in m by its row of units: converted to mm",
    "column 'Kraft' is in N by its row of units: converted to kN",
]


def read(path: Path, column_map: ColumnMap) -> pd.DataFrame:
    return column_map.applied(read_table(path, column_map.layout), path)


def mapped(folder: Path, toml: str) -> ColumnMap:
    path = folder / "map.toml"
    path.write_text(toml, encoding="utf-8")
    return read_column_map(path)


def write(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("preamble", ["", PREAMBLE, 'Rig 5" pipe\r\n'])
def test_a_preamble_a_row_of_units_and_decimal_commas_in_every_encoding(encoding, preamble, tmp_path):
    table = read(write(tmp_path / "a.csv", preamble + ROWS, encoding), mapped(tmp_path, MAP))
    assert table.to_dict("list") == TABLE
    assert table.attrs["notes"] == CONVERTED
    assert table.attrs["first_line"] == 3 + preamble.count("\n")


ONE_WRONG = "record,displacement_mm,force_kN,direction\n\na,0,1,up\na,1,2,up\n\n  \na,2,3,{}\n"


def test_a_line_is_counted_with_the_blank_ones_above_it(tmp_path):
    """The wrong cell stands in line 7, whatever reads it: a number, a direction, the table of records."""
    wrong = write(tmp_path / "a.csv", ONE_WRONG.format("across"))
    with pytest.raises(BadInput, match=r"row 3 \(line 7\), column direction: 'across' is neither"):
        read(wrong, mapped(tmp_path, '[values.direction]\nup = "loading"'))
    with pytest.raises(BadInput, match=r"row 3 \(line 7\), record 'a', column force_kN"):
        check_record_table(read_table(write(tmp_path / "b.csv", ONE_WRONG.replace("3", "three"))))
    book = openpyxl.Workbook()
    for row in csv.reader(ONE_WRONG.replace("3", "three").splitlines()):
        book.worksheets[0].append([float(cell) if cell.isdigit() else cell.strip() or None for cell in row])
    book.save(tmp_path / "b.xlsx")
    with pytest.raises(BadInput, match=r"row 3 \(line 7\), record 'a', column force_kN"):
        check_record_table(read_table(tmp_path / "b.xlsx"))
    assert read_table(write(tmp_path / "c.csv", "a,b\n1,2\n3,4\n")).attrs["blank_lines"] == []
    assert read_table(write(tmp_path / "d.csv", "a,b\n1,2\n3,4")).attrs["blank_lines"] == []
    assert read_table(write(tmp_path / "e.csv", "a,b\n1,2\n\n3,4")).attrs["blank_lines"] == [1]


def test_the_same_table_from_a_sheet_that_is_named(tmp_path):
    book = openpyxl.Workbook()
    book.worksheets[0].append(["notes"])
    sheet = book.create_sheet("Messung 1")
    for row in (
        *(["Prüfer", "Müller"], [], ["Versuch", "Prüfrichtung", "Weg", "Kraft"], [None, None, "m", "N"]),
        *(["007", "Belastung", 0.0015, 1000], ["008", "Entlastung", 0.0025, -500.5]),
    ):
        sheet.append(row)
    book.save(tmp_path / "a.xlsx")
    table = read(tmp_path / "a.xlsx#Messung 1", mapped(tmp_path, MAP))
    assert table.to_dict("list") == TABLE
    assert table.attrs["notes"] == CONVERTED
    assert table.attrs["first_line"] == 5
    without_title = read(tmp_path / "a.xlsx", mapped(tmp_path, MAP))  # the sheet before it has no such names
    pd.testing.assert_frame_equal(without_title, table)
    assert without_title.attrs["notes"] == ["sheet 'Messung 1' read; left out: 'Sheet'", *CONVERTED]
    with pytest.raises(BadInput, match="no sheet 'Messung 2'; name one of 'Sheet', 'Messung 1'"):
        read(tmp_path / "a.xlsx#Messung 2", mapped(tmp_path, MAP))
    with pytest.raises(BadInput, match=r"no column 'Versuch', 'Weg', 'Kraft' and 1 more, .*; found notes; mend"):
        read(tmp_path / "a.xlsx#Sheet", mapped(tmp_path, MAP))


def sheet_of(path: Path, *cells: object) -> Path:
    """Write a sheet with a force of 1 kN in each row, and these displacements as they are given: numbers or texts."""
    book = openpyxl.Workbook()
    for row in (["record", "displacement_mm", "force_kN"], *(["a", cell, 1] for cell in cells)):
        book.worksheets[0].append(row)
    book.save(path)
    return path


@pytest.mark.parametrize("cells", [["0,5", "1", "-1,5e1"], [0.5, "1", "-15,0"], ["0.5", 1, "-15."]])
def test_numbers_stored_as_text_in_a_sheet_are_numbers(cells, tmp_path):
    table = check_record_table(read(sheet_of(tmp_path / "a.xlsx", *cells), ColumnMap()))
    assert table["displacement_mm"].tolist() == [0.5, 1, -15]


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        (["0,5", "1.5"], "holds '1.5', but row 1, column displacement_mm '0,5': points and commas"),
        (["0,5", "1.000,5"], "row 2 .*holds '1.000,5': a thousands separator"),
        (["0,5", "n/a"], "row 2 .*holds 'n/a': not a finite number"),
    ],
)
def test_texts_in_a_sheet_that_are_no_clear_numbers_are_refused(cells, said, tmp_path):
    with pytest.raises(BadInput, match=said):
        check_record_table(read(sheet_of(tmp_path / "a.xlsx", *cells), ColumnMap()))


def test_skip_rows_names_the_header_where_the_preamble_has_it_too(tmp_path):
    text = "record;displacement_mm;force_kN\r\nthe names again:\r\nrecord;displacement_mm;force_kN\r\na;1;2\r\n"
    path = write(tmp_path / "a.csv", text)
    assert read(path, ColumnMap(skip_rows=2)).to_dict("list") == {
        **{"record": ["a"], "displacement_mm": [1], "force_kN": [2]}
    }


def test_our_own_names_need_no_map_and_a_row_of_units_is_read_below_them(tmp_path):
    table = read(write(tmp_path / "a.csv", "record,displacement_mm,force_kN\n,in,lbf\na,1,1000\n"), ColumnMap())
    assert table["displacement_mm"].to_list() == [25.4]
    # 1 lbf = 0.45359237 kg x 9.80665 m/s^2, exactly.
    np.testing.assert_allclose(table["force_kN"], [0.45359237 * 9.80665], rtol=1e-15)


def test_a_bad_cell_below_units_is_named_by_its_own_text_and_line(tmp_path):
    text = "record,displacement_mm,force_kN\n,mm,N\na,1,1000\na,2,n/a\n"
    table = read(write(tmp_path / "a.csv", text), ColumnMap())
    assert table["force_kN"].to_list() == [1.0, "n/a"]


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        ("spalten = 1", "spalten: is unknown; the map has skip_rows, columns, constants, values"),
        ('[columns]\nkraft = "F"', "columns.kraft: is no column of ours, which are record,"),
        ('[columns]\nforce_kN = { name = "F", unit = "kp" }', "columns.force_kN: 'kp' is no unit of force_kN; use kN,"),
        ('[columns]\nforce_kN = { name = "F", unit = "mm" }', "'mm' is no unit of force_kN"),
        ('[columns]\nrecord = { name = "F", unit = "N" }', "'N' is no unit of record"),
        ('[columns]\nforce_kN = { spalte = "F" }', "columns.force_kN"),
        ('[columns]\nforce_kN = { name = "F", unsigned = true }', "columns.force_kN: unsigned is for step_kN alone"),
        ('[columns]\nrecord = "V"\nrepeat = "V"', "'V' stands for two columns"),
        ('[constants]\nrepeat = "one"', "constants.repeat: 'one' is no number"),
        ("[constants]\nconfiguration = 3", "constants.configuration: 3.0 is no text"),
        ('[constants]\ndirection = "up"', "constants.direction: 'up' is none of loading, unloading"),
        ('[columns]\nrepeat = "V"\n[constants]\nrepeat = 1', "constants.repeat: is a column of the file too"),
        ('[values.direction]\nauf = "up"', "values.direction.auf"),
        ('[values.speed]\nauf = "loading"', "values.speed: is unknown"),
        ("skip_rows = -1", "skip_rows"),
        ("[[", "cannot be read as TOML"),
    ],
)
def test_a_map_that_cannot_be_is_refused_in_one_line(toml, said, tmp_path):
    with pytest.raises(BadInput) as caught:
        mapped(tmp_path, toml)
    message = str(caught.value)
    assert message.startswith(f"--columns {tmp_path / 'map.toml'}: ")
    assert message.isprintable()
    assert said in message
    assert message.endswith("; mend the map")


@pytest.mark.parametrize(
    ("header", "toml", "said"),
    [
        ("V,Weg,Kraft", 'record = "V"\nforce_kN = "F"', "no column 'F', which the column map calls force_kN; found V,"),
        ("V,Weg,force_kN,F", 'force_kN = "F"', "column 'force_kN' stands beside the one that the column map calls so"),
        ("V,Weg,Kraft (N)", 'force_kN = "Kraft (N)"', "is taken for kN, its name says 'N'; give its unit in the map"),
        ("V,Travel in,F", 'displacement_mm = "Travel in"', "is taken for mm, its name says 'in'; give its unit"),
        ("V,Weg,Kraft_N", 'force_kN = "Kraft_N"', "is taken for kN, its name says 'N'; give its unit in the map"),
        ("V,Weg,Stufe", 'step_kN = { name = "Stufe", unsigned = true }', "by the map, and need a column direction"),
        ("V,Weg,time_s", "[constants]\ntime_s = 1", "column time_s is in the file and among the constants"),
    ],
)
def test_a_file_that_the_map_does_not_fit_is_refused(header, toml, said, tmp_path):
    path = write(tmp_path / "a.csv", f"{header}\n{','.join('1' for _ in header.split(','))}\n")
    with pytest.raises(BadInput) as caught:
        read(path, mapped(tmp_path, toml if toml.startswith("[") else f"[columns]\n{toml}"))
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


def test_dates_are_no_numbers_in_any_unit(tmp_path):
    """A spreadsheet makes one of 1.5, and a date counts from 1970."""
    dates = pd.to_datetime(["2024-05-01", "2024-05-02"])
    path = tmp_path / "a.parquet"
    pd.DataFrame({"record": "a", "Weg": dates, "force_kN": [1.0, 2.0]}).to_parquet(path)
    for unit in ("mm", "in"):
        made = mapped(tmp_path, f'[columns]\ndisplacement_mm = {{ name = "Weg", unit = "{unit}" }}')
        with pytest.raises(BadInput, match=r"column displacement_mm holds '2024-05-01.*not a finite number"):
            check_record_table(made.applied(read_table(path, made.layout), path))


def test_steps_without_a_sign_get_that_of_their_direction(tmp_path):
    path = write(tmp_path / "a.csv", "Art,Stufe\nauf,5000\nab,2500\nab,x\n")
    toml = '[columns]\ndirection = "Art"\nstep_kN = { name = "Stufe", unit = "N", unsigned = true }\n'
    table = read(path, mapped(tmp_path, f'{toml}[values.direction]\nauf = "loading"\nab = "unloading"\n'))
    assert table["step_kN"].tolist() == [5.0, -2.5, "x"]


def test_a_direction_that_is_neither_is_refused_by_its_line(tmp_path):
    path = write(tmp_path / "a.csv", PREAMBLE + ROWS.replace("Entlastung", "Halten"))
    with pytest.raises(
        BadInput, match=r"row 2 \(line 7\), column direction: 'Halten' is neither loading nor unloading"
    ):
        read(path, mapped(tmp_path, MAP))


def test_a_unit_that_is_unknown_in_the_row_of_units_is_refused(tmp_path):
    path = write(tmp_path / "a.csv", "record,displacement_mm,force_kN,time_s\n,mm,kp,s\na,1,2,3\n")
    with pytest.raises(BadInput, match="column 'force_kN': 'kp' is no unit of force_kN; use kN, N, lbf; convert it"):
        read(path, ColumnMap())


def test_the_map_counts_more_than_the_file_and_says_so(tmp_path):
    path = write(tmp_path / "a.csv", "record,displacement_mm,F\n,mm,kN\na,1,2000\n")
    table = read(path, mapped(tmp_path, '[columns]\nforce_kN = { name = "F", unit = "N" }'))
    assert table["force_kN"].to_list() == [2.0]
    assert table.attrs["notes"] == ["column 'F' is read in N as the map says; its row of units says kN"]


#: What 1 of each unit is in ours, by the definition of the units and not by the table of the package.
IN_OURS = {"kN": 1.0, "N": 0.001, "lbf": 0.0044482216152605, "mm": 1.0, "m": 1000.0, "in": 25.4, "s": 1.0, "ms": 0.001}
DIALECTS = [(",", "."), (";", ","), ("\t", ",")]
MEASURED = ["displacement_mm", "force_kN", "time_s"]
FORCES, LENGTHS, TIMES = ("kN", "N", "lbf"), ("mm", "m", "in"), ("s", "ms")
LABELS = st.text(st.characters(codec="utf-8", categories=["L", "N", "S", "Zs"]), min_size=1).map(str.strip).filter(bool)
NUMBERS = st.floats(-1e6, 1e6).filter(lambda x: x == 0 or abs(x) > 1e-6)


@st.composite
def tables(draw: st.DrawFn) -> tuple[pd.DataFrame, ColumnMap, pd.DataFrame, tuple[str, str]]:
    """Return a table of ours, a map, the same table as a lab has it, and its separator and decimal sign."""
    rows = draw(st.integers(1, 4))
    column = lambda cells: draw(st.lists(cells, min_size=rows, max_size=rows))  # noqa: E731
    ours = pd.DataFrame(
        {
            "record": column(LABELS.map("r".__add__)),
            "direction": column(st.sampled_from(["loading", "unloading"])),
            **{name: column(NUMBERS) for name in MEASURED},
        }
    )
    words = dict(zip(("loading", "unloading"), draw(st.permutations(["auf", "ab", "1", "0"])), strict=False))
    units = [draw(st.sampled_from(units)) for units in (LENGTHS, FORCES, TIMES)]
    names = draw(st.lists(LABELS.map("their ".__add__), min_size=5, max_size=5, unique=True))
    theirs = ours.assign(direction=ours["direction"].map(words))
    for name, unit in zip(MEASURED, units, strict=True):
        theirs[name] = ours[name] / IN_OURS[unit]
    named = dict(zip(map(str, ours.columns), names, strict=True))
    columns = {name: {"name": named[name]} for name in ("record", "direction")} | {
        name: {"name": named[name], "unit": unit} for name, unit in zip(MEASURED, units, strict=True)
    }
    values = {"direction": {their: our for our, their in words.items()}}
    column_map = ColumnMap.model_validate({"columns": columns, "values": values})
    return ours, column_map, theirs.set_axis(names, axis=1), draw(st.sampled_from(DIALECTS))


@settings(max_examples=30)
@given(
    tables(), st.sampled_from(["utf-8", "utf-16", "utf-8-sig"]), st.sampled_from(["", "Prüfstand 3\nnoted by hand\n"])
)
def test_a_table_written_under_any_map_reads_back_as_it_was(drawn, encoding, preamble):
    ours, column_map, theirs, (separator, decimal) = drawn
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_bytes((preamble + theirs.to_csv(index=False, sep=separator, decimal=decimal)).encode(encoding))
        back = read(path, column_map)
    assert list(back.columns) == list(ours.columns)
    assert back[["record", "direction"]].to_dict("list") == ours[["record", "direction"]].to_dict("list")
    np.testing.assert_allclose(back[MEASURED].to_numpy(float), ours[MEASURED].to_numpy(float), rtol=1e-14)
