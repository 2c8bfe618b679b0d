"""Tables on disk: files that cannot be read are told in one line, and numbers and names come back exactly."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.table_files import READERS, WRITERS, read_table, write_table
from bayes_tyre.record_table import check_record_table

HEADER = "record,displacement_mm,force_kN\n"
every_format = pytest.mark.parametrize("name", [f"records{suffix}" for suffix in WRITERS])


def refusal(path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        read_table(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert message.isprintable()  # a line break is not
    assert "; " in message  # what is wrong; what to do
    return message


def write(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


@pytest.fixture
def hard_numbers() -> pd.DataFrame:
    """Doubles that few decimals do not hold: random bits, the ends of the range, signed zero, subnormals."""
    bits = np.random.default_rng(7).integers(0, 2**63, 2000, dtype=np.int64).view(np.float64)
    ends = [0.1, 1 / 3, -0.0, 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, 1e23, 9007199254740993.0]
    numbers = np.concatenate([bits[np.isfinite(bits)], ends])
    names = [f"r{i}" for i in range(len(numbers))]
    return pd.DataFrame({"record": names, "displacement_mm": numbers, "force_kN": -numbers, "repeat": 3})


def test_a_missing_file_is_refused(tmp_path):
    assert "no such file" in refusal(tmp_path / "records.csv")


def test_a_folder_is_refused(tmp_path):
    (tmp_path / "records.csv").mkdir()
    assert "is a folder" in refusal(tmp_path / "records.csv")


@pytest.mark.parametrize("name", [f"records{suffix}" for suffix in READERS])
def test_an_empty_file_is_refused(tmp_path, name):
    assert "is empty" in refusal(write(tmp_path / name, b""))


@pytest.mark.parametrize(
    ("name", "said", "remedy"),
    [
        ("records.xls", ".xls", "save it as .xlsx, or the sheet as CSV (UTF-8)"),
        ("records.ODS", ".ODS", "save it as .xlsx, or the sheet as CSV (UTF-8)"),
        ("records.txt", ".txt", "name it .csv"),
        ("records", "no suffix", ""),
        ("a.csv.gz", ".gz", ""),
    ],
)
def test_another_kind_of_file_is_refused_and_told_the_kinds_that_are_read(tmp_path, name, said, remedy):
    message = refusal(write(tmp_path / name, HEADER.encode()))
    assert f"{said} is not a table format; use .csv, .parquet, .xlsx, .mat or .tdx" in message
    assert remedy in message


@every_format
def test_binary_garbage_is_refused(tmp_path, name):
    garbage = bytes(range(255, -1, -1)) * 8
    assert f"cannot be read as {name[8:]}" in refusal(write(tmp_path / name, garbage))


def test_a_parquet_file_cut_short_is_refused(tmp_path, hard_numbers):
    path = write_table(hard_numbers, tmp_path / "records.parquet")
    assert "cannot be read as parquet" in refusal(write(path, path.read_bytes()[:-100]))


@pytest.mark.parametrize("rows", ["r,1,2,3\nr,2,3,4\n", "r,1,2,\nr,2,3,\n", "r,1,2\nr,1,2,3\n"])
def test_rows_longer_than_the_header_are_refused_and_never_move_a_column(tmp_path, rows):
    said = refusal(write(tmp_path / "records.csv", (HEADER + rows).encode()))
    assert "holds 4 cells, the header 3" in said


def test_a_suffix_in_capitals_is_read(tmp_path):
    assert read_table(write(tmp_path / "RECORDS.CSV", (HEADER + "r,1,2\n").encode()))["force_kN"].to_list() == [2]


def test_a_byte_order_mark_and_windows_line_ends_are_read(tmp_path):
    text = HEADER.replace("\n", "\r\n") + "r,1.5,2\r\n"
    table = read_table(write(tmp_path / "excel.csv", text.encode("utf-8-sig")))
    assert table.to_dict("list") == {"record": ["r"], "displacement_mm": [1.5], "force_kN": [2]}


def test_round_trips_through_every_format_are_exact(tmp_path, hard_numbers):
    table = hard_numbers
    for i, suffix in enumerate((*WRITERS, ".csv")):
        table = read_table(write_table(table, tmp_path / f"{i}{suffix}"))
    assert list(table.columns) == list(hard_numbers.columns)
    assert table["record"].to_list() == hard_numbers["record"].to_list()
    assert table["repeat"].to_list() == hard_numbers["repeat"].to_list()
    for column in ("displacement_mm", "force_kN"):
        assert table[column].dtype == np.float64
        np.testing.assert_array_equal(
            table[column].to_numpy().view(np.int64), hard_numbers[column].to_numpy().view(np.int64)
        )


@every_format
@pytest.mark.parametrize("record", ["NA", "1e5", "007", "nan", "None", "true", 'a "quoted", one', "Reifen ⌀", " x "])
def test_a_record_s_name_stays_as_it_is_written(tmp_path, name, record):
    written = pd.DataFrame({"record": [record], "displacement_mm": [1.0], "force_kN": [2.0]})
    table = check_record_table(read_table(write_table(written, tmp_path / name)))
    assert table["record"].to_list() == [record]


@pytest.mark.parametrize("cell", ["", "NA", "nan", "null", "-"])
def test_an_empty_number_is_found_by_its_row_and_not_read_as_missing(tmp_path, cell):
    path = write(tmp_path / "records.csv", f"{HEADER}r,1,2\nr,{cell},3\n".encode())
    with pytest.raises(BadInput, match=r"row 2 \(line 3\), record 'r', column displacement_mm"):
        check_record_table(read_table(path))


def test_a_short_row_is_found(tmp_path):
    path = write(tmp_path / "records.csv", f"{HEADER}r,1,2\nr,2\n".encode())
    with pytest.raises(BadInput, match=r"row 2 \(line 3\), record 'r', column force_kN is empty"):
        check_record_table(read_table(path))


def test_a_header_alone_is_a_table_without_rows(tmp_path):
    with pytest.raises(BadInput, match="no rows"):
        check_record_table(read_table(write(tmp_path / "records.csv", HEADER.encode())))


def test_a_column_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / "twice.csv"
    path.write_text("record,force_kN,force_kN\na,1,2\n")
    with pytest.raises(BadInput, match="column 'force_kN' stands twice"):
        read_table(path)


@pytest.mark.parametrize(
    "error", [MemoryError(), pd.errors.ParserError("Error tokenizing data. C error: out of memory")]
)
def test_a_table_for_which_there_is_no_memory_is_not_called_unreadable(tmp_path, monkeypatch, error):
    def fail(*_, **__):
        raise error

    (tmp_path / "t.csv").write_text("record,displacement_mm,force_kN\na,1,1\n")
    monkeypatch.setattr(pd, "read_csv", fail)
    with pytest.raises(BadInput, match=r"t\.csv: not enough memory for what it claims to hold; give it more memory or"):
        read_table(tmp_path / "t.csv")
