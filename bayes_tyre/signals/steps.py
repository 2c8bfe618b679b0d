"""Where the step is and how clear: the load's ramp, the start of the motion, and when it has settled."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from bayes_tyre.errors import BadInput
from bayes_tyre.signals.channels import Signals
from bayes_tyre.signals.noise import Level, block_means, moving_mean, robust_sd, signal_level
from bayes_tyre.signals.ramp import Ramp, find_ramp

Samples = Float[np.ndarray, " samples"]
#: A step needs a change so many times the noise.
CLEAR = 5.0
#: Rest that is needed before the step and after it, s.
REST_S = 0.25
#: The load's noise is that of means over this time, about half a response; the acceleration's spike is shorter.
LOAD_MEAN_S, SPIKE_MEAN_S = 0.02, 0.005
# The quiet stretch ends so long before the ramp, for a straight ramp starts later than a smooth one.
_BEFORE_RAMP_S = 0.1
# The motion starts where the acceleration leaves its noise for so long; it has settled where it stays in it so long.
_ONSET_MEAN_S, _ONSET_RUN_S, _SETTLED_RUN_S = 1e-3, 2e-3, 0.2
_LONGEST_S = 2.0


class Step(NamedTuple):
    """A step of the load and the response to it; sample indices and how clear it is.

    Attributes
    ----------
    quiet:
        Samples before it that are at rest: 0 to here.
    onset, start, settled:
        Where the acceleration leaves its noise; its last change of sign before that; where it is back in its noise.
    ramp:
        Of the load.
    load, acceleration:
        Level and noise of the quiet stretch, kN and m/s^2 (upward).
    spike_m_per_s2:
        Largest mean acceleration over 5 ms, from its level.
    load_clarity, acceleration_clarity:
        Change of load in standard deviations of its 20 ms means; spike in those of the acceleration's 5 ms means.
    """

    quiet: int
    onset: int
    start: int
    settled: int
    ramp: Ramp
    load: Level
    acceleration: Level
    spike_m_per_s2: float
    load_clarity: float
    acceleration_clarity: float

    @property
    def change_kN(self) -> float:
        """Change of the cylinder load, kN."""
        return self.ramp.after_kN - self.ramp.before_kN

    @property
    def sign(self) -> int:
        """1 when loading, -1 when unloading."""
        return 1 if self.change_kN > 0 else -1


def pre_step_samples(ramp: Ramp, signals: Signals) -> int:
    """Return how many samples before a ramp are at rest.

    Raises
    ------
    BadInput
        If the load does not stand out, or there is too little rest before or after it.
    """
    duration_s = len(signals.time_s) * signals.dt_s
    before, after = ramp.start_s - _BEFORE_RAMP_S, duration_s - ramp.end_s - _BEFORE_RAMP_S
    if min(before, after) < REST_S:
        longer = slice(0, int(before / signals.dt_s)) if before > after else slice(int(-after / signals.dt_s), None)
        _check_load(ramp, signal_level(signals.load_kN[longer], signals.dt_s, LOAD_MEAN_S))
        raise BadInput(
            f"the load changes most at {ramp.start_s:.3g} to {ramp.end_s:.3g} s of {duration_s:.3g} s, by "
            f"{ramp.after_kN - ramp.before_kN:.2g} kN; a step needs {REST_S + _BEFORE_RAMP_S:g} s of rest before and "
            "after it"
        )
    return int(before / signals.dt_s)


def find_step(signals: Signals, ramp: Ramp | None = None) -> Step:
    """Return the step of a recording, wherever it is, up or down.

    Parameters
    ----------
    signals:
        Three channels; of a rolling tyre, with the runout removed.
    ramp:
        The load's ramp, if it is known already.

    Raises
    ------
    BadInput
        If load or acceleration do not stand out of their noise, with the figures, or the rest is too short.
    """
    ramp = ramp or find_ramp(signals.load_kN, signals.dt_s)
    quiet, dt_s = pre_step_samples(ramp, signals), signals.dt_s
    load = signal_level(signals.load_kN[:quiet], dt_s, LOAD_MEAN_S)
    change, load_clarity = ramp.after_kN - ramp.before_kN, _check_load(ramp, load)
    level = signal_level(signals.acceleration_m_per_s2[:quiet], dt_s, LOAD_MEAN_S)
    moved = signals.acceleration_m_per_s2 - level.mean
    spike, clarity = _spike(moved, quiet, ramp, dt_s)
    onset = _onset(moved, quiet, ramp, -np.sign(change), dt_s) if clarity >= CLEAR else None
    if onset is None:
        raise BadInput(
            f"acceleration spikes by {spike:.2g} m/s^2, {clarity:.2g} times the noise of its 5 ms means of "
            f"{_ratio(spike, clarity):.2g} m/s^2; a step needs {CLEAR:g}, towards the load's change, by the load's ramp"
        )
    before = np.flatnonzero(np.diff(np.signbit(moved[:onset])))
    start = int(before[-1]) if len(before) else onset
    settled = _settled(moved, quiet, onset, max(onset, int(ramp.end_s / dt_s)), dt_s)
    return Step(quiet, onset, start, settled, ramp, load, level, spike, load_clarity, clarity)


def _check_load(ramp: Ramp, load: Level) -> float:
    """Return how many times its noise the load changes, if it is enough."""
    change = ramp.after_kN - ramp.before_kN
    times = _ratio(abs(change), load.block_sd)
    if times < CLEAR:
        raise BadInput(
            f"load changes by {change:.2g} kN, {times:.2g} times the noise of its 20 ms means of {load.block_sd:.2g} "
            f"kN; a step needs {CLEAR:g}"
        )
    return times


def _ratio(value: float, noise: float) -> float:
    return value / max(noise, 1e-9)


def _spike(moved: Samples, quiet: int, ramp: Ramp, dt_s: float) -> tuple[float, float]:
    """Return the largest 5 ms mean about the ramp, m/s^2, and how many times the noise of such means it is."""
    length = max(1, round(SPIKE_MEAN_S / dt_s))
    means = moving_mean(moved, length)
    spike = float(np.abs(means[quiet : int((ramp.end_s + _BEFORE_RAMP_S) / dt_s)]).max())
    return spike, _ratio(spike, robust_sd(block_means(moved[:quiet], length)))


def _smooth(moved: Samples, quiet: int, dt_s: float) -> tuple[Samples, float]:
    """Return means over 1 ms and the level that their noise does not reach, m/s^2."""
    means = moving_mean(moved, max(1, round(_ONSET_MEAN_S / dt_s)))
    return means, CLEAR * max(robust_sd(means[:quiet]), 1e-9)


def _onset(moved: Samples, quiet: int, ramp: Ramp, sign: float, dt_s: float) -> int | None:
    """Return where the acceleration leaves its noise to the side of the load's change; None where it does not."""
    means, level = _smooth(moved, quiet, dt_s)
    stop = int((ramp.end_s + _BEFORE_RAMP_S) / dt_s)
    run = _first_run(sign * means[quiet:stop] > level, max(1, round(_ONSET_RUN_S / dt_s)))
    return None if run is None else quiet + run


def _settled(moved: Samples, quiet: int, onset: int, after: int, dt_s: float) -> int:
    """Return where the motion has come to rest: back in its noise for two turns of the slowest ringing."""
    means, level = _smooth(moved, quiet, dt_s)
    last = len(moved) - round(REST_S / 2 / dt_s)
    # A rolling tyre's runout is not the same after the step: what is left of it is no ringing.
    level = max(level, 2 * robust_sd(means[(onset + len(means)) // 2 :]))
    run = _first_run(np.abs(means[after:last]) <= level, round(_SETTLED_RUN_S / dt_s))
    longest = min(last, onset + round(_LONGEST_S / dt_s))
    return min(longest, after + run if run is not None else longest)


def _first_run(true: Bool[np.ndarray, " samples"], length: int) -> int | None:
    """Return where `length` samples in a row are first true."""
    total = np.concatenate([[0], np.cumsum(true)])
    if len(total) <= length:
        return None
    full = np.flatnonzero(total[length:] - total[:-length] == length)
    return int(full[0]) if len(full) else None
