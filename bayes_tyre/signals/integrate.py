"""Displacement at the measurement point from the acceleration, its bias removed, its end held by the laser."""

from typing import NamedTuple

import numpy as np

from bayes_tyre.record import Samples
from bayes_tyre.signals.channels import Signals
from bayes_tyre.signals.noise import signal_level
from bayes_tyre.signals.steps import Step

MM_PER_M = 1000.0
# The ends are compared over this time after the motion has settled, s, or what there is of it.
_COMPARED_S = 0.1


class Path(NamedTuple):
    """Motion of the measurement point from the step's start on, down positive, from rest.

    Attributes
    ----------
    first:
        Index of its first sample.
    acceleration_mm_per_s2, velocity_mm_per_s, displacement_mm, displacement_sd_mm:
        Shape (samples,); the first displacement is 0. Its standard deviation is that of integrated noise and bias.
    laser_mm, laser_sd_mm:
        Displacement at the end by the laser's means before and after, and its standard deviation.
    laser_less_accelerometer_mm:
        The laser's displacement less the accelerometer's before it was anchored; beyond a few of the next figure, one
        of the two is badly calibrated.
    accelerometer_sd_mm:
        Standard deviation of the accelerometer's displacement at the end.
    """

    first: int
    acceleration_mm_per_s2: Samples
    velocity_mm_per_s: Samples
    displacement_mm: Samples
    displacement_sd_mm: Samples
    laser_mm: float
    laser_sd_mm: float
    laser_less_accelerometer_mm: float
    accelerometer_sd_mm: float


def integrated(values: Samples, dt_s: float) -> Samples:
    """Return the integral from the first sample on by the trapezoid rule, beginning with 0."""
    return np.concatenate([[0.0], np.cumsum(dt_s * (values[1:] + values[:-1]) / 2.0)])


def anchored_path(signals: Signals, step: Step, first: int) -> Path:
    """Return the motion from sample `first`, at rest, to where it has settled.

    The acceleration less its mean before the step is integrated twice. Noise and the mean's own error make the result
    wander: as t^3/3 of the noise's density and t^4/4 of the mean's variance. Given that wandering as a Gaussian
    process, two facts at the end, the laser's change and a velocity of none, correct the path by its conditional mean:
    the least correction that meets both within their uncertainties, a polynomial in time, of little account in the
    first 0.1 s.

    Parameters
    ----------
    signals:
        Three channels; of a rolling tyre without runout.
    step:
        As found; its rest before the step gives means and noise.
    first:
        Sample to begin with, before the motion starts.
    """
    dt_s, last = signals.dt_s, len(signals.time_s)
    compared = max(2, min(round(_COMPARED_S / dt_s), last - step.settled))
    stop = step.settled + compared
    acceleration = -(signals.acceleration_m_per_s2[first:stop] - step.acceleration.mean) * MM_PER_M
    velocity = integrated(acceleration, dt_s)
    displacement = integrated(velocity, dt_s)
    t = np.arange(stop - first) * dt_s

    before = signal_level(signals.laser_mm[: step.pre_step], dt_s)
    after = signal_level(signals.laser_mm[step.settled :], dt_s)
    laser, laser_sd = after.mean - before.mean, float(np.hypot(before.standard_error, after.standard_error))
    density = step.acceleration.density * MM_PER_M**2
    bias_variance = (step.acceleration.standard_error * MM_PER_M) ** 2
    # Displacement and velocity at the middle of the compared stretch, by a straight line through it.
    slope, middle = np.polyfit(t[-compared:] - t[-compared:].mean(), displacement[-compared:], 1)
    T = float(t[-compared:].mean())
    early, late = np.minimum(t, T), np.maximum(t, T)
    with_d = density * (early**2 * late / 2 - early**3 / 6) + bias_variance * t**2 * T**2 / 4
    with_v = density * (early * t - early**2 / 2) + bias_variance * t**2 * T / 2
    variance = np.array(
        [
            [density * T**3 / 3 + bias_variance * T**4 / 4, density * T**2 / 2 + bias_variance * T**3 / 2],
            [density * T**2 / 2 + bias_variance * T**3 / 2, density * T + bias_variance * T**2],
        ]
    )
    # What still moves at the end moves by no more than the laser's own scatter there in the time compared.
    measured = np.diag([laser_sd**2, (after.block_sd / (compared * dt_s)) ** 2])
    missing = np.array([laser - middle, -slope])
    weights = np.linalg.solve(variance + measured, np.stack([with_d, with_v]))
    own_variance = density * t**3 / 3 + bias_variance * t**4 / 4
    left = own_variance - np.sum(weights * np.stack([with_d, with_v]), axis=0)
    correction = missing @ weights
    return Path(
        first,
        acceleration,
        velocity + np.gradient(correction, dt_s),
        displacement + correction,
        np.sqrt(np.maximum(left, 0.0)),
        laser,
        laser_sd,
        float(missing[0]),
        float(np.sqrt(variance[0, 0])),
    )
