"""The periodic runout of a rolling tyre: turns of wheel and rollers, fitted before the step and removed everywhere."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Samples, means_of_blocks
from bayes_tyre.rig.axle import Rig, needed
from bayes_tyre.signals.channels import Signals

Columns = Float[np.ndarray, "columns samples"]
#: Harmonics of each turning body.
WHEEL_HARMONICS, ROLLER_HARMONICS = 5, 3
# A loaded tyre rolls on less than its unloaded radius, and the speed is not exact: a turn is searched this far about
# its nominal frequency, on means over 4 ms. Fewer turns than this before the step are indistinguishable from a drift.
_SEARCH, _MEAN_S, _LEAST_TURNS = 0.06, 4e-3, 2.0


class Turning(NamedTuple):
    """A turning body: turns a second and how many harmonics of them."""

    turn_Hz: float
    harmonics: int


class Runout(NamedTuple):
    """What was removed: the turning bodies, refined, and the amplitude of their acceleration (root mean square)."""

    bodies: tuple[Turning, ...]
    acceleration_rms_m_per_s2: float


def nominal_bodies(rig: Rig, speed_km_h: float) -> tuple[Turning, ...]:
    """Return wheel and rollers (where there are any) turning at a road speed, km/h, without slip.

    Raises
    ------
    BadInput
        If the rig file has no tyre radius: without removal, runout would count as motion of the step.
    """
    mm_per_s = speed_km_h / 3.6e-3
    tyre = needed(rig.tyre, rig, "tyre")
    bodies = [Turning(mm_per_s / (2 * math.pi * tyre.unloaded_radius_mm), WHEEL_HARMONICS)]
    if rig.rollers is not None:
        bodies.append(Turning(mm_per_s / (2 * math.pi * rig.rollers.radius_mm), ROLLER_HARMONICS))
    return tuple(bodies)


def remove_runout(signals: Signals, pre_step: int, bodies: tuple[Turning, ...]) -> tuple[Signals, Runout]:
    """Return the signals without what is periodic before the step.

    The frequencies are refined on the acceleration about their nominal values, one body after the other; then sines
    and cosines of all harmonics are fitted to each channel before the step by least squares, with its mean and slope,
    and taken away from the whole of it.

    Parameters
    ----------
    signals:
        Three channels.
    pre_step:
        Samples before the step.
    bodies:
        As `nominal_bodies` gives them.

    Raises
    ------
    BadInput
        If one of them turns too seldom before the step for its runout to be told from it.
    """
    time_s = signals.time_s - signals.time_s[0]
    rest_s, slowest_Hz = time_s[pre_step - 1], min(body.turn_Hz for body in bodies)
    if rest_s * slowest_Hz < _LEAST_TURNS:
        raise BadInput(
            f"{rest_s:.2g} s before the step are {rest_s * slowest_Hz:.2g} turns of what turns at {slowest_Hz:.2g} Hz, "
            f"and runout takes {_LEAST_TURNS:g}; begin the recording {_LEAST_TURNS / slowest_Hz:.2g} s before the step"
        )
    length = max(1, round(_MEAN_S / signals.dt_s))
    means = means_of_blocks(signals.acceleration_m_per_s2[:pre_step], length)
    refined = _refined(means_of_blocks(time_s[:pre_step], length), means, bodies)
    columns = columns_of(time_s, refined)
    trend = np.stack([np.ones(pre_step), time_s[:pre_step] - time_s[:pre_step].mean()])
    design = np.concatenate([columns[:, :pre_step], trend])
    gram = design @ design.T
    clean = []
    for channel in signals[1:]:
        weights = np.linalg.solve(gram, design @ channel[:pre_step])[: len(columns)]
        clean.append(channel - weights @ columns)
    removed = signals.acceleration_m_per_s2 - clean[0]
    return Signals(signals.time_s, *clean), Runout(refined, float(np.sqrt(np.mean(removed**2))))


def _refined(time_s: Samples, values: Samples, bodies: tuple[Turning, ...]) -> tuple[Turning, ...]:
    refined = list(bodies)
    for reach, sweeps in ((_SEARCH, 2), (_SEARCH / 20, 2)):
        for i in list(range(len(refined))) * sweeps:
            centre = refined[i].turn_Hz
            # Steps that the highest harmonic's peak, as wide as 1 / duration, cannot fall between.
            step = 0.2 / (time_s[-1] * refined[i].harmonics) * (1.0 if reach == _SEARCH else 0.1)
            count = max(2, math.ceil(reach * centre / step))
            tried = centre + np.linspace(-1, 1, 2 * count + 1) * reach * centre
            others = np.concatenate([columns_of(time_s, refined[:i] + refined[i + 1 :]), np.ones((1, len(time_s)))])
            own = [columns_of(time_s, [refined[i]._replace(turn_Hz=turn_Hz)]) for turn_Hz in tried]
            left = [_left_over(values, np.concatenate([columns, others])) for columns in own]
            refined[i] = refined[i]._replace(turn_Hz=_peak(tried, np.array(left)))
    return tuple(refined)


def _left_over(values: Samples, design: Columns) -> float:
    weights = np.linalg.lstsq(design @ design.T, design @ values, rcond=1e-10)[0]
    return float(np.sum((values - weights @ design) ** 2))


def _peak(tried: Samples, left: Samples) -> float:
    """Return where the parabola through the best frequency and its neighbours is least."""
    i = int(np.clip(np.argmin(left), 1, len(tried) - 2))
    below, here, above = left[i - 1 : i + 2]
    bend = below - 2 * here + above
    shift = np.clip(0.5 * (below - above) / bend, -1, 1) if bend > 0 else 0.0
    return float(tried[i] + shift * (tried[1] - tried[0]))


def columns_of(time_s: Samples, bodies: Sequence[Turning]) -> Columns:
    """Return the sines, then the cosines, of all harmonics; powers of each body's first cost a fourth of sines."""
    harmonics = []
    for body in bodies:
        first = np.exp(2j * np.pi * body.turn_Hz * time_s)
        harmonics.append(first)
        for _ in range(body.harmonics - 1):
            harmonics.append(harmonics[-1] * first)
    both = [*(one.imag for one in harmonics), *(one.real for one in harmonics)]
    return np.array(both).reshape(-1, len(time_s))  # no body, no column
