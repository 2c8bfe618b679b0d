"""What a motion says of its tyre once the record's own priors are taken out: else they would count once a record.

In standard coordinates the priors of a record's unknowns are normal(0, 1) and independent, those of the tyre, mass and
damping of all others too. A normal posterior with mean u and covariance S then comes from a likelihood with precision
S^-1 - 1 and pull S^-1 u. The logarithms that the hierarchy has are linear in these coordinates: nothing is lost on the
way to them.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig
from bayes_tyre.rig.motion import KN_PER_KG_MM_PER_S2

#: Where a record narrows its prior's variance by less than about this share it says nothing: a covariance from some
#: hundred draws is not known better, and a difference of two such numbers may be below 0.
SAID_LEAST = 0.1
#: Standard deviations of an estimate that failed its check are widened so many times: it keeps a tenth of its weight,
#: so that neither one bad record moves a case of three nor a case of bad records is lost.
WIDENED = 3.0
#: Where k, the friction of a law that has one, and its beta stand; from behind, where mass and damping do.
_K, _SETTLED, _BETA, _M, _C = 0, 1, 2, -2, -1


class RecordLikelihood(NamedTuple):
    """A normal likelihood of the logarithms of a law's `parameters`: exp(-|rows @ logarithms - target|^2 / 2).

    Rows of zeros are directions of which the record says nothing.
    """

    rows: Float[np.ndarray, "p p"]
    target: Float[np.ndarray, " p"]


def without_prior(mean: Float[np.ndarray, " n"], covariance: Float[np.ndarray, "n n"]) -> RecordLikelihood:
    """Return the likelihood behind a normal posterior whose prior is normal(0, 1), in the same coordinates.

    Raises
    ------
    BadInput
        If the covariance is none.
    """
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance)[0] > 0):
        raise BadInput("its estimate has no covariance: no motion to be followed; look at it with process --figures")
    precision = np.linalg.inv(covariance)
    said, directions = np.linalg.eigh((precision + precision.T) / 2 - np.eye(len(mean)))
    root = np.sqrt(np.where(said > SAID_LEAST, said, 0.0))
    pull = directions.T @ precision @ mean
    target = np.divide(pull, root, out=np.zeros_like(pull), where=root > 0)
    return RecordLikelihood(root[:, None] * directions.T, target)


def likelihood_of(
    rig: Rig,
    log_mean: Float[np.ndarray, " p"],
    log_covariance: Float[np.ndarray, "p p"],
    prior: Float[np.ndarray, "2 unknowns"],
    *,
    trusted: bool = True,
    law: MotionLaw = FANCHER,
) -> RecordLikelihood:
    """Return what a record's readings say of the logarithms of a law's `parameters`.

    Parameters
    ----------
    rig:
        Geometry.
    log_mean, log_covariance:
        Of the record's estimate, its priors in it: of the logarithms of the law's `told_parameters`.
    prior:
        Locations and scales of the unknowns that it was found with, as `motion_window.Window` has them.
    trusted:
        False for an estimate that failed its check: the likelihood is then `WIDENED`.
    law:
        That it was fitted with.

    Raises
    ------
    BadInput
        If the estimate has no covariance.
    """
    mean, covariance = hierarchy_moments(log_mean, log_covariance, law)
    to_standard, shift = to_standard_of(rig, prior, len(mean))
    rows, target = without_prior(to_standard @ mean + shift, to_standard @ covariance @ to_standard.T)
    wider = 1.0 if trusted else WIDENED
    return RecordLikelihood(rows @ to_standard / wider, (target - rows @ shift) / wider)


def hierarchy_moments(
    log_mean: Float[np.ndarray, " p"], log_covariance: Float[np.ndarray, "p p"], law: MotionLaw = FANCHER
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Return mean and covariance of the logarithms of a law's `parameters` from those of its `told_parameters`.

    They differ for Fancher's law alone, by x second, here x - k beta: to first order, as a record's own covariance is.

    Raises
    ------
    BadInput
        If x is not above k beta.
    """
    if "x" not in law.told:
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


def to_standard_of(
    rig: Rig, prior: Float[np.ndarray, "2 unknowns"], parameters: int
) -> tuple[Float[np.ndarray, "p p"], Float[np.ndarray, " p"]]:
    """Return matrix and shift from the logarithms of a law's `parameters` to the first standard unknowns."""
    location, scale = prior[:, :parameters]
    matrix = np.eye(parameters)
    # log ratio = log c - log 2 - log(k at the wheel centre times m) / 2
    matrix[_C, [_K, _M]] = -0.5
    shift = -location.copy()
    shift[_C] -= np.log(2.0) + 0.5 * np.log(geometry.curvature_factor(rig) * KN_PER_KG_MM_PER_S2)
    return matrix / scale[:, None], shift / scale
