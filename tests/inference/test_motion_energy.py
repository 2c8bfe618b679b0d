"""Energy lost a cycle at the wheel centre, against a loop run through point by point."""

import numpy as np
import pytest

from bayes_tyre.inference.motion_energy import losses
from bayes_tyre.laws.fancher import Fancher, loop_energy
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import load_rig

RIG = load_rig("dual")


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 3.0])
def test_energy_is_that_of_a_loop_at_the_wheel_centre(amplitude):
    law, middle, points = Fancher(k=2.1, C=0.1, x=0.45, beta=0.08), 14.0, 4000
    turn = np.linspace(0, 2 * np.pi, points, endpoint=False)
    d = middle + amplitude * np.sin(np.tile(turn, 4))
    flat = np.asarray(geometry.flat_ground_displacement(RIG, d))
    force = law.force(flat, law.k * flat[0] + law.C) * geometry.curvature_factor(RIG) * geometry.sin_theta(RIG, d)
    lost = losses(RIG, law, 340.0, middle, amplitude)
    assert float(lost.energy_J) == pytest.approx(float(loop_energy(d[-points:], force[-points:])), rel=1e-3)


def test_equivalent_damping_loses_as_much_at_the_natural_frequency():
    law = Fancher(k=2.1, C=0.1, x=0.45, beta=0.08)
    lost = losses(RIG, law, 340.0, 14.0, 1.0)
    # c omega = loss factor times k, and k = m omega^2.
    omega = float(lost.loss_factor) * 340.0 * 1e-6
    omega = float(lost.damping_kN_s_per_mm) / omega
    assert omega == pytest.approx(np.sqrt(2.1 * geometry.curvature_factor(RIG) / 340e-6), rel=0.15)
    assert float(lost.separation_kN) == pytest.approx(2 * (0.45 - 2.1 * 0.08))
