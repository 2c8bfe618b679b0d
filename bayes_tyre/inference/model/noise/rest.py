"""Noisy readings of a displacement that does not move yet, as at rest before a step, or moves slowly at first.

Each by itself would lie as likely anywhere near the start of the curve, where this is steepest. Together they say that
the tyre is still where it starts, and where that is; or along which path it leaves there.
"""

import numpy as np
from jaxtyping import Float

from bayes_tyre.batch import Batch
from bayes_tyre.inference.model.noise.displacement_errors import DisplacementErrors
from bayes_tyre.inference.model.noise.smooth_path import smooth_near_start

#: Readings whose mean is held against that of all before them; a rest has at least twice as many.
_WINDOW = 5
#: Standard errors by which the one mean is beyond the other where the tyre moves.
_MOVES = 3.0


def at_rest(
    batch: Batch, sd_mm: Float[np.ndarray, " records"]
) -> tuple[Float[np.ndarray, "records points"], DisplacementErrors]:
    """Return displacements (mm) that are the mean at rest and smooth near the start, and the errors of all.

    Parameters
    ----------
    batch:
        The records, their points in the order of time.
    sd_mm:
        Standard deviation of the independent error of each reading in a record.
    """
    path, errors = batch.displacement_mm.copy(), DisplacementErrors.alike(batch, sd_mm)
    for record in np.flatnonzero(sd_mm):
        own = record, batch.present[record]
        read = batch.displacement_mm[own]
        rest = resting(read, sd_mm[record])
        start = read[: max(rest, 1)].mean()
        smooth = smooth_near_start(read, start, sd_mm[record])
        path[own], errors.averaged[own] = smooth.path_mm, smooth.averaged
        if rest:
            path[record, :rest] = path[record, ~batch.present[record]] = start  # padding: where it starts
            errors.sd_mm[record, :rest] = errors.start_mm[record, :rest] = 0.0
            errors.averaged[record, :rest] = 1.0
            errors.start_mm[record, rest:] = sd_mm[record] / np.sqrt(rest)
    return path, errors._replace(shared=bool(np.any(errors.averaged > 1.0)))


def resting(read: Float[np.ndarray, " points"], sd_mm: float) -> int:
    """Return how many of the first readings are at rest, 0 if it is not clear that any but the first is.

    They are half of those before the mean of a few moves on from that of all before: a slow start is not seen at once.
    """
    sums = np.concatenate([[0.0], np.cumsum(np.sign(np.sum(read - read[0])) * (read - read[0]))])
    before = np.arange(_WINDOW, len(read) - _WINDOW)
    step = (sums[before + _WINDOW] - sums[before]) / _WINDOW - sums[before] / before
    moves = step > _MOVES * sd_mm * np.sqrt(1.0 / _WINDOW + 1.0 / before)
    first = int(before[np.argmax(moves)]) if moves.any() else 0
    return first // 2 if first >= 2 * _WINDOW else 0
