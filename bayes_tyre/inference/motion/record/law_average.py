"""A record's estimate averaged over force laws, each weighted by how probable it makes the record's readings.

The laws are Fancher's and its extensions, which have k, x, beta, mass and damping in common. Beforehand Fancher's is as
probable as all the others together: so that an extension carries the weight only where the readings ask for it.
Source: Hoeting, Madigan, Raftery and Volinsky (1999), Bayesian model averaging: a tutorial, Statistical Science 14.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.laws import FANCHER, MotionLaw, motion_law
from bayes_tyre.inference.motion.record.estimate import MotionEstimate, estimate_motion
from bayes_tyre.inference.motion.record.model.window import Recorded
from bayes_tyre.inference.motion.record.nuts import SETTINGS
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.rig.axle import Rig

#: Weight above which a law's status is that of the average.
NAMED_WEIGHT = 0.05
#: Why a record has no estimate.
NOT_CONVERGED = "the fit of its motion did not converge"


def estimate_by(
    rig: Rig,
    recorded: Recorded,
    law: MotionLaw = FANCHER,
    sampler: SamplerSettings | None = SETTINGS,
    estimate: Callable[..., MotionEstimate] = estimate_motion,
) -> MotionEstimate:
    """Return the estimate of one record by a law, or by the average of those that the law stands for.

    Parameters
    ----------
    rig, recorded, law, sampler:
        As `estimate_motion` has them. In an average no record is sampled by NUTS: it would take minutes a law.
    estimate:
        Estimates the record by one law.
    """
    if not law.averaged:
        return estimate(rig, recorded, law, sampler)
    return average([estimate(rig, recorded, motion_law(name), None) for name in law.averaged], law.averaged)


def converged_estimate(rig: Rig, recorded: Recorded, law: MotionLaw = FANCHER) -> MotionEstimate:
    """Return the estimate of one record, for a result of motions.

    With a wrong law there need not be a posterior, and laws are compared on the same records: the estimate is kept, and
    its status says so. Fancher's law and what extends it are taken for right.

    Raises
    ------
    BadInput
        Where a fit of these did not converge, and its draws are not trusted.
    """
    found = estimate_by(rig, recorded, law)
    if law.reported == FANCHER.reported and not found.has_posterior:
        raise BadInput(f"{NOT_CONVERGED}; look at its channels with process --figures")
    return found


def average(estimates: Sequence[MotionEstimate], names: Sequence[str]) -> MotionEstimate:
    """Return the average of a record's estimates, weighted by their evidence.

    Fits without a posterior count only where none has one. Window and method are those of the most probable law;
    `status` joins those of all laws above `NAMED_WEIGHT`.

    Parameters
    ----------
    estimates, names:
        By each law, and the laws' names; what the estimates report is the same quantities.
    """
    evident = {name: each for name, each in zip(names, estimates, strict=True) if np.isfinite(each.log_evidence)}
    by_law = {name: each for name, each in evident.items() if each.has_posterior} or evident
    if not by_law:
        return replace(estimates[0], law_weights=dict.fromkeys(names, float("nan")))
    prior = np.array([one for name, one in zip(names, prior_weights(names), strict=True) if name in by_law])
    log_evidence = np.array([each.log_evidence for each in by_law.values()]) + np.log(prior / prior.sum())
    weights = np.exp(log_evidence - np.logaddexp.reduce(log_evidence))
    mean, covariance = mixture_moments(
        weights,
        np.array([each.log_mean for each in by_law.values()]),
        np.array([each.log_covariance for each in by_law.values()]),
    )
    return replace(
        list(by_law.values())[int(np.argmax(weights))],
        log_mean=mean,
        log_covariance=covariance,
        log_draws=np.concatenate([each.log_draws for each in by_law.values()]),
        weights=np.concatenate([weight * each.weights for weight, each in zip(weights, by_law.values(), strict=True)]),
        narrower_without_force=weights @ np.array([each.narrower_without_force for each in by_law.values()]),
        status=joined_status(weights, [each.status for each in by_law.values()]),
        log_evidence=float(np.logaddexp.reduce(log_evidence)),
        law_weights=dict.fromkeys(names, 0.0) | dict(zip(by_law, weights.tolist(), strict=True)),
        by_law=evident,
    )


def prior_weights(names: Sequence[str]) -> Float[np.ndarray, " laws"]:
    """Return how probable each law is beforehand, of sum 1: Fancher's as probable as all the others together."""
    prior = np.array([1.0 if name == FANCHER.name else 1.0 / max(len(names) - 1, 1) for name in names])
    return prior / prior.sum()


def mixture_moments(
    weights: Float[np.ndarray, " laws"],
    means: Float[np.ndarray, "laws p"],
    covariances: Float[np.ndarray, "laws p p"],
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Return mean and covariance of a mixture with these weights, of sum 1, from those of its components."""
    mean = weights @ means
    between = (weights[:, None] * (means - mean)).T @ (means - mean)
    return mean, np.tensordot(weights, covariances, 1) + between


def joined_status(weights: Float[np.ndarray, " laws"], statuses: Sequence[str]) -> str:
    """Return the statuses of the laws above `NAMED_WEIGHT`, joined; empty where none has one."""
    named = [status for status, weight in zip(statuses, weights, strict=True) if weight > NAMED_WEIGHT]
    return "; ".join(dict.fromkeys(filter(None, named)))
