"""Several tables at once: files and folders under one map, names that clash, and what is said of them."""

from pathlib import Path

import openpyxl
import pandas as pd
import pytest
from helpers import slow_tests
from helpers.command_line import small, written

import bayes_tyre as bt
from bayes_tyre.errors import BadInput
from bayes_tyre.workflow.load_deflection import SLOW_TESTS
from bayes_tyre.workflow.record_tables import read_given


@pytest.fixture
def halves(tmp_path) -> tuple[Path, Path]:
    """Return two files, each with half the records of the small table."""
    table = small()
    first = table["record"].isin(table["record"].unique()[:3])
    return written(table[first], tmp_path / "a.csv"), written(table[~first], tmp_path / "b.csv")


def refusal(*paths: Path) -> str:
    with pytest.raises(BadInput) as caught:
        read_given(paths)
    assert "; " in str(caught.value)
    return str(caught.value)


def test_files_and_a_folder_give_the_table_that_they_are_parts_of(halves, tmp_path):
    (tmp_path / "~$a.xlsx").touch()
    (tmp_path / "notes.md").touch()
    for paths in (halves, [tmp_path], [tmp_path, halves[0]]):
        given = read_given(paths)
        pd.testing.assert_frame_equal(given.table, read_given([written(small(), tmp_path / ".whole.csv")]).table)
        assert (given.suspicions, given.notes) == ([], [])
    pd.testing.assert_frame_equal(bt.read_records(*halves), given.table)


def test_truth_and_rejected_files_of_a_folder_are_skipped_and_said(halves, tmp_path):
    for name in ("truth.csv", "a_truth.csv", "rejected.csv"):
        (tmp_path / name).write_text("file\nx\n")
    given = read_given([tmp_path])
    assert given.table["record"].nunique() == 6
    skipped = ("a_truth.csv", "rejected.csv", "truth.csv")
    assert given.notes == [f"{tmp_path / name}: no table of records: skipped" for name in skipped]


def test_a_folder_without_a_table_is_refused(tmp_path):
    assert "is a folder without a table" in refusal(tmp_path)


def test_no_file_at_all_is_refused():
    with pytest.raises(BadInput, match="no file to read records from"):
        bt.read_records()


def test_a_file_without_a_record_is_one_named_by_its_file_where_there_are_several(tmp_path):
    table = pd.DataFrame({"displacement_mm": [1.0, 2.0], "force_kN": [1.0, 2.0]})
    paths = [written(table, tmp_path / name) for name in ("V 01.csv", "V 02.csv")]
    assert read_given(paths).table["record"].to_list() == ["V 01", "V 01", "V 02", "V 02"]
    assert "missing column record" in refusal(paths[0])
    book = openpyxl.Workbook()
    for sheet in (book.worksheets[0], book.create_sheet("two")):
        for row in (["displacement_mm", "force_kN"], [1.0, 1.0]):
            sheet.append(row)
    book.save(tmp_path / "c.xlsx")
    sheets = [tmp_path / "c.xlsx#Sheet", tmp_path / "c.xlsx#two"]
    assert read_given(sheets).table["record"].to_list() == ["c Sheet", "c two"]


def test_a_record_in_two_files_is_refused_by_both_names(halves, tmp_path):
    (tmp_path / "below").mkdir()
    copy = written(small(), tmp_path / "below" / "a.csv")
    said = refusal(halves[0], copy)
    assert said.startswith(f"{copy}: record 'single (0)20-10(1)' stands in {halves[0]} too; rename one")


def test_a_column_that_only_some_files_have_is_refused(halves):
    written(pd.read_csv(halves[1]).drop(columns="repeat"), halves[1])
    assert refusal(*halves) == f"{halves[1]}: has no column repeat, which {halves[0]} has; add it, or fit them apart"
    assert refusal(*reversed(halves)).startswith(f"{halves[1]}: has no column repeat, which {halves[0]} has")


def test_a_fault_names_the_file_and_the_line_in_it(halves):
    halves[1].write_text("preamble\n\n" + halves[1].read_text().replace("20.0", "none", 1))
    said = refusal(*halves)
    assert said.startswith(f"{halves[1]}: row 1 (line 4), record ")
    assert "column initial_load_kN holds 'none'" in said


def test_units_that_look_wrong_are_seen_in_one_file_among_others(halves):
    written(pd.read_csv(halves[1]).assign(force_kN=lambda t: t["force_kN"] * 1000), halves[1])
    (suspicion,) = read_given(halves).suspicions
    assert suspicion.startswith(f"{halves[1]}: column force_kN: median |F| is ")


def test_what_was_converted_is_said_once_for_all_files(halves, tmp_path):
    for path in halves:
        header, rest = path.read_text().split("\n", 1)
        names = header.split(",")
        units = [{"force_kN": "kN", "displacement_mm": "m"}.get(name, "") for name in names]
        path.write_text("\n".join([header, ",".join(units), rest]))
    given = read_given(halves)
    sentence = "column 'displacement_mm' is in m by its row of units: converted to mm"
    assert given.notes == [f"{halves[0]} and 1 more: {sentence}"]
    assert given.table.attrs == {}
    with pytest.warns(UserWarning, match="by its row of units: converted to mm"):
        table = bt.read_records(*halves)
    pd.testing.assert_frame_equal(table, given.table)


def test_the_python_face_takes_the_same_map(halves, tmp_path):
    paths = [written(pd.read_csv(path).rename(columns={"force_kN": "F"}), path) for path in halves]
    (tmp_path / "map.toml").write_text('[columns]\nforce_kN = { name = "F", unit = "lbf" }\n')
    table = bt.read_records(*paths, columns=str(tmp_path / "map.toml"))
    assert table["force_kN"].to_list() == pytest.approx([*small()["force_kN"] * 4.4482216152605e-3], rel=1e-14)


def test_slow_tests_are_mapped_and_joined_like_records(tmp_path):
    table = slow_tests.campaign(repeats=1).drop(columns=["test"])
    one = table[(table["configuration"] == "single") & (table["speed_km_h"] == table["speed_km_h"].iloc[0])]
    theirs = one.rename(columns={"load_kN": "Last", "displacement_mm": "Weg"}).assign(Last=one["load_kN"] * 1000)
    paths = [written(theirs, tmp_path / name) for name in ("s1.csv", "s2.csv")]
    (tmp_path / "map.toml").write_text('[columns]\ndisplacement_mm = "Weg"\nload_kN = { name = "Last", unit = "N" }\n')
    given = read_given(paths, tmp_path / "map.toml", SLOW_TESTS)
    assert given.table["test"].unique().tolist() == ["s1", "s2"]
    assert given.suspicions == []
    expected = [*one["load_kN"], *one["load_kN"]]
    assert given.table["load_kN"].to_list() == pytest.approx(expected, rel=1e-14)
