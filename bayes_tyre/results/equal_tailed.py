"""The equal-tailed interval of draws, with their median."""

import numpy as np
from jaxtyping import Float


def median_lower_upper(draws: Float[np.ndarray, "draws *shape"], interval: float) -> Float[np.ndarray, "3 *shape"]:
    """Return the median of draws, and the ends of the equal-tailed interval of this probability, draw axis first."""
    return np.quantile(draws, [0.5, (1.0 - interval) / 2.0, (1.0 + interval) / 2.0], axis=0)
