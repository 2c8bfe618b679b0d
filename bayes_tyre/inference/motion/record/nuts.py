"""NUTS on one record's motion, for a posterior that draws about its peak do not cover."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
import xarray as xr
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.diagnostics.convergence import monitor
from bayes_tyre.inference.diagnostics.verdict import ESS_LEAST_PER_CHAIN, R_HAT_MOST
from bayes_tyre.inference.model.case_effects import flat
from bayes_tyre.inference.motion.record.forward_model import residuals
from bayes_tyre.inference.motion.record.importance_sampling import Valley, valley_about
from bayes_tyre.inference.motion.record.map_fit import Found, value_and_jacobian
from bayes_tyre.inference.motion.record.window import Window
from bayes_tyre.inference.sampling.nuts import CAREFUL_ACCEPTANCE
from bayes_tyre.inference.sampling.run import SamplerSettings, sample
from bayes_tyre.rig.axle import Rig

#: Coordinates are near to a standard normal's even where weights fail: a short warmup does.
SETTINGS = SamplerSettings(chains=4, warmup=150, draws=200)


class Sampled(NamedTuple):
    """Draws of a record's unknowns.

    Attributes
    ----------
    standard:
        In standard deviations of their prior, shape (chains, draws, unknowns).
    divergent:
        Number of transitions that ended far off: above 0 parts of the posterior were not reached.
    """

    standard: Float[np.ndarray, "chains draws unknowns"]
    divergent: int


def sampled(rig: Rig, window: Window, found: Found, settings: SamplerSettings = SETTINGS) -> Sampled:
    """Return NUTS draws of a record's unknowns, in coordinates along the valley of their density.

    Parameters
    ----------
    rig:
        Geometry; static.
    window, found:
        Of the record: readings and noise; peak and Laplace's covariance, positive definite.
    settings:
        How much to sample.
    """
    # JAX arrays are arguments of what is compiled: another record of the same length needs no compilation.
    window = jax.tree.map(jnp.asarray, window)
    valley = _about(rig, window, jnp.asarray(found.standard), jnp.asarray(found.covariance))

    def posterior(window: Window, valley: Valley) -> None:
        numpyro.factor("height", -_height(rig, window, valley, flat("along", valley.peak.shape)))

    draws = sample(posterior, {"window": window, "valley": valley}, settings, acceptance=CAREFUL_ACCEPTANCE)
    return Sampled(
        np.asarray(_places(rig, window, valley, draws.sites["along"])), int(np.sum(draws.statistics["diverging"]))
    )


_about = jax.jit(valley_about, static_argnums=0)


@functools.partial(jax.jit, static_argnums=0)
def _places(rig: Rig, window: Window, valley: Valley, along: Float[ArrayLike, "chains draws unknowns"]) -> Array:
    return jnp.vectorize(lambda unit: valley.at(rig, window, unit), signature="(u)->(u)")(along)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _height(rig: Rig, window: Window, valley: Valley, unit: Float[Array, " unknowns"]) -> Float[Array, ""]:
    """Return the negative log posterior density but for a constant, at coordinates along the valley.

    Its gradient is by forward derivatives, all directions side by side, as in the fit: through four runs of the motion
    reverse ones take minutes to compile.
    """
    return 0.5 * jnp.sum(residuals(rig, valley.at(rig, window, unit), window) ** 2)


def _height_and_slope(rig: Rig, window: Window, valley: Valley, unit: Array) -> tuple[Array, Array]:
    flat = valley.flat.shape[1]
    floor_moves = jax.jacfwd(lambda flat: valley.floor(rig, window, flat))(unit[-flat:])
    off, jacobian = value_and_jacobian(rig, valley.at(rig, window, unit), window)
    slope = jacobian.T @ off
    return 0.5 * jnp.sum(off**2), jnp.concatenate([valley.steep.T @ slope, floor_moves.T @ slope])


_height.defvjp(_height_and_slope, lambda _, slope, change: (None, None, change * slope))


def effective_draws(draws: Float[np.ndarray, "chains draws p"], divergent: int) -> float:
    """Return the least effective number of draws over p numbers; 0 where chains differ, or some of them diverged."""
    figures = monitor(xr.Dataset({"number": (("chain", "draw", "which"), draws)}))
    r_hat, *effective = (np.asarray(figure["number"]) for figure in figures if figure is not None)
    least = float(np.min(effective))
    told = divergent == 0 and r_hat.max() <= R_HAT_MOST and least >= ESS_LEAST_PER_CHAIN * len(draws)
    return least if told else 0.0
