"""Prior and posterior of each scale side by side, and how much of the prior's width the data have taken away."""

from typing import NamedTuple

import arviz as az
import numpy as np
from jaxtyping import Float

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.priors import Prior, Priors
from bayes_tyre.results.hyperparameters import Hyperparameter

#: Points of a density over all that is shown, and as many over the posterior's draws.
POINTS = 200


class Scale(NamedTuple):
    """One scale.

    Attributes
    ----------
    name, unit:
        As `summary.csv` has them.
    log:
        Whether its prior is spread on the logarithm: densities are then per unit of logarithm.
    at, prior, posterior:
        Shape (points,): values, and both densities there, each over its highest point.
    contraction:
        1 - (posterior / prior interquartile range) squared, of the logarithm where `log`: 0 where the data said
        nothing, 1 where they said all. It is 1 - the ratio of variances for normal shapes, and steadier for others.
    """

    name: str
    unit: str
    log: bool
    at: Float[np.ndarray, " points"]
    prior: Float[np.ndarray, " points"]
    posterior: Float[np.ndarray, " points"]
    contraction: float


def scales(found: list[Hyperparameter], priors: Priors = PRIORS) -> list[Scale]:
    """Return every scalar of the posterior that has a prior, with the prior that it was fitted with."""
    of_all = [
        hyperparameter for hyperparameter in found if hyperparameter.configuration is None and hyperparameter.varies
    ]
    return [_scale(one, priors[one.name]) for one in of_all if one.name in priors]


def _scale(hyperparameter: Hyperparameter, of: Prior) -> Scale:
    distribution, log = of.scipy(), of.of_logarithm
    of_prior = distribution.ppf([0.005, 0.25, 0.75, 0.995])
    low, *quartiles, high = np.log(of_prior) if log else of_prior
    draws = np.log(hyperparameter.draws.ravel()) if log else hyperparameter.draws.ravel()
    least, most = float(draws.min()), float(draws.max())
    ends_at_zero = not log and distribution.support()[0] == 0
    # A half-normal prior is highest at zero, and a posterior may be: the density is mirrored there, not cut off.
    edge = {"custom_lims": (0.0, most), "bound_correction": True} if ends_at_zero else {}
    x, height, _ = az.kde(draws, **edge)
    whole = np.linspace(min(0.0 if ends_at_zero else low, least), max(high, most), POINTS)
    at = np.sort(np.concatenate([whole, np.linspace(least, most, POINTS)]))
    values = np.exp(at) if log else at
    prior = distribution.pdf(values) * (values if log else 1.0)
    quarter, three_quarters = np.quantile(draws, [0.25, 0.75])
    return Scale(
        hyperparameter.name,
        hyperparameter.unit,
        log,
        values,
        prior / prior.max(),
        np.interp(at, x, height / height.max(), left=None if ends_at_zero else 0.0, right=0.0),
        1.0 - float((three_quarters - quarter) / (quartiles[1] - quartiles[0])) ** 2,
    )
