"""Eq. 3 to 10: printed constants, shapes, the start point, and the work that the flat-ground pair does not keep."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Accuracy, load_rig

RIGS = {name: load_rig(name) for name in ("single", "dual")}


@pytest.mark.parametrize(
    ("name", "height", "factor", "force", "displacement"),
    [
        ("single", 619.85583, 1.168441, 875 / 1300, 1300 / 950),
        ("dual", 621.745577, 1.167425, 875 / 1290, 1290 / 885),
    ],
)
def test_constants_and_lever_arms(name, height, factor, force, displacement):
    rig = RIGS[name]
    assert geometry.centre_height_mm(rig) == pytest.approx(height, abs=6e-6)
    assert geometry.curvature_factor(rig) == pytest.approx(factor, abs=5e-7)
    assert geometry.wheel_centre_force(rig, 1.0) == pytest.approx(force)
    assert geometry.wheel_centre_displacement(rig, 1.0) == pytest.approx(displacement)
    assert geometry.tyre_load(rig, 0.0) == pytest.approx(rig.axle.axle_load_kN)


def test_k_has_all_of_the_error_of_sensors_and_arms():
    """k is force over displacement: its relative variance is that of both factors, by the arms' finite differences."""
    given = {"load_relative_sd": 0.004, "displacement_relative_sd": 0.007, "lever_arm_sd_mm": 3.0}
    rig = RIGS["dual"].model_copy(update={"accuracy": Accuracy(**given)})
    arms, step_mm = ("support_to_wheel_centre_mm", "support_to_load_mm", "support_to_measurement_mm"), 0.01

    def log_k(**other: float) -> float:
        axle = rig.axle.model_copy(update=other)
        moved = rig.model_copy(update={"axle": axle})
        return float(np.log(geometry.wheel_centre_force(moved, 1.0) / geometry.wheel_centre_displacement(moved, 1.0)))

    slopes = [(log_k(**{arm: getattr(rig.axle, arm) + step_mm}) - log_k()) / step_mm for arm in arms]
    expected = np.sqrt(0.004**2 + 0.007**2 + np.sum((3.0 * np.asarray(slopes)) ** 2))
    found = np.hypot(geometry.force_relative_sd(rig), geometry.displacement_relative_sd(rig))
    assert found == pytest.approx(expected, rel=1e-4)
    assert geometry.force_relative_sd(RIGS["dual"]) == geometry.displacement_relative_sd(RIGS["dual"]) == 0.0


@pytest.mark.parametrize("array", [np.asarray, jnp.asarray])
def test_arrays_of_any_shape(array):
    rig = RIGS["single"]
    d = array(np.linspace(0.0, 20.0, 6).reshape(2, 3))
    sine = geometry.sin_theta(rig, d)
    assert sine.shape == (2, 3)
    assert isinstance(sine, type(d))
    assert isinstance(geometry.wheel_centre_displacement(rig, d), type(d))
    touch = geometry.centre_height_mm(rig) / (133.5 + 536.0)
    assert np.ravel(sine)[0] == pytest.approx(touch)
    assert np.all(np.diff(np.ravel(sine)) < 0)
    np.testing.assert_allclose(geometry.flat_ground_displacement(rig, d), d * sine)
    factor = geometry.curvature_factor(rig)
    np.testing.assert_allclose(geometry.flat_ground_force(rig, 10.0, d), 10.0 / (factor * np.asarray(sine)))


def test_gradients_pass_through():
    slope = jax.grad(lambda d: geometry.flat_ground_displacement(RIGS["dual"], d))(10.0)
    above, below = np.asarray(geometry.flat_ground_displacement(RIGS["dual"], np.array([10.0 + 1e-4, 10.0 - 1e-4])))
    assert float(slope) == pytest.approx((above - below) / 2e-4, rel=1e-8)


@settings(max_examples=50)
@given(st.sampled_from(sorted(RIGS)), st.floats(0.0, 45.0), st.floats(1.0, 3.0))
def test_the_start_point_is_consistent(name, cylinder, k):
    rig = RIGS[name]
    d_f, F_f = geometry.flat_ground_start(rig, cylinder, k)
    assert abs(F_f - k * d_f) < 1e-12 * max(F_f, 1.0)
    # Go back by bisection on Eq. 7, and forward again through both conversions.
    low, high = 0.0, 100.0
    for _ in range(200):
        middle = (low + high) / 2
        below = float(geometry.flat_ground_displacement(rig, middle)) < d_f
        low, high = (middle, high) if below else (low, middle)
    assert geometry.flat_ground_force(rig, geometry.tyre_load(rig, cylinder), low) == pytest.approx(F_f, rel=1e-11)


@pytest.mark.parametrize(("load", "k"), [(30.0, 0.0), (30.0, -1.0), (30.0, float("nan")), (-10.0, 1.5), (3000.0, 1.5)])
def test_a_start_point_that_cannot_be_is_refused(load, k):
    with pytest.raises(ValueError, match=r"needs k > 0|no displacement"):
        geometry.flat_ground_start(RIGS["single"], load, k)


def test_the_flat_ground_pair_does_not_keep_work():
    rig = RIGS["single"]
    d = np.linspace(10.0, 14.0, 2001)
    force = 10.0 + 1.7 * d
    at_wheel = np.trapezoid(force, d)
    flat = np.trapezoid(geometry.flat_ground_force(rig, force, d), geometry.flat_ground_displacement(rig, d))
    assert at_wheel / flat == pytest.approx(geometry.curvature_factor(rig), rel=0.01)
