"""The yardstick of the study of motions: an integrator of its own, and what each departure from the model does."""

import numpy as np
import pytest

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.plan import quick_plan
from bayes_tyre.simulate.simulator import simulate_record
from bayes_tyre.studies.motion_machine import Machine, Path, recorded_on, travelled

RIG = load_rig("single")
PLAN = next(plan for plan in quick_plan() if plan.case.configuration == "single")
TRUTH = draw_truth(PLAN._replace(duration_s=0.4, rate_Hz=5000.0, step_between_s=(0.05, 0.06)), RIG, 7)


@pytest.fixture(scope="module")
def modelled() -> Path:
    return travelled(Machine(), TRUTH, RIG)


def test_the_models_machine_moves_as_the_simulator_says(modelled):
    motion = simulate_record(TRUTH, RIG).motion
    np.testing.assert_allclose(modelled.displacement_mm, motion.displacement_mm, atol=1e-5)
    np.testing.assert_allclose(modelled.acceleration_m_per_s2, motion.acceleration_m_per_s2, atol=3e-4)


@pytest.mark.parametrize(
    "machine",
    [
        Machine(beam_share=0.3),
        Machine(relaxing=0.08),
        Machine(falling=0.15),
        Machine(growth_per_mm=0.03),
        Machine(yields=(0.4, 1.6)),
        Machine(overshoot=0.06),
    ],
)
def test_a_departure_moves_the_axle_by_more_than_noise_and_less_than_a_tenth(machine, modelled):
    other = travelled(machine, TRUTH, RIG)
    off = np.abs(other.acceleration_m_per_s2 - modelled.acceleration_m_per_s2).max()
    assert 2 * TRUTH.noise_acceleration_m_per_s2 < off < 0.3 * np.abs(modelled.acceleration_m_per_s2).max()


def test_friction_of_two_scales_with_one_yield_is_friction_of_one(modelled):
    other = travelled(Machine(yields=(1.0, 1.0)), TRUTH, RIG)
    np.testing.assert_allclose(other.displacement_mm, modelled.displacement_mm, atol=1e-9)


def test_a_laser_lags_and_a_load_cell_feels_its_mass():
    plain, late = (
        {channel.name: channel.values for channel in recorded_on(machine, TRUTH, RIG).segments[0]}
        for machine in (Machine(), Machine(laser_lag_s=1.5e-3, laser_average_s=2e-3, load_cell_kg=12.0))
    )
    differ = [name for name, values in plain.items() if not np.array_equal(values, late[name])]
    assert len(differ) == 4, differ  # laser and load, each as volts and in its unit


def test_a_longer_arm_enlarges_both_sensors_and_a_laser_s_factor_its_own():
    plain, laser, arm = (
        {channel.name: channel.values for channel in recorded_on(machine, TRUTH, RIG).segments[0]}
        for machine in (Machine(), Machine(laser_factor=1.1), Machine(arm_factor=1.1))
    )
    of_laser = {name for name, values in plain.items() if not np.array_equal(values, laser[name])}
    assert len(of_laser) == 2, of_laser  # as volts and in its unit
    of_arm = {name for name, values in plain.items() if not np.array_equal(values, arm[name])}
    assert of_laser < of_arm
    assert len(of_arm) == 4, of_arm
    for name in of_laser:
        np.testing.assert_array_equal(laser[name], arm[name])
    for name in of_arm:
        ratio = np.std(arm[name]) / np.std(plain[name])
        assert ratio == pytest.approx(1.1, rel=0.01)  # noise and converter steps are not enlarged
