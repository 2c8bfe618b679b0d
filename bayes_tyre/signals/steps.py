"""Detection of the load step: its ramp, the start of the motion, its end, and signal-to-noise ratios."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Samples, means_of_blocks
from bayes_tyre.signals.channels import Signals
from bayes_tyre.signals.noise import Level, moving_mean, robust_sd, signal_level
from bayes_tyre.signals.ramp import Ramp, find_ramp

#: Least ratio of a step's change to the noise.
CLEAR = 5.0
#: Rest that is needed before the step and after it, s.
REST_S = 0.25
#: The load's noise is that of means over this time, about half a response; the acceleration's spike is shorter.
LOAD_MEAN_S, SPIKE_MEAN_S = 0.02, 0.005
# The samples at rest end this long before the ramp: a straight ramp starts later than a smooth one.
_BEFORE_RAMP_S = 0.1
# Averaging time of the onset; how long the acceleration exceeds its noise at the onset, and stays within it at the end.
_ONSET_MEAN_S, _ONSET_RUN_S, _SETTLED_RUN_S = 1e-3, 2e-3, 0.2
_LONGEST_S = 2.0


class Step(NamedTuple):
    """A step of the load and the response to it: sample indices and signal-to-noise ratios.

    Attributes
    ----------
    pre_step:
        Number of samples at rest before it.
    onset, start, settled:
        Where the acceleration exceeds its noise; its last change of sign before that; where it is within its noise
        again.
    ramp:
        Of the load.
    load, acceleration:
        Level and noise before the step, kN and m/s^2 (upward).
    spike_m_per_s2:
        Largest mean acceleration over 5 ms, from its level.
    load_clarity, acceleration_clarity:
        Change of load in standard deviations of its 20 ms means; spike in those of the acceleration's 5 ms means.
    """

    pre_step: int
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
    """Return the number of samples at rest before a ramp.

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
        The load's ramp; None: detect it.

    Raises
    ------
    BadInput
        If load or acceleration do not exceed their noise (the message has the values), or the rest is too short.
    """
    ramp = ramp or find_ramp(signals.load_kN, signals.dt_s)
    pre_step, dt_s = pre_step_samples(ramp, signals), signals.dt_s
    load = signal_level(signals.load_kN[:pre_step], dt_s, LOAD_MEAN_S)
    change, load_clarity = ramp.after_kN - ramp.before_kN, _check_load(ramp, load)
    level = signal_level(signals.acceleration_m_per_s2[:pre_step], dt_s, LOAD_MEAN_S)
    moved = signals.acceleration_m_per_s2 - level.mean
    spike, clarity = _spike(moved, pre_step, ramp, dt_s)
    onset = _onset(moved, pre_step, ramp, -np.sign(change), dt_s) if clarity >= CLEAR else None
    if onset is None:
        raise BadInput(
            f"acceleration spikes by {spike:.2g} m/s^2, {clarity:.2g} times the noise of its 5 ms means of "
            f"{_ratio(spike, clarity):.2g} m/s^2; a step needs {CLEAR:g}, towards the load's change, by the load's ramp"
        )
    before = np.flatnonzero(np.diff(np.signbit(moved[:onset])))
    start = int(before[-1]) if len(before) else onset
    settled = _settled(moved, pre_step, onset, max(onset, int(ramp.end_s / dt_s)), dt_s)
    return Step(pre_step, onset, start, settled, ramp, load, level, spike, load_clarity, clarity)


def _check_load(ramp: Ramp, load: Level) -> float:
    """Return the ratio of the load's change to its noise; BadInput if it is too small."""
    change = ramp.after_kN - ramp.before_kN
    ratio = _ratio(abs(change), load.block_sd)
    if ratio < CLEAR:
        raise BadInput(
            f"load changes by {change:.2g} kN, {ratio:.2g} times the noise of its 20 ms means of {load.block_sd:.2g} "
            f"kN; a step needs {CLEAR:g}"
        )
    return ratio


def _ratio(value: float, noise: float) -> float:
    return value / max(noise, 1e-9)


def _spike(moved: Samples, pre_step: int, ramp: Ramp, dt_s: float) -> tuple[float, float]:
    """Return the largest 5 ms mean about the ramp, m/s^2, and its ratio to the noise of such means."""
    length = max(1, round(SPIKE_MEAN_S / dt_s))
    means = moving_mean(moved, length)
    spike = float(np.abs(means[pre_step : int((ramp.end_s + _BEFORE_RAMP_S) / dt_s)]).max())
    return spike, _ratio(spike, robust_sd(means_of_blocks(moved[:pre_step], length)))


def _smooth(moved: Samples, pre_step: int, dt_s: float) -> tuple[Samples, float]:
    """Return means over 1 ms and a threshold above their noise, m/s^2."""
    means = moving_mean(moved, max(1, round(_ONSET_MEAN_S / dt_s)))
    return means, CLEAR * max(robust_sd(means[:pre_step]), 1e-9)


def _onset(moved: Samples, pre_step: int, ramp: Ramp, sign: float, dt_s: float) -> int | None:
    """Return where the acceleration exceeds its noise in the direction of the load's change; None if it does not."""
    means, level = _smooth(moved, pre_step, dt_s)
    stop = int((ramp.end_s + _BEFORE_RAMP_S) / dt_s)
    run = _first_run(sign * means[pre_step:stop] > level, max(1, round(_ONSET_RUN_S / dt_s)))
    return None if run is None else pre_step + run


def _settled(moved: Samples, pre_step: int, onset: int, after: int, dt_s: float) -> int:
    """Return where the motion has come to rest: within its noise for two periods of the slowest vibration."""
    means, level = _smooth(moved, pre_step, dt_s)
    last = len(moved) - round(REST_S / 2 / dt_s)
    # A rolling tyre's runout changes with the step: its remainder does not count as vibration.
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
