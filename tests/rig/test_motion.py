"""The axle's motion: against diffrax and scipy, at rest, at three sampling rates, its energies, what it refuses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.moving_axle import (
    BETA,
    DAMPING,
    FACTOR,
    LAW,
    RIG,
    STEP_START_S,
    C,
    Energies,
    K,
    M,
    Spring,
    X,
    at_rest,
    driven,
    energies,
    fancher_by_scipy,
    motion,
    moved,
    runout,
    spring_by_diffrax,
    to_flat,
)
from jaxtyping import Array
from scipy.interpolate import CubicHermiteSpline

from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.rig import geometry
from bayes_tyre.rig.motion import Body, Drive, Start, move, node_times, rest_displacement, substeps_for


@pytest.mark.parametrize("amplitude", [0.0, 0.3])
def test_a_spring_and_a_damper_move_as_diffrax_says(amplitude):
    drive, substeps = driven(2000.0, 0.5, amplitude)
    start = float(at_rest(0.0))
    d, v = spring_by_diffrax(np.asarray(drive.time_s)[:: 2 * substeps], start, amplitude)
    d_flat, factor = to_flat(start + runout(0.0, amplitude))
    held = Start(start, 0.0, K * d_flat * factor)
    found = moved(Body(Spring(K), M, DAMPING), drive, held).at_samples(substeps)
    np.testing.assert_allclose(found.displacement_mm, d, rtol=0, atol=5e-7)
    np.testing.assert_allclose(found.velocity_mm_per_s, v, rtol=0, atol=5e-5)


def test_fancher_through_reversals_is_what_scipy_says_between_them():
    """Five reversals within 0.25 s of ringing."""
    friction = 0.2
    drive, substeps = driven(10_000.0, 0.3)
    found = moved(Body(LAW, M, DAMPING), drive, Start(at_rest(C + friction))).at_samples(substeps)
    assert np.sum(np.diff(np.sign(np.asarray(found.velocity_mm_per_s)[600:])) != 0) == 5
    expected = fancher_by_scipy(np.asarray(drive.time_s)[:: 2 * substeps], friction)
    np.testing.assert_allclose(found.displacement_mm, expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("beta", [0.01, 0.06, 0.14])
@pytest.mark.parametrize("amplitude", [0.0, 0.3])
def test_sampling_at_1_5_and_10_kHz_gives_one_motion(amplitude, beta):
    law = Fancher(k=K, C=C, x=X, beta=beta)
    fast = motion(10_000.0, 1.0, amplitude, law=law)[3]
    for rate in (1000.0, 5000.0):
        slow, every = motion(rate, 1.0, amplitude, law=law)[3], round(10_000 / rate)
        np.testing.assert_allclose(slow.displacement_mm, fast.displacement_mm[::every], rtol=0, atol=3e-6)
        np.testing.assert_allclose(slow.acceleration_m_per_s2, fast.acceleration_m_per_s2[::every], rtol=0, atol=5e-5)


@pytest.mark.parametrize("amplitude", [0.0, 0.3])
def test_the_error_falls_with_the_step_faster_than_its_square(amplitude):
    fine = motion(1000.0, 0.5, amplitude, 5e-6)[3].displacement_mm
    errors = [
        float(jnp.max(jnp.abs(motion(1000.0, 0.5, amplitude, step)[3].displacement_mm - fine)))
        for step in (1e-3, 2.5e-4, 6.25e-5)
    ]
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 16
    assert errors[2] < errors[1] / 16


def lost_relative(account: Energies) -> float:
    return float(abs(account.applied - account.kinetic - account.tyre - account.damping) / abs(account.applied))


@pytest.mark.parametrize("rate", [1000.0, 5000.0, 10_000.0])
@pytest.mark.parametrize("amplitude", [0.0, 0.3])
def test_the_energy_account_closes(rate, amplitude):
    # To the middle of the ringing, so that the axle still moves, and to its end.
    for duration in (0.1, 2.0):
        body, drive, whole, _ = motion(rate, duration, amplitude)
        account = energies(body, drive, whole)
        assert account.damping > 0
        assert lost_relative(account) < 1e-7
    assert energies(body, drive, whole).kinetic != 0


def test_the_work_on_the_tyre_is_that_of_the_law_along_the_path():
    """Simpson's rule over time against the law stepped along the path in hundredths of a step, over displacement."""
    body, drive, whole, _ = motion(10_000.0, 0.5)
    d = np.asarray(whole.displacement_mm)
    nodes = np.asarray(drive.time_s)
    fine = np.interp(np.arange(0, len(d) - 1, 0.02), np.arange(len(d)), np.arange(len(d)))
    path = CubicHermiteSpline(nodes, d, np.asarray(whole.velocity_mm_per_s))(np.interp(fine, np.arange(len(d)), nodes))
    sine = np.asarray(geometry.sin_theta(RIG, path))
    start_kN = float(whole.tyre_force_kN[0]) / (FACTOR * sine[0])
    force = np.asarray(jax.jit(lambda path: LAW.force(path, start_kN))(path * sine)) * FACTOR * sine
    work = np.trapezoid(force, path)
    assert float(energies(body, drive, whole).tyre) == pytest.approx(work, rel=1e-6)


def test_without_damping_the_axle_rings_down_by_friction_alone():
    drive, _ = driven(5000.0, 1.0)
    body = Body(LAW, M, 0.0)
    whole = moved(body, drive, Start(at_rest()))
    speed = np.abs(np.asarray(whole.velocity_mm_per_s))
    assert speed[-2000:].max() < 0.2 * speed.max()
    account = energies(body, drive, whole)
    assert account.damping == 0
    assert lost_relative(account) < 1e-7


def test_at_rest_it_stays_at_rest():
    settled = X - K * BETA
    for friction in (-0.9 * settled, 0.0, 0.9 * settled):
        drive, _ = driven(10_000.0, STEP_START_S)
        start = at_rest(C + friction)
        whole = moved(Body(LAW, M, DAMPING), drive, Start(start))
        np.testing.assert_allclose(whole.displacement_mm, float(start), rtol=0, atol=1e-12)
        assert float(jnp.max(jnp.abs(whole.acceleration_m_per_s2))) < 1e-9


def test_the_rest_displacement_carries_its_load():
    for k, load in [(1.3, 3.0), (1.7, 30.0), (2.8, 40.0)]:
        force = geometry.tyre_load(RIG, load)
        d_flat, F_flat = geometry.flat_ground_start(RIG, load, k)
        d = rest_displacement(RIG, force, k=k)
        np.testing.assert_allclose(geometry.flat_ground_displacement(RIG, d), d_flat, rtol=1e-12)
        lifted = rest_displacement(RIG, force, k=k, offset_kN=0.7)
        carried = k * geometry.flat_ground_displacement(RIG, lifted) + 0.7
        np.testing.assert_allclose(geometry.flat_ground_force(RIG, force, lifted), carried, rtol=1e-12)
        assert F_flat == pytest.approx(k * d_flat)


def of_parameters(p: Array, drive: Drive, substeps: int) -> Array:
    k, x, beta, m, c = p
    start = rest_displacement(RIG, jnp.asarray(drive.applied_kN)[0], k=k, offset_kN=C)
    body = Body(Fancher(k=k, C=C, x=x, beta=beta), m, c)
    found = move(RIG, body, drive, Start(start - jnp.asarray(drive.runout_mm)[0])).at_samples(substeps)
    return jnp.stack([found.displacement_mm, found.acceleration_m_per_s2])


@pytest.mark.parametrize("amplitude", [0.0, 0.3])
def test_forward_derivatives_are_those_of_finite_differences(amplitude):
    drive, substeps = driven(2000.0, 0.4, amplitude)
    p = jnp.array([K, X, BETA, M, DAMPING])
    value = jax.jit(lambda p: of_parameters(p, drive, substeps))
    jacobian = np.asarray(jax.jit(jax.jacfwd(lambda p: of_parameters(p, drive, substeps)))(p))
    assert np.all(np.isfinite(jacobian))
    for i in range(len(p)):
        h = 1e-5 * p[i]
        plus, minus = value(p.at[i].add(h)), value(p.at[i].add(-h))
        by_hand = np.asarray(plus - minus) / (2 * h)
        # Reversals kink the second derivative, so that differences are good to a few 1e-5 of the largest.
        for row in range(2):
            largest = np.abs(by_hand[row]).max()
            np.testing.assert_allclose(jacobian[row, :, i], by_hand[row], rtol=0, atol=1e-4 * largest)


def test_vmap_over_records_is_a_loop():
    drive, substeps = driven(1000.0, 0.2)
    p = jnp.array([[K, X, BETA, M, DAMPING], [2.4, 0.5, 0.12, 340.0, 0.002]])
    together = jax.jit(jax.vmap(lambda p: of_parameters(p, drive, substeps)))(p)
    for row in range(2):
        np.testing.assert_allclose(together[row], of_parameters(p[row], drive, substeps), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("x", "beta"), [(0.1, BETA), (0.3, 0.2), (0.4, 0.0), (0.4, -0.1), (float("nan"), BETA)])
def test_a_law_that_makes_energy_is_refused(x, beta):
    drive, _ = driven(1000.0, 0.1)
    with pytest.raises(ValueError, match="makes energy"):
        move(RIG, Body(Fancher(k=K, C=C, x=x, beta=beta), M, DAMPING), drive, Start(13.0))


def test_a_known_law_is_refused_under_a_trace_and_a_traced_one_is_not():
    drive, _ = driven(1000.0, 0.1)
    energetic = Body(Fancher(k=K, C=C, x=0.1, beta=0.2), M, DAMPING)
    with pytest.raises(ValueError, match="makes energy"):
        jax.jit(lambda drive: move(RIG, energetic, drive, Start(13.0)))(drive)
    assert moved(energetic, drive, Start(13.0)).displacement_mm.shape == (len(np.asarray(drive.time_s)),)


def test_one_of_many_laws_that_makes_energy_is_refused():
    stacked = jax.vmap(lambda x: Fancher(k=K, C=C, x=x, beta=BETA))
    stacked(jnp.array([0.2, K * BETA])).check()
    with pytest.raises(ValueError, match="makes energy"):
        stacked(jnp.array([0.2, 0.05])).check()


def test_below_the_bound_the_motion_would_indeed_gain_energy():
    drive, _ = driven(5000.0, 1.0)
    whole = moved(Body(Fancher(k=K, C=C, x=0.5 * K * BETA, beta=BETA), M, 0.0), drive, Start(at_rest()))
    speed = np.abs(np.asarray(whole.velocity_mm_per_s))
    assert speed[-2000:].max() > 1.1 * speed[: len(speed) // 2].max()


def test_single_precision_is_refused():
    with jax.enable_x64(False), pytest.raises(RuntimeError, match="prepare_jax"):
        move(RIG, Body(LAW, M, DAMPING), Drive(np.zeros(3), np.ones(3), np.zeros(3)), Start(1.0))


@pytest.mark.parametrize(("dt", "substeps"), [(1e-3, 5), (2e-4, 1), (1e-4, 1), (2.1e-4, 2), (1 / 3000, 2)])
def test_steps_between_samples(dt, substeps):
    assert substeps_for(dt) == substeps
    time_s = np.array([0.0, dt, 3 * dt])
    nodes = node_times(time_s, substeps)
    assert len(nodes) == 4 * substeps + 1
    np.testing.assert_array_equal(nodes[:: 2 * substeps], time_s)
    np.testing.assert_allclose(np.diff(nodes)[: 2 * substeps], dt / (2 * substeps), rtol=1e-12)
