"""The writer: the layout of the printed sample, and files that read back to the digits written."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bayes_tyre.embedded import data_path
from bayes_tyre.formats.lvm.reader import read_lvm
from bayes_tyre.formats.lvm.write import write_lvm
from bayes_tyre.record import Channel, RawSignals

SAMPLE = data_path("sample/appendix_b1.lvm")


def channel(name: str, values: object, step: float = 0.0001, start: float = 0.0, unit: str = "V") -> Channel:
    numbers = np.asarray(values, dtype=float)
    return Channel(name, unit, start + step * np.arange(len(numbers)), numbers, len(numbers))


def same(ours: RawSignals, other: RawSignals) -> None:
    """Assert that names, units, promises and times are equal, and values to half the last digit written."""
    assert len(ours.segments) == len(other.segments)
    for mine, theirs in zip(ours.segments, other.segments, strict=True):
        for one, two in zip(mine, theirs, strict=True):
            assert (one.name, one.unit, one.declared_samples) == (two.name, two.unit, two.declared_samples)
            np.testing.assert_allclose(one.values, two.values, rtol=1e-15, atol=0.5e-6)
            np.testing.assert_allclose(one.time_s, two.time_s, rtol=1e-12, atol=1e-12)


def test_the_printed_sample_is_written_in_its_own_layout(tmp_path):
    raw = read_lvm(SAMPLE)
    path = write_lvm(raw, tmp_path / "again.lvm")
    ours = [line.rstrip("\t") for line in path.read_text().replace("***", "").split("\n")]
    theirs = [line.rstrip("\t") for line in SAMPLE.read_text().replace("06:04:45\n", "\n").split("\n")]
    at, there = (next(i for i, line in enumerate(lines) if line.startswith("X_Value")) for lines in (ours, theirs))
    assert ours[at:] == theirs[there:]
    tags = [line.split("\t")[0] for line in ours[:at] if line]
    assert tags[:2] == ["LabVIEW Measurement", "Writer_Version"]
    assert tags[2:] == [line.split("\t")[0] for line in theirs[:there]]
    again = read_lvm(path)
    assert again.warnings == ()
    assert [one.declared_samples for one in again.segments[0]] == [27] * 6 + [1]
    for one, two in zip(again.segments[0], raw.segments[0], strict=True):
        np.testing.assert_array_equal(one.values, two.values)
        np.testing.assert_array_equal(one.time_s, two.time_s)


def test_notes_say_where_it_comes_from(tmp_path):
    raw = RawSignals(((channel("acc", [1, 2, 3]), channel("load", [1])),))
    text = write_lvm(raw, tmp_path / "a.lvm", notes="simulated:\nnot\tmeasured").read_text()
    assert "\nNotes\tsimulated: not measured; X values guaranteed valid only for acc\t" in text
    same(read_lvm(tmp_path / "a.lvm"), raw)


def test_two_rates_segments_gaps_and_names_that_would_break_a_line(tmp_path):
    gaps = [0.5, np.nan, -np.inf, 1e15, np.nan]
    first = (channel("acc\tm/s\u00b2", gaps, unit="m/s\u00b2"), channel("slow", [1, 2], step=0.25, start=-1.0))
    raw = RawSignals((first, (channel("late", [7, 8, 9], start=3.5, step=1 / 51200),)))
    path = write_lvm(raw, tmp_path / "a.lvm")
    again = read_lvm(path)
    assert again.segments[0][0].name == "acc m/s\u00b2"
    assert again.warnings == ("segment 1: 'acc m/s\u00b2': infinite readings: 1",)
    np.testing.assert_array_equal(again.segments[0][0].values, gaps)
    np.testing.assert_allclose(again.segments[0][1].time_s, [-1.0, -0.75])
    np.testing.assert_allclose(np.diff(again.segments[1][0].time_s), 1 / 51200, rtol=1e-6)


def test_whole_or_not_at_all(tmp_path):
    path = write_lvm(RawSignals(((channel("acc", [1, 2]),),)), tmp_path / "a.lvm")
    before = path.read_bytes()
    irregular = Channel("odd", "V", np.array([0.0, 1.0, 5.0]), np.zeros(3))
    for raw, message in [
        (RawSignals(((channel("acc", [1, 2, 3, 4]), irregular),)), "one X column"),
        (RawSignals(((Channel("acc", "V", np.array([0.0, np.nan]), np.zeros(2)),),)), "no number"),
        (RawSignals(((channel("X_Value", [1, 2]),),)), "taken for X"),
        (RawSignals(((),)), "without a channel"),
        (RawSignals(()), "without a channel"),
    ]:
        with pytest.raises(ValueError, match=message):
            write_lvm(raw, path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.lvm"]


names = st.text(st.characters(categories=("L", "N", "P", "S", "Zs"), exclude_characters='"'), min_size=1, max_size=12)
readings = st.floats(-1e9, 1e9) | st.just(np.nan)


type Drawn = list[list[tuple[str, str, float, float, list[float]]]]


@st.composite
def drawn_segments(draw: st.DrawFn) -> Drawn:
    """Draw name, unit, start, step and values of channels, some shorter than others, some at a rate of their own."""
    segments: Drawn = []
    for _ in range(draw(st.integers(1, 3))):
        step, start = draw(st.integers(1, 10_000)) * 1e-6, draw(st.integers(-1000, 1000)) * 1e-3
        rows = draw(st.integers(1, 12))
        segments.append([])
        for i in range(draw(st.integers(1, 4))):
            length = rows if i == 0 else draw(st.integers(0, rows))
            own = step if length in (0, rows) else draw(st.sampled_from([step, 3 * step]))
            values = draw(st.lists(readings, min_size=length, max_size=length))
            name, unit = (" ".join(draw(names).split()) for _ in range(2))
            segments[-1].append(("c" + name, unit, start, own, values))
    return segments


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(drawn=drawn_segments(), notes=names)
def test_what_is_written_reads_back_to_the_digits(tmp_path, drawn, notes):
    raw = RawSignals(
        tuple(
            tuple(channel(name, values, step, start, unit) for name, unit, start, step, values in segment)
            for segment in drawn
        )
    )
    first = write_lvm(raw, tmp_path / "first.lvm", notes=notes)
    again = read_lvm(first)
    same(again, raw)
    assert not [warning for warning in again.warnings if "several channels" not in warning]
    # Digits are kept: rows that were read are written as they were.
    second = write_lvm(again, tmp_path / "second.lvm", notes=notes)
    lines = [path.read_text(encoding="utf-8").split("\n") for path in (first, second)]
    ours, theirs = ([line for line in one if not line.startswith(("X0", "Delta_X"))] for one in lines)
    assert ours == theirs
