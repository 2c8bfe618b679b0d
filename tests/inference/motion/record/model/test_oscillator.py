"""A driven oscillator against the solution in closed form."""

import jax.numpy as jnp
import numpy as np

from bayes_tyre.inference.motion.record.model.oscillator import oscillation

DT_S = 2.5e-4


def test_after_a_jump_it_swings_about_its_new_place():
    time_s = np.arange(0, 0.3, DT_S)
    frequency_Hz, zeta = 18.0, 0.1
    omega = 2 * np.pi * frequency_Hz
    damped = omega * np.sqrt(1 - zeta**2)
    decay, angle = np.exp(-zeta * omega * time_s), damped * time_s
    y = 1 - decay * (np.cos(angle) + zeta * omega / damped * np.sin(angle))
    speed = decay * omega**2 / damped * np.sin(angle)
    found = np.asarray(oscillation(frequency_Hz, zeta, jnp.full(len(time_s), omega**2), DT_S))
    # The trapezoidal rule is off by the square of 0.028 radians a node, over 12, after 34 radians.
    for values, expected in zip(found, (y, speed, omega**2 * (1 - y) - 2 * zeta * omega * speed), strict=True):
        np.testing.assert_allclose(values, expected, atol=2e-3 * np.abs(expected).max())
    assert found[0, 0] == found[1, 0] == 0
