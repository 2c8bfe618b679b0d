"""TDMS through npTDMS: groups, waveform times, units; damaged files are refused in one line."""

from pathlib import Path

import numpy as np
import pytest
from helpers.flipped_bytes import assert_read_or_refused
from nptdms import ChannelObject, RootObject, TdmsWriter

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.recordings.tdms import read_tdms

WAVE = {"wf_increment": 0.001, "wf_start_offset": -0.5, "unit_string": "kN"}


def written(path: Path, *channels: ChannelObject, times: int = 1) -> Path:
    with TdmsWriter(path) as file:
        for _ in range(times):
            file.write_segment([RootObject({"title": "step"}), *channels])
    return path


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "step.tdms"


def test_groups_are_segments_and_times_come_from_the_waveform(path):
    load = ChannelObject("step", "load", np.array([1.5, 2.5, 3.5]), WAVE)
    counts = ChannelObject("step", "counts", np.array([1, 2], dtype=np.int16), {**WAVE, "wf_increment": 0.002})
    later = ChannelObject("tail", "acc", np.array([np.nan, 9.0]), {"wf_increment": 0.1, "NI_UnitDescription": "g"})
    raw = read_tdms(written(path, load, counts, later))
    assert [[one.name for one in channels] for channels in raw.segments] == [["load", "counts"], ["acc"]]
    first, second, third = raw.segments[0][0], raw.segments[0][1], raw.segments[1][0]
    np.testing.assert_allclose(first.time_s, [-0.5, -0.499, -0.498])
    np.testing.assert_allclose(second.time_s, [-0.5, -0.498])
    np.testing.assert_allclose(third.time_s, [0.0, 0.1])
    assert [one.unit for one in (first, second, third)] == ["kN", "kN", "g"]
    assert second.values.tolist() == [1.0, 2.0]
    np.testing.assert_array_equal(third.values, [np.nan, 9.0])
    assert raw.warnings == ()


def test_what_was_written_in_pieces_is_one(path):
    raw = read_tdms(written(path, ChannelObject("g", "a", np.array([1.0, 2.0]), WAVE), times=3))
    assert raw.segments[0][0].values.tolist() == [1.0, 2.0] * 3


@pytest.mark.parametrize(("name", "unit"), [("Time (ms)", ""), ("Time", "ms")])
def test_channels_without_waveform_take_a_channel_of_times_or_count(name, unit, path):
    times = ChannelObject("g", name, np.array([0.0, 10.0, 20.0]), {"unit_string": unit})
    raw = read_tdms(
        written(path, times, ChannelObject("g", "a", np.arange(3.0)), ChannelObject("h", "b", np.arange(2.0)))
    )
    (a,), (b,) = raw.segments
    np.testing.assert_allclose(a.time_s, [0.0, 0.01, 0.02])
    assert b.time_s.tolist() == [0.0, 1.0]
    assert raw.warnings == ("group 'h': 'b': no wf_increment: its time counts samples, not seconds",)


def test_time_stamps_are_times_and_text_is_left_out(path):
    stamps = ChannelObject(
        "g", "time", np.array(["2019-03-01T06:04:45", "2019-03-01T06:04:47"], dtype="datetime64[us]")
    )
    notes = ChannelObject("g", "notes", ["warm", "left"])
    raw = read_tdms(written(path, stamps, notes, ChannelObject("g", "a", np.arange(2.0))))
    assert [one.name for one in raw.segments[0]] == ["a"]
    assert raw.segments[0][0].time_s.tolist() == [0.0, 2.0]
    assert raw.warnings == ("group 'g': 'notes': text or time stamps: left out",)


def test_a_file_that_was_not_finished_is_read_and_said_on_no_stream(path, capfd):
    written(path, ChannelObject("g", "a", np.arange(100.0), WAVE))
    path.write_bytes(path.read_bytes()[:-80])
    raw = read_tdms(path)
    assert len(raw.segments[0][0].values) == 90
    assert "less data than expected" in raw.warnings[0]
    assert capfd.readouterr() == ("", "")


def test_what_is_no_recording_is_refused(path):
    for content in (b"", b"TDSm", b"TDSm" + bytes(24), bytes(range(256)) * 8):
        path.write_bytes(content)
        with pytest.raises(BadInput, match=r"step\.tdms: .*; ") as caught:
            read_tdms(path)
        assert str(caught.value).isprintable()
    with pytest.raises(BadInput, match="no channel of numbers"):
        read_tdms(written(path, ChannelObject("g", "notes", ["warm"])))


def test_flipped_bytes_give_signals_or_the_one_error(path):
    written(path, ChannelObject("g", "a", np.arange(20.0), WAVE), ChannelObject("g", "b", np.arange(5)), times=2)
    assert_read_or_refused(path, read_tdms, times=400)
