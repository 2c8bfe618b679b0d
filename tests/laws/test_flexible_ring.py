"""The flexible ring: its limits in closed form, and the modes of a polygon of masses and springs, also as it turns."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from bayes_tyre.laws.flexible_ring import FlexibleRing

#: 1/s^2, such that every term of mode 3 counts.
TENSION = 2e4
RING = FlexibleRing(bending=600.0, tension=TENSION, radial=2e5, tangential=6e4)
MODES = np.array([0.0, 1.0, 2.0, 3.0])
#: Nodes of the polygon; stretch stiffness EA / (rho A R^2), 1/s^2: far above all else, so that it does not stretch.
NODES, STRETCH = 96, 1e9


def squared(ring: FlexibleRing, mode: float) -> float:
    """Return the square of a natural angular frequency at rest, 1/s^2."""
    return float((2 * np.pi * ring.frequencies(np.array([mode]))[0]) ** 2)


def test_mode_1_is_the_rigid_ring_whatever_bending_and_tension():
    assert squared(RING, 1.0) == pytest.approx((2e5 + 6e4) / 2, rel=1e-12)
    assert squared(RING, 0.0) == pytest.approx(6e4, rel=1e-12)


@pytest.mark.parametrize("n", [2.0, 3.0, 7.0])
def test_a_free_ring_has_the_frequencies_of_bending_and_of_tension_alone(n):
    free = FlexibleRing(bending=600.0, tension=0.0, radial=0.0, tangential=0.0)
    assert squared(free, n) == pytest.approx(600.0 * n**2 * (n**2 - 1) ** 2 / (n**2 + 1), rel=1e-12)
    taut = FlexibleRing(bending=0.0, tension=2e4, radial=0.0, tangential=0.0)
    assert squared(taut, n) == pytest.approx(2e4 * n**2 * (n**2 - 1) / (n**2 + 1), rel=1e-12)


def test_tension_alone_is_a_string_for_short_waves_and_its_centrifugal_one_carries_a_wave_that_stands():
    taut = FlexibleRing(bending=0.0, tension=2e4, radial=0.0, tangential=0.0)
    assert squared(taut, 200.0) == pytest.approx(2e4 * 200.0**2, rel=1e-4)
    # Under centrifugal tension waves are as fast as the belt: against the rotation they stand, with it they go twice.
    loose = FlexibleRing(bending=0.0, tension=0.0, radial=0.0, tangential=0.0)
    with_it, against = 2 * np.pi * loose.frequencies(np.full(2, 200.0), 50.0, np.array([1.0, -1.0]))
    assert (float(with_it), float(against)) == (pytest.approx(2 * 200 * 50.0, rel=1e-4), pytest.approx(0, abs=1e-9))


def polygon_frequencies(ring: FlexibleRing, spin: float, nodes: int) -> np.ndarray:
    """Return the angular frequencies, 1/s, of masses on a circle of radius 1 in the turning frame, from its energy.

    Each side stretches, each corner bends, pressure works on the enclosed area, springs hold each node in its place,
    and the frame's rotation acts: nothing of the ring's formula is used. Sorted; both waves of each mode.
    """
    angle = 2 * np.pi * np.arange(nodes) / nodes
    out, along = np.stack([np.cos(angle), np.sin(angle)], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)
    length = 2 * np.sin(np.pi / nodes)
    mass = 2 * np.pi / nodes
    # The side's tension that holds corner, pressure and centrifugal force in balance: that of the whole ring.
    whole = TENSION + spin**2
    pull = (TENSION * length * np.cos(np.pi / nodes) + spin**2 * mass) / (2 * np.sin(np.pi / nodes))
    assert pull == pytest.approx(whole, rel=2e-3)

    def energy(moved: jax.Array) -> jax.Array:
        moved = moved.reshape(nodes, 2)
        place = out + moved
        side = jnp.roll(place, -1, axis=0) - place
        sizes = jnp.linalg.norm(side, axis=1)
        before = jnp.roll(side, 1, axis=0)
        turned = jnp.arctan2(before[:, 0] * side[:, 1] - before[:, 1] * side[:, 0], (before * side).sum(1))
        following = jnp.roll(place, -1, axis=0)
        area = (place[:, 0] * following[:, 1] - place[:, 1] * following[:, 0]).sum() / 2
        stretched = (pull * sizes + STRETCH * (sizes - length) ** 2 / (2 * length)).sum()
        bent = ring.bending * ((turned - 2 * np.pi / nodes) ** 2).sum() / (2 * length)
        w, v = (moved * out).sum(1), (moved * along).sum(1)
        held = mass * (ring.radial * w**2 + ring.tangential * v**2).sum() / 2
        return stretched + bent - TENSION * area + held - mass * spin**2 * (place**2).sum() / 2

    start = jnp.zeros(2 * nodes)
    np.testing.assert_allclose(jax.grad(energy)(start), 0.0, atol=1e-7 * STRETCH * mass)  # at rest in the turning frame
    K = np.asarray(jax.hessian(energy)(start)) / mass
    coriolis = np.kron(np.eye(nodes), 2 * spin * np.array([[0.0, -1.0], [1.0, 0.0]]))
    zero, one = np.zeros_like(K), np.eye(2 * nodes)
    values = np.imag(np.linalg.eigvals(np.block([[zero, one], [-K, -coriolis]])))
    return np.sort(values[values > 1e-3])


@pytest.mark.parametrize("spin", [0.0, 60.0])
def test_the_modes_of_a_polygon_of_masses_and_springs_are_those_of_the_ring(spin):
    found = polygon_frequencies(RING, spin, NODES)
    for wave in (1.0, -1.0):
        ground = 2 * np.pi * np.asarray(RING.frequencies(MODES, spin, wave))
        # The turning frame moves n waves along with it: each frequency shifts by n times the spin.
        expected = ground - wave * MODES * spin
        nearest = found[np.abs(found - expected[:, None]).argmin(axis=1)]
        # A polygon's error falls with the square of its nodes: of mode 3 about (2 pi 3 / 96)^2 / 12 = 0.3 %.
        np.testing.assert_allclose(nearest, expected, rtol=5e-3)
    if spin:  # the split is far larger than this tolerance
        split = RING.frequencies(MODES, spin, 1.0) - RING.frequencies(MODES, spin, -1.0)
        assert (np.asarray(split)[2:] > 0.2 * np.asarray(RING.frequencies(MODES))[2:]).all()


def test_derivatives_are_finite_where_a_stiffness_is_small():
    gradient = jax.grad(lambda ring: ring.frequencies(MODES).sum())(RING)
    assert all(np.isfinite(each) and each > 0 for each in jax.tree.leaves(gradient))
