"""Runout: known sines are found and removed, and a step keeps its height."""

import math

import numpy as np
import pytest
from helpers.steps_made import RIG, plain

from bayes_tyre.errors import BadInput
from bayes_tyre.signals.runout import Turning, columns_of, nominal_bodies, remove_runout


def test_nominal_turns_follow_from_speed_and_radii():
    wheel, roller = nominal_bodies(RIG, 36.0)
    assert wheel.turn_Hz == pytest.approx(10.0 / (2 * math.pi * 0.536))
    assert roller.turn_Hz == pytest.approx(10.0 / (2 * math.pi * 0.1335))


def test_sines_off_their_nominal_frequency_are_removed():
    clean = plain(start_s=4.0, duration_s=6.0)
    wheel, roller = nominal_bodies(RIG, 20.0)
    turns = (1.023 * wheel.turn_Hz, 0.985 * roller.turn_Hz)
    t = clean.time_s
    sines = 0.5 * np.sin(2 * np.pi * turns[0] * t + 1) + 0.3 * np.sin(6 * np.pi * turns[0] * t)
    sines += 0.8 * np.cos(2 * np.pi * turns[1] * t)
    rough = clean._replace(
        acceleration_m_per_s2=clean.acceleration_m_per_s2 + sines, laser_mm=clean.laser_mm + 0.2 * sines
    )
    found, runout = remove_runout(rough, 7800, (wheel, roller))
    assert [body.turn_Hz for body in runout.bodies] == pytest.approx(turns, rel=1e-3)
    # Noise of 0.02 over 7800 samples and 18 terms: 0.02 sqrt(18 / 7800) = 0.001 inside, some times that beyond.
    assert np.abs(found.acceleration_m_per_s2 - clean.acceleration_m_per_s2).max() < 0.01
    assert np.abs(found.laser_mm - clean.laser_mm).max() < 0.01
    assert np.abs(found.load_kN - clean.load_kN).max() < 0.15
    assert runout.acceleration_rms_m_per_s2 == pytest.approx(np.std(sines), rel=0.02)


def test_powers_of_the_first_harmonic_are_the_sines_of_all():
    bodies, time_s = (Turning(3.1, 5), Turning(11.7, 3)), np.arange(30_000) / 2000.0
    angles = [2 * np.pi * order * body.turn_Hz * time_s for body in bodies for order in range(1, body.harmonics + 1)]
    # An angle of 3300 rad is rounded by 2e-13 already.
    assert np.abs(columns_of(time_s, bodies) - np.concatenate([np.sin(angles), np.cos(angles)])).max() < 2e-12


def test_too_few_turns_are_refused_with_what_it_takes():
    """At 1 km/h the wheel turns 0.082 times a second."""
    with pytest.raises(BadInput, match=r"0.45 s before the step are 0.037 turns .* at 0.082 Hz.* 24 s before the step"):
        remove_runout(plain(start_s=0.5), 900, nominal_bodies(RIG, 1.0))
