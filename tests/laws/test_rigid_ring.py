"""The rigid ring: against scipy, its frequency response, its static limit, and derivatives of a path in time."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.law_in_time import force_in_time
from helpers.moving_axle import motion
from scipy.integrate import solve_ivp

from bayes_tyre.laws.flexible_ring import FlexibleRing
from bayes_tyre.laws.loop_energy import loop_energy
from bayes_tyre.laws.rigid_ring import RigidRing

K, C, FREQUENCY, DAMPING, RATIO = 1.8, 10.0, 60.0, 0.05, 4.0
LAW = RigidRing(k=K, C=C, belt_frequency=FREQUENCY, belt_damping=DAMPING, sidewall_ratio=RATIO)
# Its springs (kN/mm), belt (kN s^2/mm) and damper (kN s/mm) in plain numbers.
SIDEWALL, RESIDUAL = K * (1 + RATIO), K * (1 + RATIO) / RATIO
BELT = (SIDEWALL + RESIDUAL) / (2 * np.pi * FREQUENCY) ** 2
DAMPER = 2 * DAMPING * BELT * 2 * np.pi * FREQUENCY


def travel(time_s):
    """Return displacement, mm, and its rate, mm/s: from rest, then ringing at 28 Hz."""
    swing, fade = 2 * np.pi * 14.0, np.exp(-5.0 * time_s)
    sine, cosine = np.sin(swing * time_s), np.cos(swing * time_s)
    return 10.0 + 1.5 * sine**2 * fade, 1.5 * fade * (2 * swing * sine * cosine - 5.0 * sine**2)


def by_scipy(times: np.ndarray) -> np.ndarray:
    def rates(t, y):
        d, rate = travel(t)
        return [y[1], (SIDEWALL * (d - y[0]) + DAMPER * (rate - y[1]) - RESIDUAL * y[0]) / BELT]

    at_rest = [travel(0.0)[0] * RATIO / (1 + RATIO), 0.0]
    y = solve_ivp(rates, (0, times[-1]), at_rest, "DOP853", times, rtol=1e-11, atol=1e-12, max_step=1e-3).y
    d, rate = travel(times)
    return SIDEWALL * (d - y[0]) + DAMPER * (rate - y[1]) + C


def stepped(times: np.ndarray) -> np.ndarray:
    """Return the law's force from sample to sample, with the rate at each."""
    d, rate = map(jnp.asarray, travel(times))
    start = jax.tree.map(jnp.asarray, LAW.init(d[0], K * d[0] + C))
    moves = d[1:], jnp.diff(jnp.asarray(times)), rate[1:]
    return np.asarray(jax.lax.scan(lambda state, move: LAW.step_in(state, *move), start, moves)[1])


@pytest.mark.parametrize(("rate_Hz", "most_kN"), [(1000.0, 3e-3), (5000.0, 3e-6), (10_000.0, 2e-7)])
def test_force_is_scipys_whatever_the_sampling_rate(rate_Hz, most_kN):
    """Between samples the way is a cubic: its error falls with the fourth power of their distance."""
    times = np.arange(0.0, 0.3, 1 / rate_Hz)
    assert np.abs(stepped(times) - by_scipy(times)[1:]).max() < most_kN


def test_rates_of_a_path_are_found_from_its_points():
    """By parabolas through three points, which are off by h^2 / 6 times the third derivative."""
    times = np.arange(0.0, 0.3, 2e-4)
    force = force_in_time(LAW, travel(times)[0], K * 10.0 + C, 2e-4)
    np.testing.assert_allclose(force, by_scipy(times), rtol=0, atol=1e-4)


def test_springs_in_series_are_the_static_stiffness():
    assert pytest.approx(K, rel=1e-12) == 1 / (1 / SIDEWALL + 1 / RESIDUAL)
    assert complex(LAW.dynamic_stiffness(0.0)) == pytest.approx(K, rel=1e-12)
    assert float(LAW.belt_kg) == pytest.approx(BELT * 1e6, rel=1e-12)
    d = np.linspace(8.0, 12.0, 9)
    np.testing.assert_allclose(LAW.force(d, K * d[0] + C), K * d + C, rtol=1e-13)


def test_a_start_off_the_line_goes_on_in_parallel_to_it():
    force = LAW.force(np.array([8.0, 12.0, 9.0]), K * 8.0 + C + 0.3)
    np.testing.assert_allclose(force, K * np.array([8.0, 12.0, 9.0]) + C + 0.3, rtol=1e-13)


@pytest.mark.parametrize("frequency_Hz", [5.0, 15.0, 58.0, 90.0])
def test_a_steady_cycle_has_the_frequency_response(frequency_Hz):
    """Force and loss of an oscillation once the belt has forgotten its start."""
    a, omega, turn = 0.5, 2 * np.pi * frequency_Hz, 400
    times = np.arange(round(0.6 * frequency_Hz) * turn + turn) / (turn * frequency_Hz)
    d = 10.0 + a * np.sin(omega * times)
    force = np.asarray(force_in_time(LAW, d, K * 10.0 + C, float(times[1])))[-turn:]
    stiffness = complex(LAW.dynamic_stiffness(omega))
    found = 2j * np.mean((force - force.mean()) * np.exp(-1j * omega * times[-turn:])) / a
    # What is left of the start after 0.6 s is exp(-0.05 2 pi 60 0.6), 1e-5.
    assert found == pytest.approx(stiffness, rel=1e-3)
    assert float(loop_energy(d[-turn:], force)) == pytest.approx(np.pi * a**2 * stiffness.imag, rel=1e-2)


def test_slow_motion_carries_a_part_of_the_belt():
    """At low frequency the stiffness falls by mass times omega^2."""
    omega = 2 * np.pi * 2.0
    fall = K - complex(LAW.dynamic_stiffness(omega)).real
    assert fall == pytest.approx(float(LAW.carried_kg) * 1e-6 * omega**2, rel=3e-3)
    assert float(LAW.carried_kg) == pytest.approx(BELT * 1e6 * (RATIO / (1 + RATIO)) ** 2, rel=1e-12)


def test_the_axle_moves_alike_at_every_sampling_rate():
    """At the samples that 1, 5 and 10 kHz share; steps are of 0.2, 0.2 and 0.1 ms."""
    # The axle of these tests rests on a line of 1.7 kN/mm and 0.3 kN.
    law = RigidRing(k=1.7, C=0.3, belt_frequency=FREQUENCY, belt_damping=DAMPING, sidewall_ratio=RATIO)
    fine = motion(10_000.0, 0.4, law=law)[3]
    for rate, every in ((1000.0, 1), (5000.0, 5)):
        found = motion(rate, 0.4, law=law)[3]
        np.testing.assert_allclose(found.displacement_mm[::every], fine.displacement_mm[::10], rtol=0, atol=2e-6)
        np.testing.assert_allclose(
            found.acceleration_m_per_s2[::every], fine.acceleration_m_per_s2[::10], rtol=0, atol=2e-3
        )


def test_derivatives_along_a_path_in_time_are_those_of_finite_differences():
    d = travel(np.arange(0.0, 0.06, 1e-3))[0]
    values = jnp.array([K, C, FREQUENCY, DAMPING, RATIO])

    @jax.jit
    def forces(values):
        return force_in_time(RigidRing(*values), d, 28.0, 1e-3)

    exact = np.asarray(jax.jit(jax.jacfwd(forces))(values))
    for i, h in enumerate(1e-5 * np.asarray(values)):
        off = jnp.zeros_like(values).at[i].set(h)
        differences = np.asarray(forces(values + off) - forces(values - off)) / (2 * h)
        # Rounding of forces of 30 kN over 2 h, and h^2.
        np.testing.assert_allclose(exact[:, i], differences, rtol=1e-6, atol=2e-14 / h + 1e-8)


def test_its_first_mode_is_mode_1_of_the_flexible_ring_on_the_same_sidewall():
    radius, springs = 500.0, np.array([2.2e-3, 0.7e-3])  # mm; kN/mm^2, radial and tangential
    per_length = BELT / (2 * np.pi * radius)
    # Of a belt that moves by 1 mm the sidewall is stretched by cos radially and by sin tangentially.
    sidewall = np.pi * radius * springs.sum()
    frequency = float(np.sqrt((sidewall + RESIDUAL) / BELT)) / (2 * np.pi)
    law = RigidRing(K, C, frequency, DAMPING, float(sidewall / RESIDUAL))
    radial, tangential = (float(spring / per_length) for spring in springs)
    ring = FlexibleRing(0.0, 0.0, radial, tangential)
    assert float(law.first_mode) == pytest.approx(float(ring.frequencies(np.array([1.0]))[0]), rel=1e-12)
