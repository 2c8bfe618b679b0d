"""The strict reader: the printed sample, and files that are not of its layout."""

import numpy as np
import pytest

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.lvm import read_lvm

SAMPLE = data_path("sample/appendix_b1.lvm")


@pytest.fixture
def text() -> str:
    return SAMPLE.read_text()


def test_the_printed_sample():
    table = read_lvm(SAMPLE)
    assert list(table.columns) == [
        "X_Value",
        "Raw Acc Voltage",
        "Acc m/s^2",
        "Raw Disp Voltage",
        "Disp mm",
        "Raw Load Voltage",
        "Load kN",
        "Time Elapsed",
        "Comment",
    ]
    assert len(table) == 27
    assert table["X_Value"].is_monotonic_increasing
    assert table.loc[0, "Time Elapsed"] == 15144.0
    assert table["Time Elapsed"].isna().sum() == 26
    assert table.loc[0, "Comment"] == "06:04:45"
    assert table.iloc[-1]["Load kN"] == 30.379580
    assert all(table[name].dtype == np.float64 for name in table.columns[:-1])


def test_asterisks_and_windows_line_ends(tmp_path, text):
    path = tmp_path / "windows.lvm"
    starred = text.replace("End_of_Header", "***End_of_Header***").replace("\n", "\r\n")
    path.write_bytes(("LabVIEW Measurement\r\n" + starred).encode())
    assert read_lvm(path).equals(read_lvm(SAMPLE))


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("Separator\tTab", "Separator\tComma", "header Separator is 'Comma'"),
        ("Decimal_Separator\t.", "Decimal_Separator\t,", "header Decimal_Separator is ','"),
        ("X_Columns\tOne", "X_Columns\tMulti", "header X_Columns is 'Multi'"),
        ("Multi_Headings\tNo\t", "Multi_Headings\tYes\t", "header Multi_Headings is 'Yes'"),
        ("X_Value\t", "Time\t", "needs X_Value"),
        ("Disp mm", "Load kN", "each once"),
        ("3.490187", "3,490187", "row 2, column Raw Acc Voltage: '3,490187' is no number"),
        ("30.006036\t\t\n", "30.006036\t\t\t1\n", "10 cells under 9 columns"),
        ("End_of_Header", "Start", "0 End_of_Header lines"),
    ],
)
def test_another_layout_is_refused(tmp_path, text, before, after, message):
    assert before in text
    path = tmp_path / "other.lvm"
    path.write_text(text.replace(before, after))
    with pytest.raises(BadInput) as caught:
        read_lvm(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_empty_cut_and_binary_files(tmp_path, text):
    path = tmp_path / "bad.lvm"
    with pytest.raises(BadInput, match="no such file"):
        read_lvm(path)
    path.write_text("")
    with pytest.raises(BadInput, match="0 End_of_Header"):
        read_lvm(path)
    path.write_text(text[: text.index("0.000000\t")])
    with pytest.raises(BadInput, match="no rows"):
        read_lvm(path)
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(BadInput, match="UTF-8"):
        read_lvm(path)
