"""Pareto-smoothed importance sampling (PSIS), by ArviZ: smoothed weights and the diagnostic k-hat.

Source: Vehtari et al. (2024), "Pareto smoothed importance sampling", Journal of Machine Learning Research 25.
"""

import numpy as np
from arviz_stats.base.array import array_stats
from jaxtyping import Float

#: Largest k-hat for which importance weights have a reliable mean.
PARETO_K_MOST = 0.7


def smooth_log_weights(log_ratios: Float[np.ndarray, " draws"]) -> tuple[Float[np.ndarray, " draws"], float]:
    """Return the normalised, smoothed log weights of some draws, and the Pareto k-hat of their tail.

    Parameters
    ----------
    log_ratios:
        Log of target over proposal density at each draw, up to a constant.
    """
    # ArviZ takes minus the log ratio, as leave-one-out has it: the log likelihood.
    log_weights, pareto_k = array_stats.psislw(log_ratios.max() - log_ratios)
    return log_weights, float(pareto_k)
