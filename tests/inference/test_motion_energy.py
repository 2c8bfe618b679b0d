"""Energy lost a cycle at the wheel centre, against a loop run through point by point."""

import numpy as np
import pytest

from bayes_tyre.inference.motion_energy import losses, losses_moments, losses_of_logs
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


def test_losses_of_logs_are_those_of_the_law_and_spread_as_draws_do():
    values = np.array([2.1, 0.45, 0.08, 340.0, 0.002])
    law = Fancher(k=2.1, C=0.0, x=0.45, beta=0.08)
    np.testing.assert_allclose(losses_of_logs(RIG, np.log(values), 14.0, 1.0), losses(RIG, law, 340.0, 14.0, 1.0))
    sd = np.array([0.003, 0.01, 0.02, 0.003, 0.05])
    mean, covariance = losses_moments(RIG, np.log(values), np.diag(sd**2), 14.0, 1.0)
    logs = np.log(values) + sd * np.random.default_rng(2).standard_normal((4000, 5))
    draws = np.stack(losses_of_logs(RIG, logs, 14.0, 1.0))
    assert draws.shape == (4, 4000)
    # A standard deviation of 4000 draws errs by 1.1 %: 4.5 times that, for one of 4, in 0.003 % of seeds.
    np.testing.assert_allclose(draws.std(axis=1), np.sqrt(np.diag(covariance)), rtol=0.05)
    np.testing.assert_allclose(draws.mean(axis=1), mean, rtol=0.005)
