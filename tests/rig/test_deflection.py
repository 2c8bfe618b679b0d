"""Readings of a slow test through the rig: against the source's arithmetic, and back from what the tyre has."""

import numpy as np
import pytest
from helpers.slow_tests import DUAL, SINGLE, Tyre, from_the_rig, on_flat_ground

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.rig.load_deflection import deflection_of


def test_the_axle_s_own_load_is_on_the_tyre_where_the_cylinder_has_none():
    at_rest = deflection_of(load_rig("single"), np.array([0.0, 40.0]), np.array([1.0, 12.0]))
    np.testing.assert_allclose(at_rest.wheel_centre_kN, [2.518, 40 * 875 / 1300 + 2.518])
    np.testing.assert_allclose(at_rest.wheel_centre_mm, np.array([1.0, 12.0]) * 1300 / 950)
    u = 619.85583 - 12 * 1300 / 950
    sine = u / np.hypot(u, 253.0)
    assert at_rest.flat_ground_mm[1] == pytest.approx(12 * 1300 / 950 * sine, rel=1e-8)
    assert at_rest.flat_ground_kN[1] == pytest.approx((40 * 875 / 1300 + 2.518) / (1.168441 * sine), rel=1e-6)


@pytest.mark.parametrize(("name", "rig"), [("single", SINGLE), ("dual", DUAL)])
def test_what_the_tyre_has_on_flat_ground_comes_back_from_what_the_rig_would_read(name, rig):
    tyre = on_flat_ground(Tyre())
    read = from_the_rig(tyre, rig)
    found = deflection_of(load_rig(name), read["load_kN"].to_numpy(), read["displacement_mm"].to_numpy())
    np.testing.assert_allclose(found.flat_ground_mm, tyre["displacement_mm"], rtol=1e-7)
    np.testing.assert_allclose(found.flat_ground_kN, tyre["load_kN"], rtol=1e-6)
