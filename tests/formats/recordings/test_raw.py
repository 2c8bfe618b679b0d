"""Which reader for which suffix, CSV and Parquet as raw signals, and the recordings of a folder."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.lvm_dialects import FILES, OTHERS, SAME

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.recordings.raw import READERS, raw_files, read_raw
from bayes_tyre.record import RawSignals


def put(path: Path, content: str | bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def listed(raw: RawSignals) -> list[tuple[str, str, list[float], list[float]]]:
    (channels,) = raw.segments
    return [(one.name, one.unit, one.time_s.round(6).tolist(), one.values.tolist()) for one in channels]


TIMES, ACC, LOAD = [0.0, 0.1, 0.2], [1.0, 1.125, 1.25], [-2.5, -2.25, -2.0]


@pytest.mark.parametrize("suffix", [".lvm", ".LVM", ".txt"])
def test_text_by_suffix(tmp_path, suffix):
    raw = read_raw(put(tmp_path / f"step{suffix}", SAME["tab"]))
    assert listed(raw) == [("acc", "Volts", TIMES, ACC), ("load", "Volts", TIMES, LOAD)]


@pytest.mark.parametrize(
    "content",
    [
        "time,acc (g),load\n0,1,-2.5\n0.1,1.125,-2.25\n0.2,1.25,-2\n",
        "acc (g),load,Time [s]\n1,-2.5,0\n1.125,-2.25,0.1\n1.25,-2,0.2\n",
        "run,acc (g),load\n0,1,-2.5\n0.1,1.125,-2.25\n0.2,1.25,-2\n",
        "time_ms;acc (g);load\n0;1;-2,5\n100;1,125;-2,25\n200;1,25;-2\n",
        "Zeit [ms];acc (g);load\n0;1;-2,5\n100;1,125;-2,25\n200;1,25;-2\n",
        "Time [\u03bcs];acc (g);load\n0;1;-2,5\n100000;1,125;-2,25\n200000;1,25;-2\n",
    ],
    ids=["time first", "time last", "the first grows", "semicolons and ms", "another name and ms", "Greek mu"],
)
def test_csv_with_x_by_name_or_first(tmp_path, content):
    raw = read_raw(put(tmp_path / "step.csv", content))
    assert listed(raw) == [("acc (g)", "g", TIMES, ACC), ("load", "", TIMES, LOAD)]
    assert [("turned into seconds" in warning) for warning in raw.warnings] == [True] * (
        "s];" in content or "ms;" in content
    )


@pytest.mark.parametrize("columns", [None, {"time": 1, "force": 3}])
def test_a_row_of_units_below_the_names_of_a_csv_may_hold_volts(columns, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Zeit,Weg,Kraft\ns,V,V\n0,1,2\n10,2,4\n20,3,6\n")
    force = read_raw(path, columns).segments[0][-1]
    assert (force.name, force.unit, force.values.tolist()) == ("Kraft" if columns is None else "force", "V", [2, 4, 6])
    path.write_text("Zeit,Weg,Kraft\n0,one,2\n10,2,4\n20,3,6\n")  # one text among numbers is a wrong cell
    with pytest.raises(BadInput, match=r"row 1, column .*: 'one' is no number"):
        read_raw(path, columns and {"time": 1, "way": 2})


def test_csv_with_preamble_and_a_row_of_units(tmp_path):
    path = tmp_path / "step.csv"
    raw = read_raw(put(path, "Stand 3\n\nTime;acc;load\nms;g;kN\n0;1;-2,5\n100;1,125;-2,25\n200;1,25;-2\n"))
    assert listed(raw) == [("acc", "g", TIMES, ACC), ("load", "kN", TIMES, LOAD)]
    assert listed(read_raw(path, {"time": 1, "cell": 3})) == [("cell", "kN", TIMES, LOAD)]


@pytest.mark.parametrize("content", [SAME["comma"], SAME["tab"], OTHERS["plain comma"], OTHERS["plain semicolon"]])
def test_csv_that_is_a_labview_file_or_has_no_names(tmp_path, content):
    assert [values for *_, values in listed(read_raw(put(tmp_path / "step.csv", content)))] == [ACC, LOAD]


def test_csv_with_gaps_text_and_faults(tmp_path):
    path = tmp_path / "step.csv"
    raw = read_raw(put(path, "time,acc,note,load\n0,1,warm,\n1,,,5\n2, nan ,left,6\n3,2,,\n"))
    assert [one.name for one in raw.segments[0]] == ["acc", "load"]
    np.testing.assert_array_equal(raw.segments[0][0].values, [1, np.nan, np.nan, 2])
    np.testing.assert_array_equal(raw.segments[0][1].values, [np.nan, 5, 6])
    assert raw.warnings == ("column 'note' is text: left out",)
    for content, message in [
        ("time,acc\n0,1\n1,x\n", "row 2, column acc: 'x' is no number"),
        ("time,\x01a\u202ec\n0,1\n1,x\n", "row 2, column \ufffda\ufffdc: 'x' is no number"),
        ("time,acc\n", "holds no numbers"),
        ("", "the file is empty|holds nothing"),
        ("note\nwarm\n", "holds no numbers"),
        ("time,acc\n0,1,2\n", "row 1 .* holds 3 cells"),
    ]:
        with pytest.raises(BadInput, match=message):
            read_raw(put(path, content))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("named.csv", "time_ms,note,acc,load\n0,a,1,-2.5\n100,b,1.125,-2.25\n200,c,1.25,-2\n"),
        ("other.csv", "Zeit [ms],note,acc,load\n0,a,1,-2.5\n100,b,1.125,-2.25\n200,c,1.25,-2\n"),
        ("plain.csv", "0;7;1;-2,5\n0,1;7;1,125;-2,25\n0,2;7;1,25;-2\n"),
        ("plain.txt", "0\t7\t1\t-2.5\n0.1\t7\t1.125\t-2.25\n0.2\t7\t1.25\t-2\n"),
    ],
)
def test_columns_by_number(tmp_path, name, content):
    path = put(tmp_path / name, content)
    listing = listed(read_raw(path, {"time": 1, "column 3": 3, "load": 4}))
    assert [each for each in listing if each[0] != "column 2"] == [
        ("column 3", "", TIMES, ACC),
        ("load", "", TIMES, LOAD),
    ]
    with pytest.raises(BadInput, match=r"column 2 does not hold its time|has 4 columns, no column 5"):
        read_raw(path, {"time": 2, "column 5": 5})


def test_columns_by_number_where_channels_have_names(tmp_path):
    with pytest.raises(BadInput, match="its channels have names, and no numbers"):
        read_raw(put(tmp_path / "step.lvm", SAME["tab"]), {"time": 1, "column 3": 3})


@pytest.mark.parametrize("name", ["Time [ms]", "time_ms", "time (ms)"])
def test_text_with_names_alone_has_their_unit_of_time(name, tmp_path):
    raw = read_raw(put(tmp_path / "step.txt", f"{name}\tacc\tload\n0\t1\t-2.5\n100\t1.125\t-2.25\n200\t1.25\t-2\n"))
    assert listed(raw) == [("acc", "", TIMES, ACC), ("load", "", TIMES, LOAD)]
    assert raw.warnings == (f"X {name!r} turned into seconds",)


def test_a_column_that_is_called_as_a_line_of_a_header_is_one(tmp_path):
    raw = read_raw(put(tmp_path / "step.txt", "Time\tacc\n0,0\t1,0\n0,1\t1,125\n0,2\t1,25\n"))
    assert listed(raw) == [("acc", "", TIMES, ACC)]
    with pytest.raises(BadInput, match="its header has no end"):
        read_raw(put(tmp_path / "cut.txt", "Time\t06:04:45\nDate\t2019/03/01\n"))


@pytest.mark.parametrize("kept", ["index", "timedelta"])
def test_times_of_parquet_that_pandas_keeps_apart(kept, tmp_path):
    table = pd.DataFrame({"time": TIMES, "acc": ACC})
    table = table.set_index("time") if kept == "index" else table.assign(time=pd.to_timedelta(TIMES, unit="s"))
    table.to_parquet(tmp_path / "step.parquet")
    assert listed(read_raw(tmp_path / "step.parquet")) == [("acc", "", TIMES, ACC)]


def test_parquet(tmp_path):
    path = tmp_path / "step.parquet"
    stamps = pd.to_datetime(["2019-03-01 06:04:45", "2019-03-01 06:04:47"])
    pd.DataFrame({"time": stamps, "acc": [1, 2], "on": [True, False], "note": ["a", None]}).to_parquet(path)
    raw = read_raw(path)
    assert listed(raw) == [("acc", "", [0.0, 2.0], [1.0, 2.0])]
    assert raw.warnings == ("column 'on' is text: left out", "column 'note' is text: left out")
    put(path, b"PAR1 and no more")
    with pytest.raises(BadInput, match="cannot be read as parquet"):
        read_raw(path)


def test_no_x_at_all_is_said(tmp_path):
    raw = read_raw(put(tmp_path / "step.csv", "acc,load\n5,1\n3,2\n4,2\n"))
    assert [one.time_s.tolist() for one in raw.segments[0]] == [[0.0, 1.0, 2.0]] * 2
    assert raw.warnings == ("'acc', 'load': no X and no Delta_X: its time counts samples, not seconds",)


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ("0 1 2 3", ""),
        ("0 1 2.05 3", ""),
        ("0 1 2 2.5 3.5", "samples are 1 s apart, but 0.5 s after sample 3"),
        ("0 1 2 4 5 9", "samples are 1 s apart, but 2 s after sample 3 (and 1 more places)"),
        ("0 1 1 2 3", "time does not increase from sample 2 at 1 s to the next at 1 s"),
        ("0 1 2 3 0 1 2 3", "time does not increase from sample 4 at 3 s to the next at 0 s"),
        ("3 2 1 0", "time does not increase from sample 1 at 3 s to the next at 2 s (and 2 more places)"),
    ],
)
def test_an_uneven_time_base_is_said(tmp_path, times, said):
    rows = "".join(f"{time},{i % 2},{i % 3}\n" for i, time in enumerate(times.split()))
    raw = read_raw(put(tmp_path / "step.csv", "time,acc,load\n" + rows))
    assert raw.warnings == ((f"'acc', 'load': {said}",) if said else ())
    assert raw.segments[0][0].time_s.tolist() == [float(time) for time in times.split()]


def test_infinite_times_are_said(tmp_path):
    raw = read_raw(put(tmp_path / "step.csv", "time,acc\n0,1\ninf,2\ninf,3\n"))
    assert raw.warnings


def test_a_csv_column_without_a_name_or_a_reading_is_no_channel(tmp_path):
    raw = read_raw(put(tmp_path / "step.csv", "time,acc (g),load, ,\n0,1,-2.5, ,\n0.1,1.125,-2.25,,\n0.2,1.25,-2,,\n"))
    assert listed(raw) == [("acc (g)", "g", TIMES, ACC), ("load", "", TIMES, LOAD)]


@pytest.mark.parametrize("suffix", READERS)
def test_missing_files_folders_and_other_kinds(tmp_path, suffix):
    with pytest.raises(BadInput, match="no such file"):
        read_raw(tmp_path / f"none{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(BadInput, match="is a folder"):
        read_raw(tmp_path / f"folder{suffix}")
    with pytest.raises(BadInput, match=r"\.wav is no kind of recording; use \.lvm"):
        read_raw(put(tmp_path / "step.wav", b""))
    with pytest.raises(BadInput, match="is a folder; name a file in it"):
        read_raw(tmp_path)


def test_recordings_below_folders(tmp_path):
    def names(*paths: Path) -> list[str]:
        return [path.relative_to(tmp_path).as_posix() for path in raw_files(paths)[0]]

    lab = tmp_path / "lab"
    for name in ("b.lvm", "a/c.TDMS", "a/.hidden.lvm", "truth.csv", "README.txt", "a/notes.md"):
        put(lab / name, b"")
    put(tmp_path / "sheets/one.csv", b"")
    assert raw_files([lab])[1] == []  # the simulator's truth belongs to its recordings
    put(lab / "results.csv", b"")
    put(tmp_path / "sheets/two.xlsx", b"")
    assert names(lab) == ["lab/a/c.TDMS", "lab/b.lvm"]
    assert raw_files([lab])[1] == [f"{lab}: 1 tables beside the recordings are not read; name those that are raw"]
    assert names(tmp_path / "sheets") == ["sheets/one.csv", "sheets/two.xlsx"]
    assert names(lab / "truth.csv", lab / "b.lvm", lab) == ["lab/truth.csv", "lab/b.lvm", "lab/a/c.TDMS"]
    with pytest.raises(BadInput, match="no such file"):
        raw_files([tmp_path / "none"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match="holds no recording"):
        raw_files([tmp_path / "empty"])


def test_every_dialect_reads_through_the_table_of_readers(tmp_path):
    for i, content in enumerate(FILES.values()):
        assert read_raw(put(tmp_path / f"{i}.lvm", content)).segments
