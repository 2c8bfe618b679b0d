"""A second mode of the rig, such as its beam's bending: both motion sensors show it beside the axle's motion.

``b'' + 2 zeta omega b' + omega^2 b = -share d''``: the axle's acceleration drives it, as the inertia of what bends.
The tyre does not feel it. A rig file describes it, or the free vibration shows it: a peak in the spectrum of what a fit
without it leaves of the acceleration. A road shakes it all the time.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.laws import NormalPrior
from bayes_tyre.inference.motion.record.model.oscillator import oscillation
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.rig.motion import Motion

#: Frequencies that are searched for a mode, Hz: above the ringing of the axle on its tyre, below the blocks' own.
SEARCHED_HZ = (25.0, 150.0)
#: Power of a peak that shows a mode, where white residuals have 1: the largest of some 70 is above it in 1e-11 of them.
SHOWS = 30.0
#: The same under a rolling tyre, above the median of its neighbours' powers: a road's waves are no line among them.
#: Neighbours are the frequencies within these factors.
SHOWS_ON_ROAD, NEIGHBOURS = 20.0, (0.7, 1.4)
#: Relative standard deviation of a frequency read from a spectrum: at 60 Hz it is more than the 2 Hz that 0.5 s tell.
READ_SD = 0.05
#: Priors of the parameters, which follow all others of a record.
MODE_PRIORS: dict[str, NormalPrior] = {
    "log_mode_Hz": NormalPrior(np.nan, READ_SD, "the rig file's, or the peak of the spectrum"),
    "log_mode_damping_ratio": NormalPrior(np.log(0.02), 0.7, "0.5 to 8 % of critical: welded and bolted steel"),
    "mode_share": NormalPrior(0.0, 0.5, "of the axle's movement that the inertia of what bends follows"),
}


class SecondMode(NamedTuple):
    """A second mode: frequency, share of critical damping, and share of the axle's movement that drives it."""

    frequency_Hz: Array
    damping_ratio: Array
    share: Array


def mode_priors(frequency_Hz: float, relative_sd: float = READ_SD) -> Float[np.ndarray, "2 3"]:
    """Return means and standard deviations of the priors of a mode about a frequency."""
    table = np.array([[prior.mean, prior.sd] for prior in MODE_PRIORS.values()])
    table[0] = np.log(frequency_Hz), relative_sd
    return table.T


def mode_in_units(value: Float[Array, " 3"]) -> SecondMode:
    """Return a mode in physical units from the values of its parameters on the scale of their priors."""
    return SecondMode(jnp.exp(value[0]), jnp.exp(value[1]), value[2])


def shown_with(mode: SecondMode, motion: Motion, dt_s: ScalarLike) -> Motion:
    """Return a motion as sensors on a rig with a second mode show it, at rest in the beginning.

    Parameters
    ----------
    mode:
        The mode.
    motion:
        Of the axle, at nodes.
    dt_s:
        Spacing of the nodes, s.
    """
    driven = -1e3 * mode.share * motion.acceleration_m_per_s2
    bend, speed, acceleration = oscillation(mode.frequency_Hz, mode.damping_ratio, driven, dt_s)
    return Motion(
        motion.displacement_mm + bend,
        motion.velocity_mm_per_s + speed,
        motion.acceleration_m_per_s2 + 1e-3 * acceleration,
        motion.tyre_force_kN,
    )


def largest_peak(residual: Float[Array, " blocks"], block_s: ScalarLike) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return frequency (Hz) and power of the largest peak among `SEARCHED_HZ` of residuals of unit variance."""
    padded = 4 * residual.shape[0]
    power = jnp.abs(jnp.fft.rfft(residual, padded)) ** 2 / residual.shape[0]
    frequency = jnp.arange(len(power)) / (padded * jnp.asarray(block_s))
    low, high = SEARCHED_HZ
    searched = jnp.where((frequency >= low) & (frequency <= high), power, 0.0)
    place = jnp.argmax(searched)
    return frequency[place], searched[place]


def largest_line(residual: Float[np.ndarray, " blocks"], block_s: float) -> tuple[float, float]:
    """Return frequency (Hz) of the largest peak among `SEARCHED_HZ`, and its power over what its neighbours have.

    Residuals need not be white: the neighbours' power is that of white noise with the same median.
    """
    taper = np.hanning(len(residual))
    power = np.abs(np.fft.rfft(taper * residual)) ** 2
    frequency = np.fft.rfftfreq(len(residual), block_s)
    low, high = SEARCHED_HZ
    at = int(np.argmax(np.where((frequency >= low) & (frequency <= high), power, 0.0)))
    nearest, farthest = (factor * frequency[at] for factor in NEIGHBOURS)
    # The power of white noise is exponential, with a median of log 2 times its mean.
    around = np.median(power[(frequency >= nearest) & (frequency <= farthest)]) / np.log(2)
    return float(frequency[at]), float(power[at] / around)
