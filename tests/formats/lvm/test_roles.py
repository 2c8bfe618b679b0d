"""Columns whose labels are blank or missing: no channel takes the name, unit or readings of its neighbour."""

import pytest
from helpers.lvm_dialects import MULTI, NO_X_ROWS, ROWS, TWO, file_header, segment
from helpers.lvm_refusals import read

ACC, LOAD = [1.0, 1.125, 1.25], [-2.5, -2.25, -2.0]
WITH_X = segment(TWO, ROWS, ["3", "3"], units=["g", "kN"])
WITHOUT_X = segment(TWO, NO_X_ROWS, ["3", "3"], units=["g", "kN"])
NO_X = file_header(X_Columns="No")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "recording.lvm"


@pytest.mark.parametrize(
    "text",
    [
        file_header() + WITH_X.replace("X_Value\t", "\t"),
        file_header() + WITH_X.replace("X_Value\t", ""),
        file_header().replace("X_Columns\tOne\n", "") + WITH_X.replace("X_Value\t", "\t"),
        NO_X + WITHOUT_X.replace("X_Value\t", "\t"),
        NO_X + WITHOUT_X.replace("X_Value\t", ""),
        NO_X + WITHOUT_X.replace("X_Value\t", "\t").replace("Channels\t2\t\n", ""),
        NO_X + WITH_X.replace("X_Value\t", "\t"),
    ],
    ids=[
        "X",
        "X, label left out",
        "X unsaid",
        "no X",
        "no X, label left out",
        "no X, channels unsaid",
        "no X, numbers",
    ],
)
def test_a_blank_first_label_is_that_of_x(path, text):
    raw = read(path, text.encode())
    (channels,) = raw.segments
    assert [(one.name, one.unit, one.values.tolist()) for one in channels] == [("acc", "g", ACC), ("load", "kN", LOAD)]
    assert [one.time_s.round(9).tolist() for one in channels] == [[0.0, 0.1, 0.2]] * 2
    said = ("the header says there is no X, yet its column holds numbers: time is from X0 and Delta_X",)
    assert raw.warnings == (said if text == NO_X + WITH_X.replace("X_Value\t", "\t") else ())


@pytest.mark.parametrize("text", [MULTI.replace("X_Value\tacc", "\tacc"), MULTI.replace("X_Value", "")])
def test_blank_labels_of_several_x_columns(path, text):
    raw = read(path, file_header(X_Columns="Multi", Multi_Headings="Yes") + text)
    (channels,) = raw.segments
    assert [(one.name, one.unit, one.declared_samples) for one in channels] == [("acc", "g", 3), ("load", "kN", 2)]
    assert channels[1].time_s.tolist() == [-1.0, -0.5]
    assert raw.warnings == ()


def test_a_channel_without_a_name_remains_one(path):
    raw = read(path, NO_X + WITHOUT_X.replace("X_Value\tacc", "").replace("\n\t1", "\n1"))
    assert [(one.name, one.unit, one.values.tolist()) for one in raw.segments[0]] == [
        ("", "g", ACC),
        ("load", "kN", LOAD),
    ]


@pytest.mark.parametrize(
    "text",
    [
        file_header() + WITH_X.replace("\tComment\n", '\t""\t \t\n').replace("000\n", "000\t\t\t\n"),
        file_header() + WITH_X.replace("X_Value\tacc\tload\tComment\n", "").replace("000\n", "000\t\t\n"),
        "X_Value\tacc\tload\t\t\n" + ROWS.replace("000\n", "000\t\t\n"),
        ROWS.replace("000\n", "000\t\t\n"),
    ],
    ids=["blank labels", "no labels", "no header", "no header and no labels"],
)
def test_empty_cells_at_the_end_of_rows_are_no_channels(path, text):
    raw = read(path, text)
    assert [one.values.tolist() for one in raw.segments[0]] == [ACC, LOAD]
    assert raw.warnings == ()


def test_a_named_channel_without_readings_at_the_end_remains(path):
    raw = read(path, file_header() + segment(TWO, ROWS.replace("\t-2", "\t").replace(".500000", ""), ["3", "0"]))
    assert [one.name for one in raw.segments[0]] == ["acc", "load"]
