"""Pareto-smoothed importance sampling (PSIS), by ArviZ: smoothed weights and the diagnostic k-hat.

Source: Vehtari et al. (2024), "Pareto smoothed importance sampling", Journal of Machine Learning Research 25.
"""

import numpy as np
from arviz_stats.base.array import array_stats
from jaxtyping import Float
from scipy.special import log_softmax

#: Largest k-hat for which importance weights have a reliable mean.
PARETO_K_MOST = 0.7
#: Largest logarithm between the ends of a tail that is fitted. Beyond, the largest ratios are all of the weight, and
#: ArviZ's fit overflows: it may even return a k-hat that passes.
_LONGEST_TAIL = 300.0


def smooth_log_weights(log_ratios: Float[np.ndarray, " draws"]) -> tuple[Float[np.ndarray, " draws"], float]:
    """Return the normalised, smoothed log weights of some draws, and the Pareto k-hat of their tail.

    Where a few draws of the tail have all of the weight, they are not smoothed, and k-hat is infinite.

    Parameters
    ----------
    log_ratios:
        Log of target over proposal density at each draw, up to a constant.
    """
    below = log_ratios.max() - log_ratios
    draws_of_tail = int(np.ceil(min(0.2 * len(below), 3.0 * np.sqrt(len(below)))))
    if np.sort(below)[draws_of_tail] > _LONGEST_TAIL:
        return log_softmax(log_ratios), np.inf
    # ArviZ takes minus the log ratio, as leave-one-out has it: the log likelihood.
    log_weights, pareto_k = array_stats.psislw(below)
    return log_weights, float(pareto_k)
