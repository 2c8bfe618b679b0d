"""MDF files written by asammdf: groups with times of their own, units, conversions; damage is one error."""

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.recordings import mdf
from bayes_tyre.formats.recordings.channel_groups import segments_of
from bayes_tyre.formats.recordings.mdf import read_mdf
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.record import Channel

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # asammdf's own, at its import
    from asammdf import MDF, Signal

FAST, SLOW = np.arange(5) * 1e-3, np.arange(3) * 0.1


def written(path: Path, *groups: list[Signal]) -> Path:
    with MDF(version="4.10") as file:
        for group in groups:
            file.append(group, common_timebase=True)
        file.save(path, overwrite=True)
    return path


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "step.mf4"


def test_groups_have_their_own_times_and_what_is_no_number_is_said(path):
    counts = Signal(np.arange(5, dtype=np.int16), FAST, name="load", unit="kN", conversion={"a": 2.0, "b": 1.0})
    marked = Signal(np.array([1.0, 2.0, 3.0]), SLOW, name="acc 2", invalidation_bits=np.array([False, True, False]))
    note = Signal(np.array([b"a", b"b", b"c"]), SLOW, name="note", encoding="utf-8")
    raw = read_raw(
        written(
            path,
            [Signal(np.arange(5.0), FAST, name="acc", unit="m/s²"), counts],
            [Signal(np.array([20.0, 21.0, 22.0]), SLOW, name="temperature", unit="°C"), note],
            [marked],
            [Signal(np.empty(0), np.empty(0), name="empty")],
            [Signal(np.zeros(5), FAST + 1, name="load")],
        )
    )
    first, second = raw.segments
    assert [(one.name, one.unit) for one in first[:3]] == [("acc", "m/s²"), ("load", "kN"), ("temperature", "°C")]
    assert [one.name for one in (*first[3:], *second)] == ["acc 2", "load"]
    for one, times in zip((*first, *second), (FAST, FAST, SLOW, SLOW, FAST + 1), strict=True):
        np.testing.assert_allclose(one.time_s, times, rtol=0, atol=1e-12)
    assert first[1].values.tolist() == [1.0, 3.0, 5.0, 7.0, 9.0]
    np.testing.assert_array_equal(first[3].values, [1.0, np.nan, 3.0])
    assert raw.warnings == ("group '2': 'note': text, or several numbers a sample: left out",)


def test_groups_join_unless_they_repeat_a_name():
    def group(*names: str) -> list[Channel]:
        return [Channel(name, "", FAST, FAST) for name in names]

    segments = segments_of([group("a", "b"), [], group("c"), group("d", "a"), group("b")])
    assert [[one.name for one in channels] for channels in segments] == [["a", "b", "c"], ["d", "a", "b"]]


def test_without_asammdf_the_extra_is_named(path, monkeypatch):
    path.write_bytes(b"MDF     ")
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(BadInput, match=r"step\.mf4: MDF files need asammdf: pip install 'bayes-tyre\[mdf\]'"):
        read_mdf(path)


def test_what_is_no_recording_is_refused(path, capfd):
    whole = written(path, [Signal(np.arange(5.0), FAST, name="acc")]).read_bytes()
    for content in (b"not MDF at all", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(BadInput, match=r"step\.mf4: cannot be read as MDF: .*; it may be damaged") as caught:
            read_mdf(path)
        assert str(caught.value).isprintable()
    with pytest.raises(BadInput, match="holds no channel of numbers"):
        read_mdf(written(path, [Signal(np.array([b"a"] * 3), SLOW, name="note", encoding="utf-8")]))
    assert capfd.readouterr() == ("", "")


def test_a_crash_within_asammdf_is_the_one_error(path, monkeypatch, tmp_path):
    program = tmp_path / "program.py"
    program.write_text("import os\nos.abort()\n")
    path.write_bytes(b"MDF     ")
    monkeypatch.setattr(mdf, "_PROGRAM", program)
    with pytest.raises(BadInput, match="asammdf failed on it; it may be damaged"):
        read_mdf(path)
    program.write_text("print('no arrays')\n")
    with pytest.raises(BadInput, match="asammdf failed on it"):
        read_mdf(path)


def test_the_command_starts_without_asammdf():
    code = "import sys, bayes_tyre.formats.recordings.raw; assert 'asammdf' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
