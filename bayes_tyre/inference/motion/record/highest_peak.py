"""The highest peak of a record's posterior, by way of the draws about a lower one.

All starting points of a fit may lead to one peak although another is higher: with a load that rings, at another shape
of its step. Draws by importance sampling reach farther than the solver's steps. Where their weights have no reliable
mean, those of the largest weights are the points from which a higher peak is looked for.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from bayes_tyre.inference.motion.record.importance_sampling import ROUNDS, WeightedDraws, weighted_draws
from bayes_tyre.inference.motion.record.map_fit import MapEstimate, log_density, refine_map
from bayes_tyre.inference.motion.record.window_fit import DISTURBED_TOLERANCE, FORCED_AT_PEAK, Fit, fit_about
from bayes_tyre.rig.axle import Rig

#: Peaks that are climbed at most, one from the draws about the other; draws of the largest weight to start from.
MOST_PEAKS, STARTS = 3, 2
#: A peak is higher whose log density is above the other's by more than this, which the solver's tolerance is not.
HIGHER = 0.1


class Drawn(NamedTuple):
    """The fit about the highest peak found, and the draws about it."""

    fit: Fit
    draws: WeightedDraws


def drawn_about_highest_peak(rig: Rig, fit: Fit) -> Drawn:
    """Return draws from the posterior of a fit's parameters, and the fit about the highest peak that they lead to.

    Parameters
    ----------
    rig:
        Geometry; static.
    fit:
        Of `window_fit.fit_window`.
    """
    for _ in range(MOST_PEAKS):
        draws = _draws(rig, fit, rounds=1)
        if draws.trusted or np.isnan(draws.pareto_k):
            return Drawn(fit, draws)
        higher = _higher_peak(rig, fit, draws)
        if higher is None:
            break
        fit = higher
    return Drawn(fit, _draws(rig, fit))


def _draws(rig: Rig, fit: Fit, rounds: int = ROUNDS) -> WeightedDraws:
    return weighted_draws(rig, fit.estimate.standard, fit.estimate.covariance, fit.window, rounds)


def _higher_peak(rig: Rig, fit: Fit, draws: WeightedDraws) -> Fit | None:
    """Return the fit about a higher peak; None where the draws lead to none."""
    starts = draws.standard[np.argsort(-draws.weights)[:STARTS]]
    peaks = [_peak(rig, fit, start) for start in starts]
    densities = np.nan_to_num([log_density(fit.window, peak) for peak in peaks], nan=-np.inf)
    highest = peaks[int(np.argmax(densities))]
    if not densities.max() > log_density(fit.window, fit.estimate) + HIGHER:
        return None
    about = fit_about(rig, fit, highest)
    return about if about.estimate.converged else fit._replace(estimate=highest)


def _peak(rig: Rig, fit: Fit, start: Float[np.ndarray, " parameters"]) -> MapEstimate:
    refined = refine_map(rig, fit.window, jnp.asarray(start), DISTURBED_TOLERANCE, FORCED_AT_PEAK)
    return jax.tree.map(np.asarray, refined)
