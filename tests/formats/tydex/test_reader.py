"""TYDEX files read: what is written comes back, other layouts too, and what cannot be read is named with its line."""

import string
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tydex.reader import read_tydex
from bayes_tyre.formats.tydex.write import Constant, MeasuredChannel, Tydex, tydex_text

WORDS = st.text(string.ascii_uppercase + string.digits, min_size=1, max_size=10).filter(lambda word: word[0].isalpha())
TEXTS = st.text(string.ascii_letters + " ,.()-", max_size=29).map(lambda text: " ".join(text.split()))
NUMBERS = st.floats(-1e12, 1e12, allow_nan=False).map(lambda x: x if abs(x) > 1e-99 else 0.0)

#: A decimal comma, tabs, wider fields, missing offsets and factors, remarks, other letter case, no end.
GENEROUS = """\
Written by hand
**Header
MeasId\t\tTest 12 b
SUPPLIER      who measured it                         A laboratory
**comments
  **not a keyword
**Constants
InflPres  inflation pressure, cold                 bar         7,25
INCLANGL\tinclination angle\tdeg\t0
**MeasurChannels
! name    description                   unit      factor    offsets
RUNTIME   running time                  s
dstgrwhc  Distance ground to wheel centrmm        0.001
FZW                vertical force on the wheel, W axes          kN             1000    0.5     -20
FYW\tlateral force\tN
**MODELDEFINITION 3
whatever
**MEASURDATA 2
     0,000   498.700       1.0       0.0
0.1\t498.2\t1.5E0\t-3
"""


def written(text: str, folder: Path) -> Path:
    path = folder / "test.tdx"
    path.write_text(text, encoding="utf-8")
    return path


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(WORDS, TEXTS, max_size=3),
    st.lists(st.tuples(WORDS, TEXTS, WORDS), min_size=1, max_size=4),
    st.lists(st.builds(Constant, WORDS, TEXTS, WORDS, NUMBERS.map(repr)), max_size=2),
    st.data(),
)
def test_what_is_written_comes_back(tmp_path, header, heads, constants, data):
    rows = data.draw(st.integers(1, 4))
    columns = [np.array(data.draw(st.lists(NUMBERS, min_size=rows, max_size=rows))) for _ in heads]
    channels = [MeasuredChannel(*head, values=values) for head, values in zip(heads, columns, strict=True)]
    read = read_tydex(written(tydex_text(Tydex(header, channels, constants)), tmp_path))
    assert read.header == header
    assert [one[:3] for one in read.channels] == heads
    assert read.constants == constants
    for one, values in zip(read.channels, columns, strict=True):
        # Nine characters hold three digits of a negative number below 0.001, and more of others.
        np.testing.assert_allclose(one.values, values, rtol=5e-3)


def test_numbers_of_a_test_lose_less_than_a_millionth(tmp_path):
    force, deflection = np.linspace(0.0, 99_999.0, 500), np.linspace(0.0, 0.05, 500)
    channels = [MeasuredChannel("FZW", "", "N", force), MeasuredChannel("TYREDEFW", "", "m", deflection)]
    read = read_tydex(written(tydex_text(Tydex({"MEASID": "one"}, channels)), tmp_path))
    np.testing.assert_allclose(read.channels[0].values, force, rtol=1e-6)
    np.testing.assert_allclose(read.channels[1].values, deflection, rtol=1e-5, atol=1e-9)


def test_a_file_of_another_layout_is_read(tmp_path):
    read = read_tydex(written(GENEROUS, tmp_path))
    assert read.header == {"MEASID": "Test 12 b", "SUPPLIER": "A laboratory"}
    assert read.comments == ["**not a keyword"]
    assert [(one.name, one.unit, one.value) for one in read.constants] == [
        ("INFLPRES", "bar", "7,25"),
        ("INCLANGL", "deg", "0"),
    ]
    assert [one[:3] for one in read.channels] == [
        ("RUNTIME", "running time", "s"),
        ("DSTGRWHC", "Distance ground to wheel centr", "mm"),
        ("FZW", "vertical force on the wheel, W axes", "kN"),
        ("FYW", "lateral force", "N"),
    ]
    np.testing.assert_allclose(read.channels[0].values, [0.0, 0.1])
    np.testing.assert_allclose(read.channels[1].values, [0.4987, 0.4982])
    np.testing.assert_allclose(read.channels[2].values, [1.5 * 1000 - 20, 2.0 * 1000 - 20])
    np.testing.assert_allclose(read.channels[3].values, [0.0, -3.0])


def test_numbers_that_fill_their_fields_touch_each_other(tmp_path):
    text = GENEROUS.replace("0.1\t498.2\t1.5E0\t-3", "-1.234E-05-1.234E+02-1.234E-05-1.234E-05")
    assert read_tydex(written(text, tmp_path)).channels[3].values[1] == -1.234e-05


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("**Header", "**Kopf", "has no **HEADER"),
        ("**MeasurChannels", "**Channels", "no channel below **MEASURCHANNELS"),
        ("**MEASURDATA 2", "**MEASURDATA 3", "announces 3 rows and holds 2"),
        ("**MEASURDATA 2", "**MEASURDATUM", "has no row below **MEASURDATA"),
        ("1.5E0\t-3", "1.5E0", "line 20: has 3 values for 4 channels"),
        ("1.5E0", "x", "line 20, FZW: 'x' is no number"),
        ("1.5E0", "nan", "line 20, FZW: 'nan' is no number"),
        ("FYW\tlateral force\tN", "FYW", "line 15: 'FYW' lacks a name, a unit or a value"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_line(old, new, said, tmp_path):
    assert old in GENEROUS
    path = written(GENEROUS.replace(old, new), tmp_path)
    with pytest.raises(BadInput) as refused:
        read_tydex(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert said in str(refused.value)
