"""What the sensors of a motion read."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lfilter

from bayes_tyre.inference.motion.record.model.forward_model import _shown_late
from bayes_tyre.rig.motion import Motion

RATE_HZ = 1e5


@pytest.mark.parametrize(("lag_ms", "average_ms"), [(2.0, 0.0), (0.0, 4.0), (1.0, 2.0)])
@pytest.mark.parametrize("ringing_Hz", [8.0, 18.0])
def test_a_laser_that_lags_or_averages_is_late_by_the_sum_of_both(lag_ms, average_ms, ringing_Hz):
    """A delay of 2 ms in all, made sample by sample; 2 % of the amplitude at 18 Hz: third order, kind of lag."""
    time_s = np.arange(0, 0.5, 1 / RATE_HZ)
    omega = 2 * np.pi * ringing_Hz
    displacement = np.sin(omega * time_s)
    shown = displacement
    if average_ms:
        length = round(1e-3 * average_ms * RATE_HZ)
        shown = np.asarray(lfilter(np.full(length, 1 / length), 1.0, shown))
    if lag_ms:
        decay = np.exp(-1e3 / (RATE_HZ * lag_ms))
        shown = np.asarray(lfilter([1 - decay], [1.0, -decay], shown))
    velocity, acceleration = omega * np.cos(omega * time_s), -(omega**2) * displacement
    motion = Motion(*map(jnp.asarray, (displacement, velocity, 1e-3 * acceleration, np.zeros_like(time_s))))
    settled = time_s > 0.05
    late = np.asarray(_shown_late(motion, 2e-3))
    most = 0.02 * (ringing_Hz / 18.0) ** 2
    assert np.abs(late - shown)[settled].max() < most
    # Without the delay it is off by ten times as much.
    assert np.abs(displacement - shown)[settled].max() > 5 * most
