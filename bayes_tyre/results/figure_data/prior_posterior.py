"""Prior and posterior density of each hyperparameter, and how much the data narrowed the prior (contraction)."""

from typing import NamedTuple

import numpy as np
from arviz_stats.visualization import kde
from jaxtyping import Float

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.priors import Prior, Priors
from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter

#: Points of a density over all that is shown, and as many over the posterior's draws.
POINTS = 200


class PriorPosterior(NamedTuple):
    """Prior and posterior density of one hyperparameter.

    Attributes
    ----------
    name, unit:
        As `summary.csv` has them.
    log:
        Whether the prior is a distribution of the logarithm: densities are then per unit of logarithm.
    at, prior, posterior:
        Shape (points,): values, and both densities there, each over its highest point.
    contraction:
        1 - (variance of the posterior / of the prior), of the logarithm where `log`: 0 where the data leave the prior
        as it is, 1 where they determine the value. As in `summary.csv`, whose prior is drawn: to about 0.01 the same.
    """

    name: str
    unit: str
    log: bool
    at: Float[np.ndarray, " points"]
    prior: Float[np.ndarray, " points"]
    posterior: Float[np.ndarray, " points"]
    contraction: float


def prior_posteriors(parameters: list[Hyperparameter], priors: Priors = PRIORS) -> list[PriorPosterior]:
    """Return every scalar of the posterior that has a prior, with the prior that it was fitted with."""
    candidates = [
        hyperparameter
        for hyperparameter in parameters
        if hyperparameter.configuration is None and hyperparameter.varies
    ]
    return [_prior_posterior(one, priors[one.name]) for one in candidates if one.name in priors]


def _prior_posterior(hyperparameter: Hyperparameter, prior: Prior) -> PriorPosterior:
    distribution, log = prior.scipy(), prior.of_logarithm
    ends = distribution.ppf([0.005, 0.995])
    low, high = np.log(ends) if log else ends
    variance = prior.parameters[1] ** 2 if log else distribution.var()
    draws = np.log(hyperparameter.draws.ravel()) if log else hyperparameter.draws.ravel()
    least, most = float(draws.min()), float(draws.max())
    ends_at_zero = not log and distribution.support()[0] == 0
    # A half-normal prior is highest at zero, and a posterior may be: the density is mirrored there, not cut off.
    edge = {"custom_lims": (0.0, most), "bound_correction": True} if ends_at_zero else {}
    x, height, _ = kde(draws, **edge)
    whole = np.linspace(min(0.0 if ends_at_zero else low, least), max(high, most), POINTS)
    at = np.sort(np.concatenate([whole, np.linspace(least, most, POINTS)]))
    values = np.exp(at) if log else at
    density = distribution.pdf(values) * (values if log else 1.0)
    return PriorPosterior(
        hyperparameter.name,
        hyperparameter.unit,
        log,
        values,
        density / density.max(),
        np.interp(at, x, height / height.max(), left=None if ends_at_zero else 0.0, right=0.0),
        1.0 - float(draws.var() / variance),
    )
