"""What the `.lvm` reader refuses: always in one line that names the place, however odd the content."""

from pathlib import Path

import numpy as np
import pytest
from helpers.fuzz_lvm import outcome
from helpers.lvm_dialects import BAD, DATA, END, FILES, SAME, file_header, segment
from helpers.lvm_refusals import read, refusal

NAN = np.nan


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "recording.lvm"


@pytest.mark.parametrize("fault", BAD)
def test_no_rows_is_an_error(path, fault):
    assert any(word in refusal(path, BAD[fault]) for word in ("no rows", "no end", "nothing"))


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("1.125000", "1,125000", ", column acc: '1,125000' is no number"),
        ("1.125000", "1.125000x", ", column acc: '1.125000x' is no number"),
        ("1.125000", "0x10", ", column acc: '0x10' is no number"),
        ("1.125000", "1_0", ", column acc: '1_0' is no number"),
        ("1.125000", "\N{ARABIC-INDIC DIGIT ONE}", ", column acc: '\N{ARABIC-INDIC DIGIT ONE}' is no number"),
        ("0.100000\t1", "broken\t1", ", column X_Value: 'broken' is no number"),
        ("-2.250000\n", "-2.250000\t\t\t1\n", ": has 6 cells under 4 columns"),
        ("-2.250000\n", "-2.250000\tnote\t1\n", ": has 5 cells under 4 columns"),
    ],
)
def test_faults_name_the_line(path, before, after, message):
    text = SAME["tab"]
    line = 1 + text[: text.index(before, text.index("X_Value"))].count("\n")
    assert f": line {line}{message}" in refusal(path, text.replace(before, after))


def test_a_damaged_row_above_a_header_is_not_lost_in_it(path):
    text = FILES["segments"].decode().replace("0.200000\t1.25", "o.2ooooo\t1.25", 1)
    line = 1 + text[: text.index("o.2")].count("\n")
    assert f": line {line}: 'o.2ooooo\\t1.250000\\t-2.000000' is neither a row nor of a header" in refusal(path, text)
    no_x = file_header(X_Columns="No") + segment(("acc", "load"), "\t1.0\t2.0\n\t1.#IND\t3.0\n", ["2", "2"])
    raw = read(path, no_x + DATA)
    np.testing.assert_array_equal(raw.segments[0][0].values, [1.0, NAN])


@pytest.mark.parametrize("row", range(3))
def test_a_fault_in_any_row_names_its_line(path, row):
    lines = SAME["tab"].split("\n")
    line = row + 1 + next(i for i, text in enumerate(lines) if text.startswith("0.000000"))
    lines[line - 1] = lines[line - 1].replace(".", ":", 1)
    assert f": line {line}, column X_Value: " in refusal(path, "\n".join(lines))


def test_a_blank_first_cell_is_missed_where_the_header_says_there_is_no_x(path):
    text = SAME["no X"].replace("\n\t", "\n")
    assert "rows lack the blank X cell" in refusal(path, text)


def test_what_is_no_text_is_refused(path):
    assert "zero bytes" in refusal(path, SAME["tab"].encode("utf-16"))
    assert "no rows of numbers" in refusal(path, b"\x89PNG\r\n\x1a\n" + bytes(range(1, 255)))
    assert "no rows of numbers" in refusal(path, "some notes\nof a day on the rig\n")


def test_channels_named_to_deceive_are_text(path):
    name = "\x1b[2J[bold]acc[/bold]"
    text = SAME["tab"].replace("acc", name).replace("1.125000", "x")
    assert "'\\x1b[2J[bold]acc[/bold]': 'x' is no number" in refusal(path, text)
    assert read(path, SAME["tab"].replace("acc", name)).segments[0][0].name == name


@pytest.mark.parametrize(
    ("content", "ends"),
    [
        (b"1" * 10_000_000, "refused"),
        (b"1\t" * 5_000_000, "refused"),
        (b"\t" * 10_000_000, "refused"),
        (b"Channels" * 1_000_000, "refused"),
        ((SAME["tab"] + "\t" * 10_000_000 + "\n").encode(), "read"),
        ((SAME["tab"] + "9" * 10_000_000 + "\n").encode(), "read"),
        ((SAME["tab"] + "Channels\t1\n" * 1_000_000).encode(), "refused"),
        (SAME["tab"].replace("acc\tload", "\t".join(["a"] * 1_000_000)).encode(), "refused"),
        (SAME["tab"].replace("Time\tTime", "\t".join(["Time"] * 1_000_000)).encode(), "read"),
        ((file_header() + f"{END}\n" * 300_000).encode(), "refused"),
        ((file_header() + "***Start_Special***\n" * 300_000).encode(), "refused"),
        ((SAME["tab"] + "0\n" * 1_000_000 + "\t".join(["1"] * 4)).encode(), "read"),
    ],
    ids=lambda value: value if isinstance(value, str) else f"{value[:6]!r} {value[-6:]!r} {len(value)}",
)
def test_odd_content_of_ten_megabytes(path, content, ends):
    assert outcome(content, path) == ends
