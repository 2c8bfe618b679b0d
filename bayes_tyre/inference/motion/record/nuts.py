"""NUTS on one record's motion, for a posterior that importance sampling about its peak does not cover."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.model.coordinates.reparams import sample_coordinates
from bayes_tyre.inference.motion.record.importance_sampling import ProposalMap, proposal_map
from bayes_tyre.inference.motion.record.map_fit import MapEstimate, value_and_jacobian
from bayes_tyre.inference.motion.record.model.forward_model import residuals
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.inference.sampling.effective_sizes import ESS_LEAST_PER_CHAIN, R_HAT_MOST, statistics
from bayes_tyre.inference.sampling.nuts import CAREFUL_ACCEPTANCE
from bayes_tyre.inference.sampling.run import SamplerSettings, sample
from bayes_tyre.rig.axle import Rig

#: In these coordinates the posterior is nearly standard normal even where weights fail: a short warmup is enough.
SETTINGS = SamplerSettings(chains=4, warmup=150, draws=200)


class NutsDraws(NamedTuple):
    """Draws of a record's parameters.

    Attributes
    ----------
    standard:
        In standard deviations of their prior, shape (chains, draws, parameters).
    divergent:
        Number of divergent transitions; above 0, the sampler did not reach all of the posterior.
    """

    standard: Float[np.ndarray, "chains draws parameters"]
    divergent: int


def sample_motion(
    rig: Rig, window: Window, map_estimate: MapEstimate, settings: SamplerSettings = SETTINGS
) -> NutsDraws:
    """Return NUTS draws of a record's parameters, in the coordinates of the proposal of `importance_sampling`.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Readings and noise of the record.
    map_estimate:
        Peak and Laplace's covariance, positive definite.
    settings:
        Chains and draws.
    """
    # JAX arrays are arguments of the compiled function: another record of the same length needs no compilation.
    window = jax.tree.map(jnp.asarray, window)
    proposal = _proposal(rig, window, jnp.asarray(map_estimate.standard), jnp.asarray(map_estimate.covariance))

    def posterior(window: Window, proposal: ProposalMap) -> None:
        numpyro.factor(
            "log_density",
            -_negative_log_density(rig, window, proposal, sample_coordinates("coordinates", proposal.peak.shape)),
        )

    draws = sample(posterior, {"window": window, "proposal": proposal}, settings, acceptance=CAREFUL_ACCEPTANCE)
    return NutsDraws(
        np.asarray(_parameters(rig, window, proposal, draws.sites["coordinates"])),
        int(np.sum(draws.statistics["diverging"])),
    )


_proposal = jax.jit(proposal_map, static_argnums=0)


@functools.partial(jax.jit, static_argnums=0)
def _parameters(
    rig: Rig, window: Window, proposal: ProposalMap, coordinates: Float[ArrayLike, "chains draws parameters"]
) -> Array:
    return jnp.vectorize(lambda unit: proposal.at(rig, window, unit), signature="(u)->(u)")(coordinates)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _negative_log_density(
    rig: Rig, window: Window, proposal: ProposalMap, unit: Float[Array, " parameters"]
) -> Float[Array, ""]:
    """Return the negative log posterior density but for a constant, at coordinates of the proposal.

    Its gradient uses forward derivatives, vectorised over directions, as in the fit: reverse ones through four runs of
    the motion take minutes to compile.
    """
    return 0.5 * jnp.sum(residuals(rig, proposal.at(rig, window, unit), window) ** 2)


def _density_and_gradient(rig: Rig, window: Window, proposal: ProposalMap, unit: Array) -> tuple[Array, Array]:
    wide = proposal.wide.shape[1]
    mode_jacobian = jax.jacfwd(lambda unit: proposal.conditional_mode(rig, window, unit))(unit[-wide:])
    residual, jacobian = value_and_jacobian(rig, proposal.at(rig, window, unit), window)
    gradient = jacobian.T @ residual
    return 0.5 * jnp.sum(residual**2), jnp.concatenate([proposal.narrow.T @ gradient, mode_jacobian.T @ gradient])


_negative_log_density.defvjp(_density_and_gradient, lambda _, gradient, change: (None, None, change * gradient))


def effective_draws(draws: Float[np.ndarray, "chains draws p"], divergent: int) -> float:
    """Return the least effective number of draws over p numbers; 0 where chains differ, or some of them diverged."""
    convergence = statistics(draws)
    least = float(min(convergence.ess_bulk.min(), convergence.ess_tail.min()))
    converged = divergent == 0 and convergence.r_hat.max() <= R_HAT_MOST and least >= ESS_LEAST_PER_CHAIN * len(draws)
    return least if converged else 0.0
