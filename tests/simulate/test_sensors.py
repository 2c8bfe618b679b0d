"""What the logger writes: names as in appendix B1, the converter's steps, signs, offsets and noise."""

import numpy as np
import pytest

from bayes_tyre.published.tables import raw_sample
from bayes_tyre.record import Channel
from bayes_tyre.rig.axle import Rig, Signs, load_rig
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.plan import quick_plan
from bayes_tyre.simulate.sensors import CONVERTER_STEP_V, channels

RIG = load_rig("single")
TRUTH = draw_truth(quick_plan()[0], RIG, 1)
TIMES = np.arange(40_000) / 10_000


def held(rig: Rig = RIG, d: float = 10.0, a: float = 3.0, load: float = 30.0) -> dict[str, Channel]:
    """Return the channels of an axle that is held at a displacement, an acceleration and a load."""
    flat = np.ones_like(TIMES)
    (segment,) = channels(TRUTH, rig, TIMES, d * flat, a * flat, load * flat).segments
    return {channel.name: channel for channel in segment}


def test_channels_are_those_of_appendix_b1_in_its_order():
    sample = [name for name in raw_sample().columns if name not in ("X_Value", "Comment")]
    found = held()
    assert list(found) == sample
    assert [channel.unit for channel in found.values()] == ["Volts"] * 6 + [""]
    assert [channel.declared_samples for channel in found.values()] == [40_000] * 6 + [1]
    assert found["Time Elapsed"].values == [4500 + 144]


@pytest.mark.parametrize(
    ("volts", "name", "step"),
    [
        ("Raw Acc Voltage", "Acc m/s^2", 0.00153),
        ("Raw Disp Voltage", "Disp mm", 0.01264),
        ("Raw Load Voltage", "Load kN", 0.37348),
    ],
)
def test_readings_go_in_the_converters_steps(volts, name, step):
    found = held()
    steps = found[volts].values / CONVERTER_STEP_V
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-6)
    slope, intercept = np.polyfit(found[volts].values, found[name].values, 1)
    sample = raw_sample()
    np.testing.assert_allclose([slope, intercept], np.polyfit(sample[volts], sample[name], 1), rtol=1e-5)
    levels = np.unique(np.round(found[name].values, 9))
    np.testing.assert_allclose(np.diff(levels).min(), step, rtol=1e-3)


def test_means_are_levers_signs_and_offsets_and_spreads_are_the_noise():
    found = held()
    means = {name: found[name].values.mean() for name in ("Acc m/s^2", "Disp mm", "Load kN")}
    # 40 000 samples: means within 5 standard errors (false alarm 6e-7 each), and the load's step is well dithered.
    assert means["Acc m/s^2"] == pytest.approx(-3.0 * 950 / 1300 + TRUTH.acceleration_offset_m_per_s2, abs=6e-4)
    assert means["Disp mm"] == pytest.approx(10.0 * 950 / 1300 + TRUTH.laser_at_first_touch_mm, abs=4e-4)
    assert means["Load kN"] == pytest.approx(30.0, abs=0.012)
    for name, sd, step in (
        ("Acc m/s^2", TRUTH.noise_acceleration_m_per_s2, 0.00153),
        ("Disp mm", TRUTH.noise_displacement_mm, 0.01264),
        ("Load kN", TRUTH.noise_load_kN, 0.37348),
    ):
        # A spread of 40 000 is known to 0.35 %: five times that.
        assert found[name].values.std() == pytest.approx(np.hypot(sd, step / np.sqrt(12)), rel=0.018)


def test_sensors_have_noise_of_their_own():
    found = held()
    readings = np.array([found[name].values for name in ("Acc m/s^2", "Disp mm", "Load kN")])
    # Correlations of 40 000 independent samples: sd 0.005; three of them within 0.025 (false alarm 2e-6).
    assert np.abs(np.corrcoef(readings)[np.triu_indices(3, 1)]).max() < 0.025


def test_a_rig_whose_sensors_are_the_other_way_round():
    signs = Signs(
        acceleration_positive_upward=False, displacement_grows_downward=False, load_positive_into_rollers=False
    )
    turned, usual = held(RIG.model_copy(update={"signs": signs})), held()
    for name, offset in (
        ("Acc m/s^2", TRUTH.acceleration_offset_m_per_s2),
        ("Disp mm", TRUTH.laser_at_first_touch_mm),
        ("Load kN", 0.0),
    ):
        total = turned[name].values.mean() + usual[name].values.mean()
        assert total == pytest.approx(2 * offset, abs=0.01)


def test_the_laser_reads_661_5_mm_under_30_kN_of_the_single_tyre():
    plan = next(record for record in quick_plan() if record.file == "DynamicS(0)30-20(1).lvm")
    assert 650 < draw_truth(plan, RIG, 0).laser_at_first_touch_mm < 654
