"""Displacements that a converter rounded to its steps: what the readings say of the path, and what they leave open.

Readings in a row that show one step share their rounding error, so that they are no independent readings. But where
the reading changes, the displacement was half-way between the two steps: between these moments it is taken to move
evenly. Before the first of them it moves as from rest, with a constant acceleration, from the earliest moment at which
it can have started.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.batch import Batch
from bayes_tyre.inference.model.noise.displacement_errors import DisplacementErrors
from bayes_tyre.inference.model.noise.rest import at_rest

#: Standard deviation of rounding to steps of 1.
UNIFORM_SD = 12.0**-0.5
#: How far a displacement may be off a multiple of the converter's step, in steps: tables round.
_OFF_STEP = 0.1
#: Least part of the differences that are one step, of those that are several, and of third differences above half a
#: step, which no smooth plan has, where no reading is repeated.
_MIXED = 0.1
#: Fewest times that the differences turn from growing to falling or back: those of a plan that is fine, then coarse,
#: then fine again do so once, those of a converter again and again.
_LEAST_TURNS = 3
#: Fewest readings that repeat an earlier one: a row or two may be in a table twice.
_LEAST_REPEATED = 3
#: Largest part of the changes that go against the motion: where more do, noise changes the reading, not the motion.
_MOST_BACK = 0.02
#: From rest, two steps are passed at once sqrt(2) times as late as one: (first - start) / (second - first) at most.
_EARLIEST = 1.0 + np.sqrt(2.0)


def converter_step_mm(batch: Batch) -> Float[np.ndarray, " records"]:
    """Return the step of the converter (mm) in each record: what its displacements are multiples of; 0 for none."""
    steps = np.zeros(len(batch.records))
    for record, (displacement, present) in enumerate(zip(batch.displacement_mm, batch.present, strict=True)):
        apart = np.diff(np.unique(displacement[present]))
        least = np.min(apart)
        multiples = np.round(apart / least)
        # Spacings of a plan may be multiples of one too: those of a converter repeat readings, or mix its steps. The
        # squares 0, 1, 4, 9, ... do too, but no rounding is in them.
        rounded = np.abs(np.diff(displacement[present], n=3)) > least / 2.0
        bends = np.sign(np.round(np.diff(displacement[present], n=2) / least))
        turns = np.sum(np.diff(bends[bends != 0]) != 0)
        mixed = np.mean(rounded) > _MIXED and _MIXED < np.mean(multiples == 1) < 1.0 - _MIXED
        mixed = mixed and turns >= _LEAST_TURNS
        repeated = np.sum(present) - len(apart) - 1 >= _LEAST_REPEATED
        if (mixed or repeated) and np.abs(apart / least - multiples).max() < _OFF_STEP:
            steps[record] = least
    return steps


def between_steps(
    batch: Batch, step_mm: Float[np.ndarray, " records"]
) -> tuple[Float[np.ndarray, "records points"], DisplacementErrors]:
    """Return the displacements (mm) that the readings of a converter stand for, and their errors.

    Parameters
    ----------
    batch:
        The records, their points in the order of time and as far apart in it: of a table that was thinned along the
        path, more is taken to be known than is.
    step_mm:
        The converter's step in each, as `converter_step_mm` finds it; 0 leaves a record as it is, without errors.
    """
    sd_mm = step_mm * UNIFORM_SD
    noisy = np.zeros(len(step_mm), bool)
    for record in np.flatnonzero(step_mm):
        read = batch.displacement_mm[record, batch.present[record]]
        changes, way = np.diff(read)[np.diff(read) != 0], np.sum(read - read[0])
        noisy[record] = len(changes) < 2 or np.mean(changes * way < 0) > _MOST_BACK
        if noisy[record]:
            sd_mm[record] = max(sd_mm[record], _noise_mm(read))
    path, errors = at_rest(batch, np.where(noisy, sd_mm, 0.0))
    for record in np.flatnonzero((step_mm > 0) & ~noisy):
        own = record, batch.present[record]
        between = _between_changes(batch.displacement_mm[own], step_mm[record])
        path[own] = between.path_mm
        # As n readings of a step share their errors, each counts as a reading with 1 / sqrt(n) of its error.
        errors.sd_mm[own] = sd_mm[record] / np.sqrt(between.repeated)
        errors.start_mm[own] = sd_mm[record] * between.share_of_start
    return path, errors._replace(shared=errors.shared or bool(np.any((step_mm > 0) & ~noisy)))


class _Path(NamedTuple):
    """What readings in steps of a converter stand for.

    Attributes
    ----------
    path_mm:
        Shape (points,): the displacement.
    repeated:
        Shape (points,): how many readings in a row show the same step; 1 where they say no more than each by itself.
    share_of_start:
        Shape (points,): how much of the error of the displacement at the start is in each point's distance from it.
    """

    path_mm: Float[np.ndarray, " points"]
    repeated: Float[np.ndarray, " points"]
    share_of_start: Float[np.ndarray, " points"]


def _between_changes(read: Float[np.ndarray, " points"], step_mm: float) -> _Path:
    """Return the path that passes half-way between two steps where the reading changes from one to the other."""
    points = np.arange(len(read))
    before = np.flatnonzero(np.diff(read))
    change, half_way = before + 0.5, (read[before] + read[before + 1]) / 2.0
    number = np.searchsorted(change, points)
    repeated = np.bincount(number)[number].astype(float)
    start = max(0.0, change[0] - _EARLIEST * (change[1] - change[0]))
    risen = np.where(number == 0, np.maximum((points - start) / (change[0] - start), 0.0) ** 2, 1.0)
    path = np.interp(points, change, half_way)
    path = np.where(number == 0, read[0] + (half_way[0] - read[0]) * risen, path)
    # Two steps at once: the moment half-way lies within neither.
    path = np.clip(path, read - step_mm / 2.0, read + step_mm / 2.0)
    # Nothing follows the last change, and a reading alone on its step is best taken as it is.
    as_read = (number == len(change)) | (repeated == 1)
    return _Path(np.where(as_read, read, path), np.where(as_read, 1.0, repeated), risen)


def _noise_mm(read: Float[np.ndarray, " points"]) -> float:
    """Return the standard deviation of independent errors by third differences, in which no smooth path shows."""
    return float(np.sqrt(np.mean(np.diff(read, n=3) ** 2) / 20.0))
