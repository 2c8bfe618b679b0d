"""Spring and damper from their free vibration: against its closed form, and against the axle's own motion."""

import numpy as np
import pytest
from helpers.moving_axle import RIG, moved

from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.rig import geometry
from bayes_tyre.rig.motion import Body, Drive, Start, node_times
from bayes_tyre.rig.motion_decay import free_vibration, ring_down

M = 285.0


@pytest.mark.parametrize("ratio", [0.0, 0.01, 0.1, 0.3])
def test_closed_form_gives_back_its_spring_and_damper(ratio):
    k, mass = 1.9, M * 1e-6
    omega, t = np.sqrt(k / mass), np.arange(0.0, 0.4, 1e-4)
    swing = 2.5 * np.exp(-ratio * omega * t) * np.cos(omega * np.sqrt(1 - ratio**2) * t + 0.4)
    found = free_vibration(t, 11.0 + swing, M)
    # Parabolas through samples 0.05 rad apart: their tops are right to (0.05)^4.
    assert found.k_kN_per_mm == pytest.approx(k, rel=1e-5)
    assert found.damping_ratio == pytest.approx(ratio, rel=1e-4, abs=1e-7)
    assert found.c_kN_s_per_mm == pytest.approx(2 * ratio * np.sqrt(k * mass), rel=1e-4, abs=1e-9)


def test_an_axle_on_a_spring_rings_with_its_stiffness_and_damper():
    """Small swings on the rollers: k is the slope of the force at the wheel centre, c the motion's own."""
    law, c = KelvinVoigt(k=1.7, C=0.3), 0.0013
    time_s = np.arange(0.0, 0.4, 2e-4)
    nodes = node_times(time_s, 1)
    load = 20.0
    drive = Drive(nodes, np.full_like(nodes, load), np.zeros_like(nodes))
    rest = _rest(load)
    flat = float(geometry.flat_ground_displacement(RIG, rest + 0.05))
    force = (1.7 * flat + 0.3) * _weight(rest + 0.05)
    found = moved(Body(law, M, c), drive, Start(rest + 0.05, 0.0, force)).at_samples(1)
    decay = free_vibration(time_s, np.asarray(found.displacement_mm), M)
    h = 1e-3
    slope = (_force(rest + h) - _force(rest - h)) / (2 * h)
    assert decay.k_kN_per_mm == pytest.approx(slope, rel=1e-4)
    assert decay.c_kN_s_per_mm == pytest.approx(c, rel=1e-3)


@pytest.mark.parametrize("ratio", [0.02, 0.06])
def test_noisy_readings_give_back_their_spring_and_damper(ratio):
    k, mass, noise = 1.9, M * 1e-6, 0.01
    omega, t = np.sqrt(k / mass), np.arange(0.0, 0.6, 5e-4)
    clean = 6.0 * np.exp(-ratio * omega * t) * np.cos(omega * np.sqrt(1 - ratio**2) * t + 0.4)
    for seed in range(8):
        readings = 9.8 + clean + noise * np.random.default_rng(seed).standard_normal(len(t))
        found = ring_down(t, readings, noise, M)
        # Errors scatter by 0.06 % of k and 0.1 % of the ratio at most: six standard deviations, 16 times two numbers.
        assert found.k_kN_per_mm == pytest.approx(k, rel=0.0036)
        assert found.damping_ratio == pytest.approx(ratio, rel=0.006)


def test_readings_that_hardly_swing_are_refused():
    t = np.arange(0.0, 0.5, 5e-4)
    noise = 0.01 * np.random.default_rng(0).standard_normal(len(t))
    with pytest.raises(ValueError, match="never reaches 10 standard deviations"):
        ring_down(t, noise, 0.01, M)
    with pytest.raises(ValueError, match="turning points"):
        ring_down(t, noise + 3.0 * np.exp(-60 * t), 0.01, M)


def test_what_is_no_free_vibration_is_refused():
    t = np.arange(0.0, 0.1, 1e-4)
    with pytest.raises(ValueError, match="turning points"):
        free_vibration(t, t**2, M)
    with pytest.raises(ValueError, match="grow"):
        free_vibration(t, np.exp(20 * t) * np.cos(300 * t), M)


def _weight(d: float) -> float:
    return float(geometry.curvature_factor(RIG) * geometry.sin_theta(RIG, d))


def _force(d: float) -> float:
    return (1.7 * float(geometry.flat_ground_displacement(RIG, d)) + 0.3) * _weight(d)


def _rest(load: float) -> float:
    d = 10.0
    for _ in range(40):
        d -= (_force(d) - load) / 2.0
    return d
