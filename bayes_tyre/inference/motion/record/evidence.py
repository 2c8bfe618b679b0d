"""How probable a record's readings are under a law: all unknowns integrated out, a number to compare laws by.

``p(readings) = integral of p(readings | unknowns) p(unknowns)``. The weighed draws about the peak give it: the mean of
prior times likelihood over the density that they were drawn from. Where their weights are of no use there is Laplace's
approximation. What of the noise was found from the record itself is taken as known, as in the fit; of a standing record
it is the same for every law, of a rolling one the law's own road and noise are in it.
"""

import numpy as np

from bayes_tyre.inference.motion.record.importance_sampling import WIDER, Weighed
from bayes_tyre.inference.motion.record.likelihood import RecordLikelihood, to_standard_of
from bayes_tyre.inference.motion.record.map_fit import Found
from bayes_tyre.inference.motion.record.window import Window
from bayes_tyre.rig.axle import Rig


def log_evidence(window: Window, found: Found, weighed: Weighed | None) -> float:
    """Return the log density of a window's readings under its law, in units of the readings; NaN without a covariance.

    Parameters
    ----------
    window, found:
        Readings and noise; the peak and Laplace's covariance.
    weighed:
        Draws about the peak; None: take Laplace's approximation.
    """
    sign, log_volume = np.linalg.slogdet(np.asarray(found.covariance))
    if not (sign > 0 and np.isfinite(log_volume)):
        return float("nan")
    # The prior's (2 pi)^(-unknowns / 2) cancels against that of the draws, and against Laplace's integral.
    if weighed is not None:
        above = weighed.log_mean_weight + len(found.standard) * np.log(WIDER)
    else:
        present = np.sum(np.asarray(window.weight) > 0, axis=1)
        above = -0.5 * float(found.chi_squared @ present + found.standard @ found.standard)
    return float(above + 0.5 * log_volume + _log_noise(window))


def log_constant(rig: Rig, likelihood: RecordLikelihood, window: Window, log_evidence: float) -> float:
    """Return the log of what a record's normal likelihood is to be multiplied with to be the density of its readings.

    The likelihood is of the tyre's, mass's and damping's logarithms; averaged over their priors, with which the record
    was fitted, it then is the evidence.

    Parameters
    ----------
    rig:
        Geometry.
    likelihood:
        Of `bayes_tyre.inference.motion.record.likelihood.likelihood_of`.
    window:
        That the record was fitted in.
    log_evidence:
        Of the record.
    """
    to_standard, shift = to_standard_of(rig, np.asarray(window.prior), len(likelihood.target))
    rows = likelihood.rows @ np.linalg.inv(to_standard)
    return float(log_evidence - log_average(rows, likelihood.target + rows @ shift, np.ones(len(shift))))


def log_average(rows: np.ndarray, off: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return the log of the mean of exp(-|rows @ z - off|^2 / 2) over z normal about 0, independent.

    Parameters
    ----------
    rows:
        Shape (..., rows, p).
    off:
        Shape (..., rows).
    variance:
        Of z, shape (..., p).
    """
    covariance = np.eye(rows.shape[-2]) + (rows * variance[..., None, :]) @ np.swapaxes(rows, -1, -2)
    squares = np.sum(off * np.linalg.solve(covariance, off[..., None])[..., 0], axis=-1)
    return np.asarray(-0.5 * (squares + np.linalg.slogdet(covariance)[1]))


def _log_noise(window: Window) -> float:
    """Return the log density of readings that are met exactly."""
    weight = np.asarray(window.weight)
    weight = weight[weight > 0]
    found = float(np.sum(np.log(weight)) - 0.5 * len(weight) * np.log(2 * np.pi))
    return found if window.road is None else found + float(np.sum(np.log1p(-np.asarray(window.road.shrink))))
