"""Energy lost a cycle at the wheel centre, against a loop run through point by point."""

import jax.numpy as jnp
import numpy as np
import pytest
from support.motion_truth import losses_of_logs

from bayes_tyre.inference.motion.cycle.energy import losses, steady_loss
from bayes_tyre.inference.motion.laws import MOTION_LAWS
from bayes_tyre.laws.bouc_wen import BoucWen
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.loop_energy import dissipated_energy_per_cycle, loop_energy
from bayes_tyre.laws.maxwell_slip import MaxwellSlip, yields
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


def test_losses_of_logs_are_those_of_the_law():
    values = np.array([2.1, 0.45, 0.08, 340.0, 0.002])
    law = Fancher(k=2.1, C=0.0, x=0.45, beta=0.08)
    np.testing.assert_allclose(losses_of_logs(RIG, np.log(values), 14.0, 1.0), losses(RIG, law, 340.0, 14.0, 1.0))
    logs = np.log(values) + 0.01 * np.random.default_rng(2).standard_normal((3, 2, 5))
    draws = losses_of_logs(RIG, logs, 14.0, 1.0)
    for row, one in np.ndenumerate(draws.energy_J):
        assert float(one) == pytest.approx(float(losses_of_logs(RIG, logs[row], 14.0, 1.0).energy_J), rel=1e-12)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 4.0, 20.0, 200.0])
def test_a_numerical_cycle_loses_what_the_closed_form_says(ratio):
    """Bouc-Wen's law with n = 1 is Fancher's, and has no closed form of its own here."""
    settled, beta = 0.2, 0.05
    law = BoucWen(k=1.8, C=3.0, settled=settled, beta=beta, n=1.0)
    expected = dissipated_energy_per_cycle(k=1.8, x=settled + 1.8 * beta, beta=beta, amplitude=ratio * beta)
    found = steady_loss(law, jnp.array(14.0), jnp.array(ratio * beta))
    assert float(found) == pytest.approx(float(expected), rel=1.5e-3 if ratio < 1 else 4e-4)


def test_maxwell_slip_loses_what_its_elements_do():
    """A cycle of amplitude a: 4 w (a - y) of each element with friction w that yields at y < a."""
    settled, beta, a = 0.2, 0.05, 0.1
    law = MaxwellSlip(k=1.8, C=3.0, settled=settled, beta=beta)
    expected = sum(4 * settled / 5 * max(a - beta * y, 0.0) for y in yields())
    assert float(steady_loss(law, jnp.array(14.0), jnp.array(a))) == pytest.approx(expected, rel=2e-3)


def test_without_friction_it_is_the_damper_that_loses():
    """At the natural frequency on k the equivalent damping is the damper's own, and the loss factor c omega / k."""
    law, m, c = MOTION_LAWS["kelvin_voigt"], 300.0, 0.0015
    found = losses_of_logs(RIG, np.log([1.8, m, c]), 14.0, 1.0, law)
    assert float(found.damping_kN_s_per_mm) == pytest.approx(c, rel=1e-12)
    slope = float(found.energy_J / (np.pi * found.loss_factor))
    omega = np.sqrt(slope / (m * 1e-6))
    assert float(found.energy_J) == pytest.approx(np.pi * c * omega, rel=1e-12)
    assert float(found.separation_kN) == 0.0
