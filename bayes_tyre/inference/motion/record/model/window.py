"""The window of a recording that the motion is fitted in: block means of the three channels, and how noisy they are."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw
from bayes_tyre.inference.motion.record.model.block_noise import (
    block_sd,
    block_sd_of_differences,
    common_rounding_variance,
    converter_step,
    level,
    level_after,
)
from bayes_tyre.inference.motion.record.model.load_ringing import ringing_priors
from bayes_tyre.inference.motion.record.model.parameters import (
    MotionParameters,
    in_units,
    parameter_names,
    prior_moments,
    ringing_parameters,
)
from bayes_tyre.inference.motion.record.model.pre_step_harmonics import fit_harmonics
from bayes_tyre.inference.motion.record.model.runout import Rolling, ground_priors
from bayes_tyre.inference.motion.record.model.second_mode import mode_priors
from bayes_tyre.record import means_of_blocks
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import substeps_for

Samples = Float[np.ndarray, " samples"]
Values = Float[np.ndarray, "..."]
#: Samples are averaged over about so long, s. The ringing takes some 80 ms and the load's step 40: nothing of either
#: is lost, noise is white over it, and the model is averaged alike (`block_weights`). A step of the integration is
#: one block.
BLOCK_S = 5e-4
ROLLING_BLOCK_S = 1e-3
#: The window begins so long before the straight ramp of the load and ends so long after it starts, s: the ringing
#: has decayed by then, and later motion is drift.
BEFORE_S, AFTER_S = 0.05, 0.5
#: The window of a rolling tyre begins earlier, s: about one turn of the wheel determines its runout.
ROLLING_BEFORE_S = 1.0
#: Rest before the window, s, from which on the noise of a rolling record is known; with less all its rest counts.
_LEAST_REST_S = 0.5
# Block length for the pre-step harmonics, s; standard deviation of the middle line about the laser's mean, mm, which is
# friction over stiffness.
_HARMONICS_BLOCK_S, _FRICTION_MM = 2e-3, 0.3
#: A straight ramp fitted to a raised cosine starts later and is shorter, by these shares of its length.
_RAMP_LATE, _RAMP_SHORT = 0.2, 1.4


class Recorded(NamedTuple):
    """A recording, the input of the fit.

    Attributes
    ----------
    dt_s:
        Spacing of the samples, s.
    acceleration_m_per_s2, laser_mm, load_kN:
        Shape (samples,): at the measurement point, up positive; growing as the axle goes down; of the cylinder.
    pre_step:
        Number of samples at rest before the step.
    ramp_s:
        Start and end of a straight ramp that fits the load, s after the first sample.
    bodies:
        For a rolling tyre: turns a second and number of harmonics of each turning body, the wheel first. The channels
        include the runout.
    """

    dt_s: float
    acceleration_m_per_s2: Samples
    laser_mm: Samples
    load_kN: Samples
    pre_step: int
    ramp_s: tuple[float, float]
    bodies: tuple[tuple[float, int], ...] = ()


class Disturbance(NamedTuple):
    """What acts on the axle beside load, runout and law, at the nodes of the integration, shape (nodes,).

    Attributes
    ----------
    road_mm:
        Displacement of the ground in addition to the runout's harmonics, mm, positive where it compresses the tyre.
    force_kN:
        Force on the wheel centre that neither load cell nor law know, kN, down positive; 0 at the window's start.
    load_kN:
        Cylinder's load in addition to its step's shape, kN, which the load cell reads; 0 at the window's start.
    """

    road_mm: Float[ArrayLike, "*nodes"] = 0.0
    force_kN: Float[ArrayLike, "*nodes"] = 0.0
    load_kN: Float[ArrayLike, "*nodes"] = 0.0


UNDISTURBED = Disturbance()


class DisturbanceResponse(NamedTuple):
    """The response of the readings to a random disturbance, a sum of columns (`disturbance.response`).

    Attributes
    ----------
    mean:
        Estimate of the disturbance, about which the response is linearised.
    size:
        Standard deviation of its weights, as a factor: of a road mm, of a force the share of the load's step.
    weights:
        Of its columns, shape (columns,).
    response:
        Of the readings to the estimated disturbance, in standard deviations of their noise, shape (3, blocks).
    directions:
        Orthonormal directions of the standardised readings, shape (3 blocks, directions).
    shrink:
        1 - 1 / (standard deviation along each direction), shape (directions,).
    along:
        Disturbance that moves the readings along each direction, with weights of standard deviation 1; of shape
        (directions, nodes) each. None where it is not random.
    along_weights:
        Weights of the estimate along them, shape (directions,).
    whitening:
        Matrix that whitens the accelerometer's residuals, shape (blocks, blocks); None before it is estimated
        (`road_noise`).
    load_size, force_size:
        Standard deviations of the load's departure from its shape (`load_departure`), and of the force that load and
        law leave out (`force_discrepancy`), as shares of the load's step.
    """

    mean: Disturbance
    size: Float[Array, "*records"]
    weights: Float[Array, "*records columns"]
    response: Float[Array, "*records 3 blocks"]
    directions: Float[Array, "*records readings directions"]
    shrink: Float[Array, "*records directions"]
    along: Disturbance | None = None
    along_weights: Float[Array, "*records directions"] | None = None
    whitening: Float[Array, "*records blocks blocks"] | None = None
    load_size: Float[ArrayLike, "*records"] = 0.0
    force_size: Float[ArrayLike, "*records"] = 0.0


class Window(NamedTuple):
    """The data of a record for the fit; a leading axis batches it.

    Attributes
    ----------
    block_s:
        Time of a block, s.
    readings:
        Means of acceleration (m/s^2), laser (mm) and load (kN), shape (3, blocks).
    weight:
        1 / standard deviation of each; 0 where there is no reading, shape (3, blocks).
    node_weights:
        Weights of the motion's nodes in a block that give the mean of its samples, shape (nodes,).
    prior:
        Means and standard deviations of the parameters, shape (2, parameters).
    rolling:
        For a rolling tyre.
    disturbance:
        A rolling tyre's road, and the forces that law and load's shape leave out of a record, if any.
    law:
        Force law that is fitted.
    rounding:
        Part of the variance of each channel's readings at rest that they share, for a converter rounds them alike, and
        that no weight allows for, shape (3,).
    """

    block_s: Float[Array, "*records"]
    readings: Float[Array, "*records 3 blocks"]
    weight: Float[Array, "*records 3 blocks"]
    node_weights: Float[Array, "*records nodes"]
    prior: Float[Array, "*records 2 parameters"]
    rolling: Rolling | None = None
    disturbance: DisturbanceResponse | None = None
    law: MotionLaw = FANCHER
    rounding: Float[ArrayLike, "*records 3"] = 0.0

    def in_units(self, rig: Rig, standard: Float[Array, " parameters"]) -> MotionParameters:
        """Return the unknowns of a record from standardised ones."""
        return in_units(rig, standard, self.prior, self.rolling, self.law)

    def with_mode(self, frequency_Hz: float) -> "Window":
        """Return the window with a second mode of the rig about a frequency; its parameters follow all others."""
        return self._replace(prior=jnp.concatenate([jnp.asarray(self.prior), mode_priors(frequency_Hz)], axis=1))

    def with_ringing(self) -> "Window":
        """Return the window with a load that rings; its parameters follow all but those of a second mode."""
        before, mode = np.split(np.asarray(self.prior), [self._own_parameters], axis=1)
        return self._replace(prior=jnp.concatenate([before, ringing_priors(), mode], axis=1))

    @property
    def ringing_at(self) -> range:
        """Where the parameters of a load that rings stand; empty of one that does not."""
        own = self._own_parameters
        return range(own, own + ringing_parameters(self.prior.shape[-1] - own))

    @property
    def _own_parameters(self) -> int:
        return len(parameter_names(self.law)) + (0 if self.rolling is None else self.rolling.ground_parameters)

    @property
    def mean_disturbance(self) -> Disturbance:
        """The estimate of what acts on the axle beside load, runout and law."""
        return UNDISTURBED if self.disturbance is None else self.disturbance.mean


def make_window(rig: Rig, samples: Recorded, law: MotionLaw = FANCHER) -> Window:
    """Return the window of a recording.

    The window is as long for every record of a sampling rate, so that one compilation serves all; where a recording
    ends within it, weights are 0. What lies outside enters through the priors: levels of the rest before the step,
    and of the load after the window.

    Parameters
    ----------
    rig:
        Effective mass, sensors, and a second mode that records are fitted with.
    samples:
        A recording.
    law:
        Force law to fit.
    """
    dt_s, rolls = samples.dt_s, len(samples.bodies) > 0
    length = max(1, round((ROLLING_BLOCK_S if rolls else BLOCK_S) / dt_s))
    before_s = ROLLING_BEFORE_S if rolls else BEFORE_S
    first = max(0, round((samples.ramp_s[0] - before_s) / dt_s))
    blocks = round((before_s + AFTER_S) / (length * dt_s))
    channels = np.stack([samples.acceleration_m_per_s2, samples.laser_mm, samples.load_kN])
    rest = min(samples.pre_step, first)
    if rolls and rest * dt_s < _LEAST_REST_S:  # the third differences of noise are the same within the window
        rest = samples.pre_step
    # At rest a channel may show one level alone.
    pre_step, steps = channels[:, :rest], [converter_step(channel) for channel in channels]
    cut = channels[:, first : first + blocks * length]
    full = cut.shape[1] // length
    readings, weight = np.zeros((3, blocks)), np.zeros((3, blocks))
    readings[:, :full] = means_of_blocks(cut, length)
    readings[:, full:] = readings[:, full - 1 : full]
    sds = [
        block_sd_of_differences(channel, length) if rolls else block_sd(channel, length, q)
        for channel, q in zip(pre_step, steps, strict=True)
    ]
    weight[:, :full] = 1 / np.array(sds)[:, None]
    shared = np.zeros(3)
    if not rolls:  # before its step and after it the load stands still, and readings share their rounding error
        shared = np.array([common_rounding_variance(*each) for each in zip(pre_step, steps, strict=True)])
        begin, end = (min(max(0, round((time / dt_s - first) / length)), full) for time in samples.ramp_s)
        for still in (slice(0, begin), slice(end, full)):
            weight[2, still] = 1 / np.sqrt(sds[2] ** 2 + len(weight[2, still]) * shared[2])
    levels = [level(channel, dt_s, q) for channel, q in zip(pre_step, steps, strict=True)]
    after = channels[2, first + blocks * length :]
    record_levels = {
        "acceleration_offset_m_per_s2": levels[0],
        "laser_at_rest_mm": levels[1],
        "load_before_kN": levels[2],
        "load_after_kN": level_after(after, readings[2, :full], levels[2], dt_s, steps[2]),
        **_ramp(samples, first * dt_s),
    }
    rolling, further = None, []
    if rolls:
        rolling, rolling_levels, ground = _rolling(rig, samples, channels[:, : samples.pre_step], first)
        record_levels |= rolling_levels
        further.append(ground)
    if mode := rig.second_mode:
        further.append(mode_priors(mode.frequency_Hz, mode.frequency_relative_sd))
    prior = np.concatenate([prior_moments(rig, record_levels, law), *further], axis=1)
    nodes = block_weights(length, substeps_for(length * dt_s, ROLLING_BLOCK_S))
    shared[2] = 0.0  # its still blocks weigh less for it already
    arrays = map(jnp.asarray, (length * dt_s, readings, weight, nodes, prior))
    return Window(*arrays, rolling=rolling, law=law, rounding=jnp.asarray(shared / np.square(sds)))


def _rolling(
    rig: Rig, samples: Recorded, pre_step: Values, first: int
) -> tuple[Rolling, dict[str, tuple[float, float]], Float[np.ndarray, "2 further"]]:
    """Return the harmonics of a rolling record, its levels, and the priors of the ground's parameters."""
    length = max(1, round(_HARMONICS_BLOCK_S / samples.dt_s))
    means = means_of_blocks(pre_step, length)
    # Samples stand at the middle of their share of a block (`block_weights`).
    time_s = (length * np.arange(means.shape[1]) + length / 2 - first) * samples.dt_s
    fit = fit_harmonics(time_s, means[0], means[1], samples.bodies)
    levels = {
        "acceleration_offset_m_per_s2": fit.acceleration_m_per_s2,
        "laser_at_rest_mm": (fit.laser_mm[0], _FRICTION_MM),
    }
    velocity = float(geometry.wheel_centre_displacement(rig, np.sum(-fit.omega * np.imag(fit.amplitude_mm))))
    rolling = Rolling(
        jnp.asarray(fit.body),
        jnp.asarray(fit.order),
        jnp.asarray(fit.amplitude_mm) * float(geometry.wheel_centre_displacement(rig, 1.0)),
        jnp.asarray(fit.laser_mm[0] + np.sum(np.real(fit.amplitude_mm))),
        jnp.asarray(fit.turn_Hz),
    )
    return rolling, levels, ground_priors(velocity, np.log(fit.turn_Hz), fit.turn_sd, len(fit.order))


def block_weights(length: int, substeps: int) -> Float[np.ndarray, " nodes"]:
    """Return weights of the nodes of a block's steps with which they sum to the mean of its samples.

    Samples stand at the middle of equal parts of the block; within a step the motion is the parabola through its
    ends and its middle, as it was integrated.

    Parameters
    ----------
    length:
        Samples in the block.
    substeps:
        Steps in the block, each with nodes at its ends and its middle.
    """
    weights = np.zeros(2 * substeps + 1)
    for at in (np.arange(length) + 0.5) / length * substeps:
        step = min(int(at), substeps - 1)
        s = at - step
        weights[2 * step : 2 * step + 3] += [(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)]
    return weights / length


def _ramp(samples: Recorded, first_s: float) -> dict[str, tuple[float, float]]:
    start, end = samples.ramp_s
    length = end - start
    return {
        "ramp_start_s": (start - first_s - _RAMP_LATE * length, np.nan),
        "log_rise": (float(np.log(_RAMP_SHORT * length)), np.nan),
    }
