"""The three channels: names, voltages, signs, and recordings that cannot be used."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.steps_made import RIG, plain, raw_of

from bayes_tyre.errors import BadInput
from bayes_tyre.record import RawSignals
from bayes_tyre.rig.axle import Signs
from bayes_tyre.signals.channels import find_channels

SIGNALS = plain()
RAW = raw_of(SIGNALS)


def changed(which: int, **changes: object) -> RawSignals:
    channels = list(RAW.segments[0])
    channels[which] = replace(channels[which], **changes)
    return RawSignals((tuple(channels),))


def test_channels_come_by_name_in_any_order():
    found = find_channels(RawSignals((RAW.segments[0][::-1],)), RIG)
    for one, other in zip(found, SIGNALS, strict=True):
        np.testing.assert_array_equal(one, other)
    assert found.dt_s == pytest.approx(5e-4)


def test_voltages_serve_where_engineering_channels_are_missing():
    volts = (SIGNALS.load_kN - 55.1127) / -2449.02
    found = find_channels(changed(2, name="Raw Load Voltage", values=volts), RIG)
    np.testing.assert_allclose(found.load_kN, SIGNALS.load_kN, rtol=0, atol=1e-9)


def test_signs_of_the_rig_turn_the_readings():
    signs = Signs(acceleration_positive_upward=False, displacement_grows_downward=False)
    found = find_channels(RAW, RIG.model_copy(update={"signs": signs}))
    np.testing.assert_array_equal(found.acceleration_m_per_s2, -SIGNALS.acceleration_m_per_s2)
    np.testing.assert_array_equal(found.laser_mm, -SIGNALS.laser_mm)
    np.testing.assert_array_equal(found.load_kN, SIGNALS.load_kN)


def at_times(time_s: np.ndarray) -> RawSignals:
    return RawSignals((tuple(replace(channel, time_s=time_s) for channel in RAW.segments[0]),))


def with_gap() -> RawSignals:
    return at_times(SIGNALS.time_s + 0.5 * (SIGNALS.time_s > 1.5))


def test_samples_at_the_coarsest_rate_may_be_rounded():
    raw = RawSignals((tuple(replace(one, values=one.values[::4], time_s=one.time_s[::4]) for one in RAW.segments[0]),))
    assert find_channels(raw, RIG).dt_s == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (changed(2, name="Force"), "'Load kN' nor 'Raw Load Voltage', but 'Acc m/s^2', 'Disp mm', 'Force'"),
        (changed(1, name="Acc m/s^2"), "'Acc m/s^2' stands 2 times"),
        (changed(1, contradicting_dt_s=1e-4), "'Disp mm': samples are 0.0005 s apart in the X column, but 0.0001 s by"),
        (changed(1, values=np.full(5000, np.nan)), "'Disp mm' nor"),
        (
            changed(1, values=np.where(np.arange(5000) == 7, np.nan, 1.0)),
            "'Disp mm': no reading in 1 of 5000.*sample 8",
        ),
        (changed(1, values=np.ones(40), time_s=SIGNALS.time_s[:40]), "'Disp mm' has 40 samples"),
        (changed(2, time_s=SIGNALS.time_s + 0.1), "'Acc m/s\\^2' and 'Load kN' are up to 0.1 s apart"),
        (with_gap(), "0.5005 s at 1.5 s"),
        (at_times(np.arange(5000.0)), "5000 samples 1 s apart are 5000 s.*is there a time column, in seconds"),
        (at_times(SIGNALS.time_s * 1e-3), "are 0.0025 s"),
        (changed(1, values=np.full(5000, 661.0)), "'Disp mm': reads 661 in every sample"),
        (changed(0, values=np.clip(SIGNALS.acceleration_m_per_s2, -2.0, 3.0)), "clipped, it stays at 3 m/s^2 for"),
        (RawSignals(RAW.segments * 2), "holds 2 recordings"),
        (RawSignals(()), "no channel"),
    ],
)
def test_what_cannot_be_used_is_named(raw, said):
    with pytest.raises(BadInput, match=said.replace("^", "\\^").replace("\\\\^", "\\^")):
        find_channels(raw, RIG)
