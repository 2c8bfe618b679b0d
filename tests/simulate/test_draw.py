"""What is drawn: within the bounds promised, the same whatever else is drawn, and as the printed sample has it."""

import math

import numpy as np
import pytest

from bayes_tyre.published.tables import raw_sample
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.rig.calibration import quantisation_step
from bayes_tyre.simulate.draw import draw_truth, stream
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.simulate.stiffness import case_stiffness
from bayes_tyre.simulate.truth import Runout, Truth

RIGS = {name: load_rig(name) for name in ("single", "dual")}
PLAN = thesis_plan()


def drawn(seed: int) -> list[Truth]:
    return [draw_truth(record, RIGS[record.case.configuration], seed) for record in PLAN]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_truth_is_within_its_bounds(seed):
    for truth in drawn(seed):
        k_beta = truth.k_kN_per_mm * truth.beta_mm
        assert 1.3 * k_beta < truth.x_kN < 4.6 * k_beta
        assert 0.28 < truth.x_kN < 0.64
        assert 0.04 < truth.beta_mm < 0.14
        assert 0 <= truth.rest_friction_kN < truth.x_kN - k_beta
        assert abs(truth.k_kN_per_mm / case_stiffness(truth.plan.case) - 1) < 0.0201
        assert abs(truth.load_before_kN / truth.plan.case.initial_load_kN - 1) < 0.0201
        assert truth.plan.step_between_s[0] <= truth.step_start_s <= truth.plan.step_between_s[1]


def test_an_axle_has_one_mass_a_case_one_damping_and_repeats_scatter():
    truths = drawn(0)
    for name, rig in RIGS.items():
        (mass,) = {truth.m_kg for truth in truths if truth.plan.case.configuration == name}
        assert abs(mass / rig.axle.effective_mass_kg - 1) < 0.201
    for first in range(0, len(truths), 3):
        repeats = truths[first : first + 3]
        assert len({truth.c_kN_s_per_mm for truth in repeats}) == 1
        assert len({truth.k_kN_per_mm for truth in repeats}) == 3
        assert len({truth.beta_mm for truth in repeats}) == 3


def test_a_record_is_the_same_alone_and_another_with_another_seed():
    record = PLAN[200]
    alone = draw_truth(record, RIGS[record.case.configuration], 5)
    assert alone == drawn(5)[200]
    other = draw_truth(record, RIGS[record.case.configuration], 6)
    assert other.k_kN_per_mm != alone.k_kN_per_mm
    assert other.m_kg != alone.m_kg


def test_streams_are_told_apart_by_the_whole_name():
    names = [("a", "b"), ("a", "c"), ("ab",), ("a",), ()]
    assert len({stream(0, *name).random() for name in names}) == len(names)
    assert stream(1, "a").random() != stream(0, "a").random()


def test_what_rolls_turns_at_its_own_rate_and_what_stands_does_not():
    for truth in drawn(0):
        speed = truth.plan.case.speed_km_h
        if speed == 0:
            assert truth.runout == Runout()
            continue
        radius_m = {"single": 0.536, "dual": 0.53775}[truth.plan.case.configuration]
        assert truth.runout.wheel_turn_Hz == pytest.approx(speed / 3.6 / (math.tau * radius_m))
        assert truth.runout.roller_turn_Hz == pytest.approx(speed / 3.6 / (math.tau * 0.1335))
        assert len(truth.runout.wheel_harmonics) == 3
        assert len(truth.runout.roller_harmonics) == 2


def test_a_still_rig_is_as_noisy_as_the_printed_sample():
    sample = raw_sample()
    columns = ("Acc m/s^2", "Disp mm", "Load kN")
    spread = np.array([sample[name].std() for name in columns])
    steps = np.array([quantisation_step(sample[name].to_numpy()) for name in columns])
    expected = np.sqrt(spread**2 - steps**2 / 12)
    truth = drawn(0)[0]
    found = (truth.noise_acceleration_m_per_s2, truth.noise_displacement_mm, truth.noise_load_kN)
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_a_row_names_every_number_once():
    truth = drawn(0)[-1]
    row = truth.row()
    assert row["file"] == "DynamicD(35)30-20(3).lvm"
    assert (row["configuration"], row["step_kN"], row["repeat"]) == ("dual", -10.0, 3)
    assert row["roller_runout_2_mm"] == truth.runout.roller_harmonics[1].amplitude_mm
    assert {"k_kN_per_mm", "x_kN", "beta_mm", "m_kg", "c_kN_s_per_mm", "wheel_runout_3_rad", "road_noise_mm"} <= set(
        row
    )
    assert all(isinstance(value, str | float | int) for value in row.values())
