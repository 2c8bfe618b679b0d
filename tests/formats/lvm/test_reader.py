"""The `.lvm` reader: the printed sample, and every dialect that was met, each in a small file written by hand."""

from pathlib import Path

import numpy as np
import pytest
from helpers.lvm_dialects import DATA, FILES, ROWS, SAME, TWO, file_header, segment
from helpers.lvm_refusals import read, refusal

from bayes_tyre.embedded import data_path
from bayes_tyre.formats.lvm.reader import read_lvm
from bayes_tyre.formats.lvm.write import write_lvm
from bayes_tyre.record import Channel, RawSignals

SAMPLE = data_path("sample/appendix_b1.lvm")
NAN = np.nan


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "recording.lvm"


def table(raw: RawSignals) -> list[tuple[str, list[float], list[float]]]:
    """Return name, times and values of the channels of the only segment; times to the microsecond."""
    (channels,) = raw.segments
    return [(one.name, one.time_s.round(6).tolist(), one.values.tolist()) for one in channels]


def channels_of(path: Path, dialect: str) -> tuple[Channel, ...]:
    (channels,) = read(path, FILES[dialect]).segments
    return channels


def test_the_printed_sample():
    raw = read_lvm(SAMPLE)
    (channels,) = raw.segments
    names = [
        "Raw Acc Voltage",
        "Acc m/s^2",
        "Raw Disp Voltage",
        "Disp mm",
        "Raw Load Voltage",
        "Load kN",
        "Time Elapsed",
    ]
    assert [one.name for one in channels] == names
    assert [one.unit for one in channels] == ["Volts"] * 6 + [""]
    assert [one.declared_samples for one in channels] == [150_000] * 6 + [1]
    assert [len(one.values) for one in channels] == [27] * 6 + [1]
    assert channels[0].time_s[:3].tolist() == [0.0, 0.0001, 0.0002]
    assert channels[0].time_s[-1] == 0.0099
    assert channels[5].values[-1] == 30.379580
    assert (channels[6].time_s[0], channels[6].values[0]) == (0.0, 15144.0)
    assert len(raw.warnings) == 1
    assert "27 samples, the header promises 150000" in raw.warnings[0]


@pytest.mark.parametrize("dialect", SAME)
def test_the_same_table_in_every_dialect(path, dialect):
    raw = read(path, FILES[dialect])
    times = [0.0, 0.1, 0.2]
    assert table(raw) == [("acc", times, [1.0, 1.125, 1.25]), ("load", times, [-2.5, -2.25, -2.0])]
    assert raw.warnings == ()
    assert all((one.unit, one.declared_samples) == ("Volts", 3) for one in raw.segments[0])


@pytest.mark.parametrize(
    ("dialect", "encoding", "names", "units"),
    [
        ("latin-1", "latin-1", ["Temp\u00e9rature", "load"], ["\u00b0C", "kN"]),
        ("utf-8 with a mark", "utf-8", ["acc", "load"], ["m/s\u00b2", "\u00b5V"]),
    ],
)
def test_names_and_units_in_other_encodings(path, dialect, encoding, names, units):
    channels = channels_of(path, dialect)
    assert [one.name for one in channels] == names
    assert [one.unit for one in channels] == units
    assert FILES[dialect].removeprefix(b"\xef\xbb\xbf").decode(encoding).startswith("LabVIEW")


def test_an_x_column_for_each_channel(path):
    raw = read(path, FILES["multi"])
    assert table(raw) == [("acc", [0.0, 0.1, 0.2], [1.0, 1.125, 1.25]), ("load", [-1.0, -0.5], [-2.5, -2.25])]
    assert [(one.unit, one.declared_samples) for one in raw.segments[0]] == [("g", 3), ("kN", 2)]
    assert raw.warnings == ()


def test_a_header_without_blank_cells_above_the_x_columns(path):
    text = FILES["multi"].decode().replace("g\t\tkN", "g\tkN").replace("3\t\t2\t", "3\t2\t")
    channels = read(path, text).segments[0]
    assert [(one.unit, one.declared_samples) for one in channels] == [("g", 3), ("kN", 2)]


@pytest.mark.parametrize("dialect", ["segments", "segments without a blank line", "two files"])
def test_several_headers(path, dialect):
    raw = read(path, FILES[dialect])
    assert [[len(one.values) for one in channels] for channels in raw.segments] == [[3, 3], [3, 3]]
    assert raw.segments[0][0].values[0] == 1.0
    assert raw.segments[1][0].values[0] == (1.0 if dialect == "two files" else 9.0)
    np.testing.assert_allclose(raw.segments[1][1].time_s, [0.0, 0.1, 0.2])
    assert raw.warnings == ()


def test_two_writes_under_one_header(path):
    raw = read(path, FILES["two writes"])
    assert table(raw)[0] == ("acc", [0.0, 0.1, 0.2, 0.3, 0.4, 0.5], [1.0, 1.125, 1.25] * 2)
    assert [one.declared_samples for one in raw.segments[0]] == [3, 3]
    assert raw.warnings == ("'acc', 'load': 6 samples, the header promises 3",)


def test_x_that_begins_again_is_kept(path):
    raw = read(path, FILES["X that resets"])
    assert table(raw)[1] == ("load", [0.0, 0.1, 0.2] * 2, [-2.5, -2.25, -2.0] * 2)
    assert raw.warnings == ("'acc', 'load': 6 samples, the header promises 3",)


def test_fewer_rows_than_promised(path):
    raw = read(path, FILES["fewer rows"])
    assert [(len(one.values), one.declared_samples) for one in raw.segments[0]] == [(3, 150_000)] * 2
    assert raw.warnings == ("'acc', 'load': 3 samples, the header promises 150000",)


def test_channels_of_unequal_length(path):
    assert table(read(path, FILES["unequal"]))[1] == ("load", [0.0], [-2.5])
    # The header promises three: the last two are missing, not absent.
    assert channels_of(path, "unequal, cut short")[1].values.tolist() == pytest.approx([-2.5, NAN, NAN], nan_ok=True)
    assert table(read(path, FILES["empty channel"]))[1] == ("load", [], [])
    unsaid = FILES["unequal"].decode().replace("Samples\t3\t1\t\n", "")
    assert table(read(path, unsaid))[1] == ("load", [0.0], [-2.5])


def test_two_rates_in_one_table(path):
    raw = read(path, FILES["two rates"])
    assert table(raw) == [("acc", [0.0, 0.1, 0.2, 0.3], [1.0, 1.1, 1.2, 1.3]), ("load", [0.0, 0.2], [5.0, 6.0])]
    assert raw.warnings == ()


def test_two_rates_in_rows_of_several_writes(path):
    raw = read(path, FILES["two rates, two writes"])
    assert table(raw)[1] == ("load", [0.0, 0.2, 0.4], [5.0, 6.0, 7.0])
    assert len(raw.warnings) == 2


def test_x_is_that_of_the_channel_in_the_notes(path):
    notes = "X values guaranteed valid only for load"
    rows = "-1.0\t1.0\t5.0\n-0.5\t1.1\t6.0\n0.0\t1.2\t7.0\n"
    text = file_header() + segment(("acc", "load"), rows, ["3", "3"], x0=["0", "-1"], delta=["0.1", "0.5"], notes=notes)
    assert [times for _, times, _ in table(read(path, text))] == [[0.0, 0.1, 0.2], [-1.0, -0.5, 0.0]]


def test_x_that_is_blank_where_its_channel_has_ended(path):
    rows = "0.0\t1.0\t5.0\n0.1\t1.1\t6.0\n\t\t7.0\n"
    raw = read(path, file_header() + segment(("acc", "load"), rows, ["2", "3"]))
    assert table(raw) == [("acc", [0.0, 0.1], [1.0, 1.1]), ("load", [0.0, 0.1, 0.2], [5.0, 6.0, 7.0])]
    assert raw.warnings == ("'load': X is blank in 1 rows: taken from Delta_X",)


def test_blank_cells_and_nan(path):
    assert channels_of(path, "empty cells")[0].values.tolist() == pytest.approx([1.0, NAN, 1.25], nan_ok=True)
    acc, load = channels_of(path, "NaN")
    assert acc.values.tolist() == pytest.approx([1.0, NAN, 1.25], nan_ok=True)
    assert load.values.tolist() == pytest.approx([-2.5, NAN, NAN], nan_ok=True)


def test_times_from_x0_and_delta_x(path):
    acc, load = channels_of(path, "negative X0")
    np.testing.assert_allclose(acc.time_s, [-0.5, -0.4, -0.3])
    np.testing.assert_allclose(load.time_s, [-0.25, -0.15, -0.05])
    without = FILES["no X"].decode().replace("Delta_X\t0.100000\t0.100000\t\n", "")
    raw = read(path, without)
    assert raw.segments[0][0].time_s.tolist() == [0.0, 1.0, 2.0]
    assert raw.warnings == ("'acc', 'load': no X and no Delta_X: its time counts samples, not seconds",)


@pytest.mark.parametrize("cut", range(1, 28))
def test_a_row_cut_anywhere_is_left_out_and_said(path, cut):
    raw = read(path, SAME["tab"][:-cut])
    whole = 3 if cut == 1 else 2  # without its line end alone, the row is whole
    assert [len(one.values) for one in raw.segments[0]] == [whole, whole]
    if cut in (1, 28):
        assert raw.warnings == ()
    else:
        assert raw.warnings[0] == "the last row is half written: left out"
        assert raw.warnings[1] == "'acc', 'load': 2 samples, the header promises 3"


def test_a_header_cut_short_at_the_end_is_left_out_and_said(path):
    raw = read(path, FILES["truncated header"])
    assert [len(one.values) for one in raw.segments[0]] == [3, 3]
    assert raw.warnings == ("the file ends in an unfinished header: left out",)


@pytest.mark.parametrize("dialect", [name for name in FILES if name.startswith("plain") and "one" not in name])
def test_no_header(path, dialect):
    raw = read(path, FILES[dialect])
    named = "names" in dialect
    counted = dialect == "plain without X"
    times = [0.0, 1.0, 2.0] if counted else [0.0, 0.1, 0.2]
    names = ("acc", "load") if named else ("column 2", "column 3")
    assert table(raw) == [(names[0], times, [1.0, 1.125, 1.25]), (names[1], times, [-2.5, -2.25, -2.0])]
    assert len(raw.warnings) == counted
    assert all(one.declared_samples is None for one in raw.segments[0])


@pytest.mark.parametrize("separator", ["\t", ";", ",", " "])
@pytest.mark.parametrize(
    "time", ["Time", "acc"]
)  # one that is the name of a line of headers, and X known by its growth
def test_units_stand_below_the_names_of_a_file_without_a_header(path, separator, time):
    rows = [[time, "disp", "load (N)"], ["[ms]", "mm", "kN"], ["0.0", "1.5", "2.5"], ["1.0", "1.25", "3.5"]]
    raw = read(path, "\n".join(separator.join(cell.replace(" ", "_") for cell in row) for row in rows) + "\n")
    times = [0.0, 0.001]
    assert table(raw) == [("disp", times, [1.5, 1.25]), ("load_(N)", times, [2.5, 3.5])]
    assert [one.unit for one in raw.segments[0]] == ["mm", "kN"]
    assert raw.warnings == (f"X {time!r} turned into seconds",)


def test_units_in_the_names_of_a_file_without_a_header(path):
    raw = read(path, "t\tdisp\tload (N)\n0.0\t1.5\t2.5\n0.5\t1.25\t3.5\n")
    assert [one.unit for one in raw.segments[0]] == ["", "N"]


def test_two_lines_above_the_rows_that_are_no_names_and_units_are_refused(path):
    assert "no header, and no rows of numbers" in refusal(path, "t\tdisp\n12\tmm\n0.0\tx\n0.5\t1.25\n1.0\t1.5\n")


def test_no_header_and_one_column(path):
    assert table(read(path, FILES["plain one column"])) == [("column 1", [0.0, 1.0, 2.0], [1.5, 1.25, 3.5])]


def test_what_differs_from_the_header_is_said(path):
    raw = read(path, SAME["tab"].replace("Channels\t2", "Channels\t4").replace("Time\tTime", "Frequency\tTime"))
    assert raw.warnings == ("the header promises 4 channels, the table has 2", "X is 'Frequency', not time")
    raw = read(path, SAME["decimal comma"].replace("Decimal_Separator\t,", "Decimal_Separator\t."))
    assert raw.warnings == ("the header says decimals have a '.', the rows have a ','",)
    assert read(path, SAME["tab"].replace("acc\tload", "acc\tacc")).warnings == (
        "several channels have the name 'acc'",
    )
    empty = DATA[: DATA.index("0.000000\t1")]
    raw = read(path, file_header(Multi_Headings="Yes") + empty + DATA)
    assert raw.warnings == ("segment 1: a header and no rows below it: left out",)
    assert len(raw.segments) == 1


def test_decimal_commas_between_commas_are_refused(path):
    rows = segment(TWO, ROWS.replace(".", ","), ["3", "3"], ",", delta=["0,1"] * 2)
    text = file_header(",", Separator="") + rows
    line = 1 + text[: text.index("0,000000,1")].count("\n")
    said = f": line {line}: has numbers in its Comment: decimals with a comma, it seems; save it with tabs"
    assert said in refusal(path, text)
    one = file_header(",", X_Columns="No", Separator="") + segment(("acc",), "\t1,5\n\t2,5\n", ["2"], ",")
    assert said[-40:] in refusal(path, one)
    assert "its header says decimals have a comma" in refusal(path, file_header(",", Decimal_Separator=",") + rows)
    assert "its header says decimals have a comma" in refusal(path, file_header(",", Decimal_Separator=",,") + rows)
    # Cells with points, or a comment in words, are what they seem.
    commented = SAME["comma"].replace("-2.500000\n", "-2.500000,4,5\n").replace("-2.250000\n", "-2.250000,7\n")
    assert table(read(path, commented)) == table(read(path, SAME["tab"]))


def test_channels_with_x_of_their_own_written_twice(path):
    later = "0.3\t2.0\t0.0\t5.0\n0.4\t2.1\t0.5\t6.0\n0.5\t2.2\t\t\n"
    acc, load = read(path, FILES["multi"] + later.encode()).segments[0]
    assert (len(acc.values), load.values.tolist()) == (6, [-2.5, -2.25, 5.0, 6.0])
    assert load.time_s.tolist() == [-1.0, -0.5, 0.0, 0.5]


def test_a_half_row_at_the_end_of_an_earlier_segment_is_left_out_and_said(path):
    raw = read(path, FILES["segments"].replace(b"0.200000\t1.250000\t-2.000000\n", b"0.200000\t1.\n", 1))
    assert [[len(one.values) for one in channels] for channels in raw.segments] == [[2, 2], [3, 3]]
    assert raw.warnings[0] == "segment 1: the last row is half written: left out"


def test_all_lines_of_the_notes_are_kept(path):
    assert read(path, SAME["notes"]).notes == ("rig warm", "left door open, 3 times", "Speed 15 km/h, load 20 kN")


def test_what_windows_calls_infinite_is_read_and_said(path):
    rows = {"1.125000": "1.#INF", "-2.250000": "-1.#INF00", "-2.000000\n": "1.#QNAN"}
    text = SAME["tab"]
    for before, after in rows.items():
        text = text.replace(before, after)
    raw = read(path, text)
    acc, load = (one.values.tolist() for one in raw.segments[0])
    assert acc == [1.0, np.inf, 1.25]
    assert load == pytest.approx([-2.5, -np.inf, NAN], nan_ok=True)
    assert raw.warnings == ("'acc', 'load': infinite readings: 1",)


def test_a_table_large_enough_to_be_read_in_pieces(path):
    numbers = np.random.default_rng(3).normal(size=(70_000, 7)).round(6)
    times = np.arange(70_000) * 1e-4
    raw = RawSignals((tuple(Channel(f"c{i}", "V", times, column) for i, column in enumerate(numbers.T)),))
    content = write_lvm(raw, path).read_bytes()
    assert len(content) > 2 * 2**21  # two pieces at least, where there are two cores
    middle = content.index(b"\n", len(content) // 2)
    commented = content[:middle] + b"\tstopped\n" + content[middle + 1 :]
    for variant in (content, content.replace(b"\n", b"\r\n"), commented):
        (channels,) = read(path, variant).segments
        np.testing.assert_array_equal(np.column_stack([one.values for one in channels]), numbers)
        np.testing.assert_allclose(channels[0].time_s, times, atol=1e-9)
    line = 2 + content[:middle].count(b"\n")
    faulty = content[: middle + 1] + b"x" + content[middle + 1 :]
    assert f": line {line}, column X_Value: 'x" in refusal(path, faulty)
