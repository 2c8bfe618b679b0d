"""A record's most probable parameters, put there: no motion is fitted."""

import jax.numpy as jnp
from jaxtyping import ArrayLike, Float

from bayes_tyre.inference.motion.record.map_fit import MapEstimate


def map_estimate(
    standard: Float[ArrayLike, " parameters"],
    covariance: Float[ArrayLike, "parameters parameters"],
    *,
    converged: bool = True,
) -> MapEstimate:
    """Return an estimate whose residuals say nothing."""
    nothing = jnp.zeros(3)
    fit = jnp.array(1), jnp.zeros(()), jnp.ones(()), jnp.array(converged)
    return MapEstimate(jnp.asarray(standard), jnp.asarray(covariance), nothing, nothing, *fit)
