"""The likelihood of a record's tyre parameters: the posterior with the record's own priors divided out.

Without this the priors would count once for every record.

In standardised coordinates the priors of a record's parameters are independent normal(0, 1). A normal posterior with
mean u and covariance S then comes from a likelihood with precision S^-1 - 1 and linear term S^-1 u. The logarithms in
the hierarchy are linear in these coordinates: the transformation is exact.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.units import KN_PER_KG_MM_PER_S2

#: A direction in which a record narrows its prior's variance by less than about this share counts as uninformed: a
#: covariance from some hundred draws is no more precise, and a difference of two such numbers may be negative.
LEAST_INFORMATION = 0.1
#: Factor on the standard deviations of an estimate that failed its check. It keeps a tenth of its weight: one bad
#: record does not move a case of three, and a case of bad records is not lost.
WIDENED = 3.0
#: Positions of k, the friction and beta of a law that has them; from the end, of mass and damping.
_K, _SETTLED, _BETA, _M, _C = 0, 1, 2, -2, -1


class RecordLikelihood(NamedTuple):
    """A normal likelihood of the logarithms of a law's `parameters`: exp(-|rows @ logarithms - target|^2 / 2).

    Rows of zeros are directions in which the record is uninformative.
    """

    rows: Float[np.ndarray, "p p"]
    target: Float[np.ndarray, " p"]


def without_prior(mean: Float[np.ndarray, " n"], covariance: Float[np.ndarray, "n n"]) -> RecordLikelihood:
    """Return the likelihood behind a normal posterior whose prior is normal(0, 1), in the same coordinates.

    Raises
    ------
    BadInput
        If the covariance is not finite and positive definite.
    """
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance)[0] > 0):
        raise BadInput("its estimate has no covariance: no motion to be followed; look at it with process --figures")
    precision = np.linalg.inv(covariance)
    information, directions = np.linalg.eigh((precision + precision.T) / 2 - np.eye(len(mean)))
    root = np.sqrt(np.where(information > LEAST_INFORMATION, information, 0.0))
    linear = directions.T @ precision @ mean
    target = np.divide(linear, root, out=np.zeros_like(linear), where=root > 0)
    return RecordLikelihood(root[:, None] * directions.T, target)


def likelihood_of(
    rig: Rig,
    log_mean: Float[np.ndarray, " p"],
    log_covariance: Float[np.ndarray, "p p"],
    prior: Float[np.ndarray, "2 parameters"],
    *,
    trusted: bool = True,
    law: MotionLaw = FANCHER,
) -> RecordLikelihood:
    """Return the likelihood of the logarithms of a law's `parameters`, given a record's readings.

    Parameters
    ----------
    rig:
        Geometry.
    log_mean, log_covariance:
        Of the record's posterior, priors included: of the logarithms of the law's `reported_parameters`.
    prior:
        Means and standard deviations of the priors of the fit, as in `window.Window`.
    trusted:
        False for an estimate that failed its check: the likelihood is then `WIDENED`.
    law:
        Force law of the fit.

    Raises
    ------
    BadInput
        If the estimate has no covariance.
    """
    mean, covariance = hierarchy_moments(log_mean, log_covariance, law)
    to_standard, shift = standardisation(rig, prior, len(mean))
    rows, target = without_prior(to_standard @ mean + shift, to_standard @ covariance @ to_standard.T)
    factor = 1.0 if trusted else WIDENED
    return RecordLikelihood(rows @ to_standard / factor, (target - rows @ shift) / factor)


def hierarchy_moments(
    log_mean: Float[np.ndarray, " p"], log_covariance: Float[np.ndarray, "p p"], law: MotionLaw = FANCHER
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Return mean and covariance of the logarithms of a law's `parameters` from those of its `reported_parameters`.

    They differ for Fancher's law alone, by x second, here x - k beta: the covariance is converted to first order.

    Raises
    ------
    BadInput
        If x is not above k beta.
    """
    if "x" not in law.reported:
        return log_mean, log_covariance
    k, x, beta = np.exp(log_mean[[_K, _SETTLED, _BETA]])
    settled = x - k * beta
    if not settled > 0:
        raise BadInput(
            f"its estimate has x {x:.3g} kN, not above k beta {k * beta:.3g} kN, and would make energy; record it again"
        )
    jacobian = np.eye(len(log_mean))
    jacobian[_SETTLED, [_K, _SETTLED, _BETA]] = -k * beta / settled, x / settled, -k * beta / settled
    mean = log_mean.copy()
    mean[_SETTLED] = np.log(settled)
    return mean, jacobian @ log_covariance @ jacobian.T


def standardisation(
    rig: Rig, prior: Float[np.ndarray, "2 parameters"], parameters: int
) -> tuple[Float[np.ndarray, "p p"], Float[np.ndarray, " p"]]:
    """Return matrix and shift from the logarithms of a law's `parameters` to the first standardised parameters."""
    mean, sd = prior[:, :parameters]
    matrix = np.eye(parameters)
    # log ratio = log c - log 2 - log(k at the wheel centre times m) / 2
    matrix[_C, [_K, _M]] = -0.5
    shift = -mean.copy()
    shift[_C] -= np.log(2.0) + 0.5 * np.log(geometry.curvature_factor(rig) * KN_PER_KG_MM_PER_S2)
    return matrix / sd[:, None], shift / sd
