"""How probable a record's readings are under a law: all parameters integrated out, a number to compare laws by.

``p(readings) = integral of p(readings | parameters) p(parameters)``. The weighted draws about the peak give it:
the mean of prior times likelihood over the density of the proposal. Where the weights are unreliable, Laplace's
approximation is used. What is estimated from the record itself is fixed, as in the fit, each law with its own: noise
and road of a rolling record, and of any the sizes of the force and of the load's departure that are left out. The prior
of the force's size counts.
"""

import numpy as np
from jaxtyping import Float

from bayes_tyre.inference.motion.record.disturbance.matern_process import log_prior_of_size
from bayes_tyre.inference.motion.record.importance_sampling import WeightedDraws
from bayes_tyre.inference.motion.record.likelihood import RecordLikelihood, standardisation
from bayes_tyre.inference.motion.record.map_fit import MapEstimate, log_density
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.rig.axle import Rig


def log_evidence(window: Window, estimate: MapEstimate, weighted: WeightedDraws | None) -> float:
    """Return the log density of a window's readings under its law, in units of the readings; NaN without a covariance.

    Parameters
    ----------
    window, estimate:
        Readings and noise; the peak and Laplace's covariance.
    weighted:
        Draws about the peak; None: take Laplace's approximation.
    """
    sign, log_volume = np.linalg.slogdet(np.asarray(estimate.covariance))
    if not (sign > 0 and np.isfinite(log_volume)):
        return float("nan")
    # The prior's (2 pi)^(-parameters / 2) cancels against that of the draws, and against Laplace's integral.
    above = log_density(window, estimate) if weighted is None else weighted.log_mean_weight
    return float(above + 0.5 * log_volume + _log_noise(window))


def log_constant(
    rig: Rig, likelihood: RecordLikelihood, prior: Float[np.ndarray, "2 parameters"], log_evidence: float
) -> float:
    """Return the log of the factor that turns a record's normal likelihood into the density of its readings.

    The likelihood is of the tyre's, mass's and damping's logarithms; averaged over their priors, with which the record
    was fitted, it then is the evidence.

    Parameters
    ----------
    rig:
        Geometry.
    likelihood:
        Of `bayes_tyre.inference.motion.record.likelihood.likelihood_of`.
    prior:
        Means and standard deviations of the priors that the record was fitted with, as in `window.Window`.
    log_evidence:
        Of the record.
    """
    to_standard, shift = standardisation(rig, prior, len(likelihood.target))
    rows = likelihood.rows @ np.linalg.inv(to_standard)
    return float(log_evidence - log_average(rows, likelihood.target + rows @ shift, np.ones(len(shift))))


def log_average(rows: np.ndarray, offset: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return the log of the mean of exp(-|rows @ z - offset|^2 / 2) over z normal about 0, independent.

    Parameters
    ----------
    rows:
        Shape (..., rows, p).
    offset:
        Shape (..., rows).
    variance:
        Of z, shape (..., p).
    """
    covariance = np.eye(rows.shape[-2]) + (rows * variance[..., None, :]) @ np.swapaxes(rows, -1, -2)
    squares = np.sum(offset * np.linalg.solve(covariance, offset[..., None])[..., 0], axis=-1)
    return np.asarray(-0.5 * (squares + np.linalg.slogdet(covariance)[1]))


def _log_noise(window: Window) -> float:
    """Return the log density of readings whose residuals are all 0, with the prior of a force's size."""
    weight = np.asarray(window.weight)
    present = weight > 0
    noise = float(np.sum(np.log(weight[present])) - 0.5 * present.sum() * np.log(2 * np.pi))
    random = window.disturbance
    if random is None:
        return noise
    if random.whitening is not None:  # a triangle; without a reading there is nothing to be whitened
        noise += float(np.sum(np.log(np.diag(np.asarray(random.whitening))[present[0]])))
    return noise + float(np.sum(np.log1p(-np.asarray(random.shrink)))) + float(log_prior_of_size(random.force_size))
