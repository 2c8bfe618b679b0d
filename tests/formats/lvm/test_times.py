"""Times of samples where X column and Delta_X are printed with different digits, or contradict each other."""

from collections.abc import Sequence

import numpy as np
import pytest
from helpers.lvm_dialects import TWO, file_header, segment
from helpers.lvm_refusals import read
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.formats.lvm.channel_header import ChannelHeader, last_digit
from bayes_tyre.formats.lvm.times import even_x
from bayes_tyre.record import RawSignals

DT = 3.90625e-5


@pytest.fixture
def path(tmp_path):
    return tmp_path / "recording.lvm"


def recording(x: Sequence[str], delta: Sequence[str], samples: Sequence[int] | None = None) -> str:
    samples = samples or [len(x)] * 2
    rows = "".join(f"{text}\t{i}.5\t{f'{i}.25' if i < samples[1] else ''}\n" for i, text in enumerate(x))
    return file_header() + segment(TWO, rows, [str(count) for count in samples], delta=delta)


def steps_of(raw: RawSignals) -> list[np.ndarray]:
    return [np.diff(channel.time_s) for channel in raw.segments[0]]


@pytest.mark.parametrize("step", [DT, 3.9e-5], ids=["rounded", "a rounded step added up"])
def test_rounded_x_has_the_spacing_of_delta_x(path, step):
    raw = read(path, recording([f"{2 + i * step:.6f}" for i in range(200)], ["3.906250E-5"] * 2, [200, 120]))
    assert [len(steps) for steps in steps_of(raw)] == [199, 119]
    for steps in steps_of(raw):
        np.testing.assert_allclose(steps, DT, rtol=1e-9)
    assert raw.segments[0][0].time_s[0] == 2.0
    assert raw.warnings == ()


def test_x_with_more_digits_than_delta_x_is_kept(path):
    raw = read(path, recording([f"{i * DT:.9f}" for i in range(50)], ["0.000039"] * 2))
    assert raw.segments[0][0].time_s[-1] == round(49 * DT, 9)
    assert raw.warnings == ()


def test_a_pause_remains_and_each_side_of_it_is_even(path):
    x = [f"{(i + (1000 if i >= 20 else 0)) * DT:.6f}" for i in range(40)]
    steps, _ = steps_of(read(path, recording(x, ["3.906250E-5"] * 2)))
    np.testing.assert_allclose(np.delete(steps, 19), DT, rtol=1e-9)
    np.testing.assert_allclose(steps[19], 1001 * DT, atol=1e-6)


@pytest.mark.parametrize(
    ("step", "delta"),
    [(DT, "0.000100"), (DT, "3.930000E-5"), (3.9e-5, "3.960000E-5")],
    ids=["by far", "by more than rounded ends", "by more than a rounded step"],
)
def test_a_contradiction_is_said_and_x_kept(path, step, delta):
    raw = read(path, recording([f"{i * step:.6f}" for i in range(200)], [delta] * 2))
    assert raw.segments[0][1].time_s[-1] == round(199 * step, 6)
    (warning,) = raw.warnings
    assert warning == f"'acc', 'load': X has steps of 3.9e-05 s, but Delta_X is {float(delta):.6g} s"
    assert all(one.contradicting_dt_s == float(delta) for one in raw.segments[0])


def test_a_channel_of_one_sample_contradicts_nothing(path):
    raw = read(path, recording([f"{i * DT:.6f}" for i in range(200)], ["0.000100"] * 2, [200, 1]))
    assert raw.warnings == ("'acc': X has steps of 3.9e-05 s, but Delta_X is 0.0001 s",)


def test_last_digits_of_printed_numbers():
    assert last_digit(["0.000039", "", "1,5"]) == 0.1
    assert last_digit(["3.906250E-5"]) == pytest.approx(1e-11)
    assert last_digit(["12"]) == 1.0
    assert np.isnan(last_digit(["", "nan", "1e999", "x", "1" * 100]))


@settings(max_examples=100)
@given(st.floats(1e-6, 1.0), st.integers(3, 9), st.integers(2, 60), st.floats(-100, 100))
def test_rounding_alone_is_no_contradiction(dt, decimals, samples, start):
    x = np.array([float(f"{start + i * dt:.{decimals}f}") for i in range(samples)])
    text = f"{dt:.12e}"
    times, other = even_x(x, ChannelHeader("", None, 0.0, float(text), last_digit([text])), 10.0**-decimals)
    assert other is None
    assert times is not None
    np.testing.assert_allclose(np.diff(times), dt, rtol=1e-6, atol=1e-6 * dt + 1e-13)
