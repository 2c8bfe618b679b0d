"""CSV as labs write it: separators, decimal signs and encodings are read right or refused with what to do."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.formats.tables.column_map import ColumnMap
from bayes_tyre.formats.tables.dialect import find_dialect
from bayes_tyre.formats.tables.header import Layout, units_in
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.record_table import check_record_table
from bayes_tyre.signals.load_deflection import check_load_deflection

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-32")
#: Separator and decimal sign of every dialect that is read.
DIALECTS = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","))


def write(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.write_bytes(text.encode(encoding))
    return path


def semicolons(tmp_path: Path, *rows: str) -> Path:
    return write(tmp_path / "records.csv", "\n".join(["record;displacement_mm;force_kN;pressure_bar", *rows, ""]))


def refusal(path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        check_record_table(read_table(path), str(path))
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert message.isprintable()
    assert "; " in message
    return message


@pytest.fixture
def numbers() -> pd.DataFrame:
    """Doubles that few decimals do not hold, beside labels that hold every separator."""
    bits = np.random.default_rng(11).integers(0, 2**63, 500, dtype=np.int64).view(np.float64)
    bits = bits[np.isfinite(bits)]
    name = 'a,b;c\t"d", 1,5'
    return pd.DataFrame({"record": name, "displacement_mm": bits, "force_kN": -bits, "configuration": "1,5"})


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize(("separator", "decimal"), DIALECTS)
def test_every_dialect_gives_the_same_table_to_the_last_digit(separator, decimal, encoding, numbers, tmp_path):
    text = numbers.to_csv(index=False, sep=separator, decimal=decimal, lineterminator="\r\n")
    table = read_table(write(tmp_path / "records.csv", text, encoding))
    pd.testing.assert_frame_equal(table, numbers, check_dtype=False, check_exact=True)
    assert table["displacement_mm"].dtype == table["force_kN"].dtype == np.float64


@pytest.mark.parametrize(
    ("header", "separator", "names"),
    [
        ("a,b,c", ",", ("a", "b", "c")),
        ("a;b;c", ";", ("a", "b", "c")),
        ("a\tb\tc", "\t", ("a", "b", "c")),
        ("a, b ,c", ",", ("a", "b", "c")),
        ('a,b,"x;y;z;w"', ",", ("a", "b", "x;y;z;w")),
        ('a;b;"x,y,z,w"', ";", ("a", "b", "x,y,z,w")),
        ('"a";"b ""in"", mm, kN";c', ";", ("a", 'b "in", mm, kN', "c")),
        ('"two\nlines, of; one";b;c', ";", ("two\nlines, of; one", "b", "c")),
        ('a;width 5" pipe;c', ";", ("a", 'width 5" pipe', "c")),
        ("force, kN;travel, mm;c;d", ";", ("force, kN", "travel, mm", "c", "d")),
        ("Versuch;Zeit, s;Weg, mm;Kraft, kN", ";", ("Versuch", "Zeit, s", "Weg, mm", "Kraft, kN")),
        ("Zeit, s\tWeg, mm\tKraft, kN", "\t", ("Zeit, s", "Weg, mm", "Kraft, kN")),
        ("alone", ",", ("alone",)),
        ("\r\n  \r\na;b", ";", ("a", "b")),
    ],
)
def test_the_separator_is_found_by_the_rules_of_csv(header, separator, names, tmp_path):
    dialect = find_dialect(write(tmp_path / "records.csv", f"{header}\r\n1,5\r\n"))
    assert (dialect.separator, dialect.names) == (separator, names)


def test_whole_numbers_between_semicolons_are_numbers(tmp_path):
    table = read_table(semicolons(tmp_path, "r;1;-2;8,5", "r;2;3;9"))
    assert table.to_dict("list") == {
        "record": ["r", "r"],
        "displacement_mm": [1, 2],
        "force_kN": [-2, 3],
        "pressure_bar": [8.5, 9.0],
    }


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (["r;1,5;2;3", "r;2.5;3,25;3"], "row 2 (line 3), record 'r', column displacement_mm holds '2.5'"),
        (["r;1.5;2;3", "r;2,5;3;3"], "row 2 (line 3), record 'r', column displacement_mm holds '2,5'"),
        (["r;1,5;2;3", "s;2;3.25;3"], "row 2 (line 3), record 's', column force_kN holds '3.25'"),
        (["r;1.234;2;3", "s;2,5;3;3"], "row 2 (line 3), record 's', column displacement_mm holds '2,5'"),
    ],
)
def test_points_and_commas_in_one_file_are_refused_by_row_and_column(rows, said, tmp_path):
    message = refusal(semicolons(tmp_path, *rows))
    assert said in message
    assert "points and commas; write all decimals in one way" in message


def test_a_further_column_may_have_points_where_the_measured_numbers_have_commas(tmp_path):
    table = read_table(semicolons(tmp_path, "r;1,5;2;8.1", "r;2,5;3;8.2"))
    assert table["displacement_mm"].to_list() == [1.5, 2.5]
    assert table["pressure_bar"].to_list() == ["8.1", "8.2"]
    table = read_table(semicolons(tmp_path, "r;1.5;2;8,1", "r;2.5;3;8,2"))
    assert table["displacement_mm"].to_list() == [1.5, 2.5]
    assert table["pressure_bar"].to_list() == ["8,1", "8,2"]


@pytest.mark.parametrize(
    "cell", ["1.234,5", "1,234.5", "1'234,5", "1\u2019234,5", "1 234,5", "1\u202f234", "1.234.567"]
)
def test_thousands_separators_are_refused(cell, tmp_path):
    message = refusal(semicolons(tmp_path, "r;1,5;2;3", f"r;{cell};2;3"))
    assert "row 2 (line 3), record 'r', column displacement_mm" in message
    assert "a thousands separator; write the number without it" in message


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("1,5", "a comma in a number; write decimals with a point, or put semicolons between the cells"),
        (",5", "a comma in a number"),
        ("-1,5e-3", "a comma in a number"),
        ("1,234.5", "a thousands separator"),
        ("1,234,567", "a thousands separator"),
    ],
)
def test_a_comma_in_a_number_between_commas_is_refused(cell, said, tmp_path):
    text = f'record,displacement_mm,force_kN\nr,1.5,2\nr,"{cell}",3\n'
    message = refusal(write(tmp_path / "records.csv", text))
    assert f"row 2 (line 3), record 'r', column displacement_mm holds {cell!r}: {said}" in message


def test_decimal_commas_without_quotes_between_commas_are_refused_by_row(tmp_path):
    message = refusal(write(tmp_path / "records.csv", "record,displacement_mm,force_kN\nr,1,2\nr,1,5,2\n"))
    assert "row 2 (line 3) holds 4 cells, the header 3; mend the row" in message
    assert "semicolons" in message


BLANKS_AND_COMMAS = ["0,1 2,3 4,5", "0,2 -2,5  5,5", "0,3 2,7E1 6,5"]


BETWEEN_BLANKS = [[], ["Zeit Weg Kraft"], ["Zeit  Weg  Kraft", "s  mm  kN"]]
COMMAS_IN_NAMES = [["Zeit, s Weg, mm Kraft, kN"], ["Reifen A, Rad 3", "Zeit Weg Kraft"]]


@pytest.mark.parametrize("head", [*BETWEEN_BLANKS, *COMMAS_IN_NAMES])
def test_decimal_commas_are_no_separators_where_blanks_are(head, tmp_path):
    path = write(tmp_path / "run.csv", "\n".join([*head, *BLANKS_AND_COMMAS, ""]))
    with pytest.raises(BadInput, match="blanks stand between its cells and commas in its numbers; put semicolons or"):
        read_raw(path)
    if head in BETWEEN_BLANKS:  # as the message says
        assert read_raw(path.rename(tmp_path / "run.txt")).segments[0][-1].values.tolist() == [4.5, 5.5, 6.5]


def test_records_between_blanks_with_decimal_commas_are_refused(tmp_path):
    rows = [f"A {row}" for row in BLANKS_AND_COMMAS]
    path = write(tmp_path / "records.csv", "\n".join(["record time_s displacement_mm force_kN", *rows, ""]))
    with pytest.raises(BadInput, match="blanks stand between its cells"):
        read_table(path, ColumnMap().layout)


def test_a_label_of_two_numbers_is_one_between_commas(tmp_path):
    rows = "displacement_mm,record,force_kN\n0,205 16,0\n0.1,205 16,2\n"
    assert read_table(write(tmp_path / "records.csv", rows))["record"].tolist() == ["205 16", "205 16"]


@pytest.mark.parametrize("above", ["", "Pruefstand 3\n"])
@pytest.mark.parametrize("units", ["", ";mm;kN;\n"])
def test_a_cell_of_several_lines_is_in_one_line_of_a_spreadsheet(above, units, tmp_path):
    head = f'{above}record;displacement_mm;force_kN;"What was\nseen"\n{units}'
    first, line = 'r;1,5;2,5;"cold\nand wet"\n\n', 4 + bool(above) + bool(units)
    layout = Layout(["record", "displacement_mm", "force_kN"].__contains__)
    with pytest.raises(BadInput, match=rf"row 2 \(line {line}\), record 'r', column force_kN"):
        check_record_table(read_table(write(tmp_path / "a.csv", f"{head}{first}r;2,5;n/a;\n"), layout))
    with pytest.raises(BadInput, match=rf"row 2 \(line {line}\) holds 5 cells, the header 4"):
        read_table(write(tmp_path / "b.csv", f"{head}{first}r;2,5;3,5;;1\n"), layout)


@pytest.mark.parametrize("decimal", [",", "."])
def test_one_bad_cell_is_the_one_that_is_named_by_either_decimal_sign(decimal, tmp_path):
    rows = [row.replace(",", decimal) for row in ("r;1,5;2,5;3", "r;2,5;n/a;3", "r;3,5;3,5;3")]
    message = refusal(semicolons(tmp_path, *rows))
    assert "row 2 (line 3), record 'r', column force_kN holds 'n/a'" in message


@pytest.mark.parametrize("blank", ["", " ", "NaN"])
def test_decimal_commas_beside_a_cell_without_a_reading_are_numbers(blank, tmp_path):
    table = read_table(write(tmp_path / "a.csv", f"Zeit;Weg;Bemerkung\n0,1;1,5;1,5\n0,2;{blank};warm\n0,3;2,5;\n"))
    np.testing.assert_array_equal(pd.to_numeric(table["Weg"], errors="coerce"), [1.5, np.nan, 2.5])
    assert table["Bemerkung"].to_list() == ["1,5", "warm", ""]  # text, as it is written


def test_of_a_column_of_loads_the_bad_cell_is_named(tmp_path):
    path = write(tmp_path / "slow.csv", "test;load_kN;displacement_mm\na;20,5;1,5\na;n/a;2,5\na;22,5;3,5\n")
    with pytest.raises(BadInput, match=r"row 2 \(line 3\).*'n/a'"):
        check_load_deflection(read_table(path))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("record;displacement_mm\nä\x81;1\n".encode("latin-1"), "save it again as UTF-8"),
        ("record;displacement_mm\nr;1\n".encode("utf-16-le"), "UTF-16 without its mark; save it as UTF-8"),
        ("record;displacement_mm\nr;1\n".encode("utf-16")[:-1], "save it again as UTF-8"),
        (b"\0" * 4096, "zero bytes"),
        (b"record;displacement_mm\nr\0x;1\n", "'r\\x00x' holds a zero byte"),
        (b"sep=;\nrecord;displacement_mm\nr;1\n", "'sep=', is a hint to a spreadsheet and no header; remove it"),
        (b"record;record\nr;1\n", "column 'record' stands twice; keep one"),
        (b"PK\x03\x04\x14\x00\x06\x00", "a workbook or an archive under the name of a CSV file; save its sheet as CSV"),
        (b"PAR1\x15\x04\x15", "a Parquet file under the name of a CSV file; name it .parquet"),
        (b"\xef\xbb\xbf", "cannot be read as csv"),
        (b'record;displacement_mm\n"r;1\n', "EOF inside string"),
    ],
)
def test_what_is_no_csv_is_refused_with_what_to_do(content, said, tmp_path):
    path = tmp_path / "records.csv"
    path.write_bytes(content)
    assert said in refusal(path)


def test_columns_without_a_name_are_left_out_where_they_hold_nothing(tmp_path):
    text = "record;displacement_mm;force_kN;;\nr;1;2;;\nr;2;3;;\n"
    assert list(read_table(write(tmp_path / "records.csv", text))) == ["record", "displacement_mm", "force_kN"]
    text = "record;displacement_mm;force_kN;;\nr;1;2;;7\nr;2;3;;8\n"
    table = read_table(write(tmp_path / "records.csv", text))
    assert table.iloc[:, -1].to_list() == [7, 8]
    assert table.shape == (2, 4)


def test_tests_that_are_called_01_and_1_are_two(tmp_path):
    path = write(tmp_path / "slow.csv", "test,load_kN,displacement_mm\n01,20,1\n1,20,1\n")
    assert read_table(path)["test"].to_list() == ["01", "1"]


def test_texts_are_units_where_they_begin_as_units_do():
    assert units_in(["[s]", "V", ""], any_units=True) == ("s", "V", "")
    assert units_in(["%", "°C"], any_units=True) == ("%", "°C")
    for missing in (["--", "--"], ["#NV", "#NV"], ["", "V"], ["s", "V", "1,5"]):
        assert units_in(missing, any_units=True) == ()
    assert units_in(["s", "parts"]) == ()
