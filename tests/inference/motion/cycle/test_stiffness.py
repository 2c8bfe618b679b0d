"""Stiffness of cycles: of a loop run through point by point, and in the limits of small and large strokes."""

import numpy as np
import pytest

from bayes_tyre.inference.motion.cycle.stiffness import stiffnesses
from bayes_tyre.laws.base import StatefulLaw
from bayes_tyre.laws.bouc_wen import BoucWen
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.laws.maxwell_slip import MaxwellSlip
from bayes_tyre.laws.rigid_ring import RigidRing
from bayes_tyre.record import RING_DOWN_MM
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import load_rig

RIG, MIDDLE = load_rig("single"), 14.0


def of_loop(law: StatefulLaw, amplitude: float) -> float:
    """Return change of force over stroke of the fourth of four cycles at the wheel centre, on flat ground."""
    turn = np.linspace(0.0, 2.0 * np.pi, 4000, endpoint=False)
    flat = np.asarray(geometry.flat_ground_displacement(RIG, MIDDLE + amplitude * np.sin(np.tile(turn, 4))))
    force = np.asarray(law.force(flat, law.k * flat[0] + law.C))[-4000:]  # pyright: ignore[reportAttributeAccessIssue]
    return float(np.ptp(force) / np.ptp(flat[-4000:]))


@pytest.mark.parametrize("amplitude", [0.05, 0.3, 2.0])
@pytest.mark.parametrize(
    "law",
    [
        Fancher(k=2.1, C=0.1, x=0.45, beta=0.08),
        BoucWen(k=2.1, C=0.1, settled=0.28, beta=0.08, n=1.5),
        MaxwellSlip(k=2.1, C=0.1, settled=0.28, beta=0.08),
    ],
    ids=["fancher", "bouc_wen", "maxwell_slip"],
)
def test_it_is_change_of_force_over_stroke_of_a_loop(law, amplitude):
    found = stiffnesses(RIG, law, 300.0, MIDDLE, amplitude)
    assert float(found.static_kN_per_mm) == pytest.approx(of_loop(law, amplitude), rel=2e-3)
    assert float(found.one_Hz_kN_per_mm) == float(found.static_kN_per_mm)
    assert float(found.ring_down_kN_per_mm) == pytest.approx(of_loop(law, RING_DOWN_MM), rel=2e-3)


def test_small_cycles_meet_the_first_slope_and_large_ones_the_middle_line():
    law = Fancher(k=2.1, C=0.0, x=0.45, beta=0.08)
    small, large = (stiffnesses(RIG, law, 300.0, MIDDLE, a).static_kN_per_mm for a in (1e-3, 10.0))
    # At a turn the law's slope is x / beta over the way back from the other branch.
    assert float(small) == pytest.approx(0.45 / 0.08, rel=1e-3)
    assert float(large) == pytest.approx(2.1 + (0.45 - 2.1 * 0.08) / 10.0, rel=2e-2)


def test_a_law_without_friction_has_its_dynamic_stiffness():
    spring = stiffnesses(RIG, KelvinVoigt(k=1.8, C=0.0), 300.0, MIDDLE, 1.0)
    np.testing.assert_allclose(spring, 1.8)
    ring = RigidRing(k=1.8, C=0.0, belt_frequency=60.0, belt_damping=0.05, sidewall_ratio=4.0)
    found = stiffnesses(RIG, ring, 300.0, MIDDLE, 1.0)
    assert float(found.static_kN_per_mm) == pytest.approx(1.8, rel=1e-9)
    d = np.array([MIDDLE - 0.01, MIDDLE + 0.01])  # as fast as 300 kg swing on k at the wheel centre
    force = 1.8 * np.asarray(geometry.flat_ground_displacement(RIG, d)) * np.asarray(geometry.sin_theta(RIG, d))
    free = np.sqrt(geometry.curvature_factor(RIG) * np.diff(force)[0] / 0.02 / 300e-6)
    for value, omega in ((found.one_Hz_kN_per_mm, 2.0 * np.pi), (found.ring_down_kN_per_mm, free)):
        assert float(value) == pytest.approx(float(np.real(ring.dynamic_stiffness(omega))), rel=1e-4)
    assert float(found.ring_down_kN_per_mm) != pytest.approx(1.8, rel=1e-3)
