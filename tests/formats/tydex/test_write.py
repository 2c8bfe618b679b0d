"""The text of a TYDEX file: fixed widths that a reader of fixed-width tables finds, and what no field can hold."""

import io

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.formats.tydex.write import Constant, MeasuredChannel, Tydex, tydex_text

HEIGHT = np.array([0.4987, 0.4979999, -1.23456789e-11])
FORCE = np.array([0.0, 12345.6789, -3e300])
FILE = Tydex(
    {"MEASID": "a ~ b\nc ü", "SUPPLIER": "us"},
    [
        MeasuredChannel("DSTGRWHC", "Distance ground to wheel centre, measured", "m", HEIGHT),
        MeasuredChannel("FZW", "Vertical force", "N", FORCE),
    ],
    [Constant("INFLPRES", "Inflation pressure", "bar", "7.25")],
    ["**END", "long " * 60],
)


def section(name: str) -> list[str]:
    lines = tydex_text(FILE).splitlines()
    start = lines.index(name) + 1
    return lines[start : next(i for i in range(start, len(lines)) if lines[i].startswith("**"))]


def test_sections_stand_in_order_and_no_comment_is_taken_for_one():
    keywords = [line for line in tydex_text(FILE).splitlines() if line.startswith("**")]
    assert keywords == ["**HEADER", "**COMMENTS", "**CONSTANTS", "**MEASURCHANNELS", "**MEASURDATA 3", "**END"]
    assert tydex_text(FILE).isascii()
    assert max(map(len, tydex_text(FILE).splitlines())) <= 80


def test_pandas_finds_every_field_at_its_place():
    def fixed(lines: list[str], widths: list[int]) -> list[list[object]]:
        table = pd.read_fwf(io.StringIO("\n".join(lines)), widths=widths, header=None, keep_default_na=False)
        return table.to_numpy().tolist()

    assert fixed(section("**CONSTANTS"), [10, 30, 10, 10]) == [["INFLPRES", "Inflation pressure", "bar", 7.25]]
    assert fixed(section("**MEASURCHANNELS"), [10, 30, 10, 10, 10, 10]) == [
        ["DSTGRWHC", "Distance ground to wheel cent", "m", 1, 0, 0],
        ["FZW", "Vertical force", "N", 1, 0, 0],
    ]
    numbers = np.array(fixed(section("**MEASURDATA 3"), [10, 10]), dtype=float)
    np.testing.assert_allclose(numbers, np.stack([HEIGHT, FORCE], axis=1), rtol=5e-3)
    np.testing.assert_allclose(numbers[:2], np.stack([HEIGHT, FORCE], axis=1)[:2], rtol=1e-6)
    assert section("**HEADER")[0] == "MEASID" + " " * 34 + r"a ~ b c \xfc"


@pytest.mark.parametrize("name", ["", "TWO WORDS", "ELEVENCHARS", "FÜNF"])
def test_a_name_that_its_field_cannot_hold_is_an_error(name):
    with pytest.raises(ValueError, match="no ASCII word"):
        tydex_text(FILE._replace(channels=[MeasuredChannel(name, "", "m", HEIGHT)]))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_are_finite(value):
    with pytest.raises(ValueError, match="not finite"):
        tydex_text(FILE._replace(channels=[MeasuredChannel("FZW", "", "N", np.array([value]))]))
