"""Draws from the posterior of a motion: a normal laid along the bent valley of its density, weighed by what it misses.

The step's shape, levels and rest are hardly determined, and what they do to the readings the steep unknowns undo
(stiffness, mass, timing): along them the density's valley bends by several of its own widths. A straight normal such
as Laplace's leaves it at once. Draws here go straight along the flat directions only; in the steep ones they start
from the valley's floor below them, found by a few chord steps. That moves each draw by what depends on its flat part
alone, so no volume changes, and the draws' density is the normal's.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.diagnostics.pareto_smoothing import smooth_log_weights
from bayes_tyre.inference.motion.record.forward_model import residuals
from bayes_tyre.inference.motion.record.map_fit import value_and_jacobian
from bayes_tyre.inference.motion.record.window import Window
from bayes_tyre.rig.axle import Rig

DRAWS = 400
#: So many directions, those of the largest posterior standard deviations, are gone along straight. In the others prior
#: standard deviations shrink to a hundredth and less.
FLAT = 8
#: Steps towards the valley's floor; the third changes the height by some 0.01.
CHORD_STEPS = 3
#: The draws' standard deviations are wider than Laplace's by this factor, so that no tail of the posterior is missed.
WIDER = 1.1


class Weighed(NamedTuple):
    """Draws and what they weigh.

    Attributes
    ----------
    standard:
        Unknowns, in standard deviations of their prior, shape (draws, unknowns).
    weights:
        Pareto-smoothed, their sum 1, shape (draws,).
    pareto_k:
        Of the weights; NaN where there was nothing to draw from.
    log_mean_weight:
        Logarithm of the weights' mean before they were smoothed and made to sum to 1: prior and likelihood, but for
        `motion_evidence`'s constants, over the density of the draws' standard normal numbers.
    """

    standard: Float[np.ndarray, "draws unknowns"]
    weights: Float[np.ndarray, " draws"]
    pareto_k: float
    log_mean_weight: float = float("nan")

    @property
    def effective(self) -> float:
        """Return how many draws of equal weight would say as much (Kish)."""
        return float(1.0 / np.sum(self.weights**2))


def weighed_draws(
    rig: Rig,
    standard: Float[ArrayLike, " unknowns"],
    covariance: Float[ArrayLike, "unknowns unknowns"],
    window: Window,
    seed: int = 0,
) -> Weighed:
    """Return draws about a peak with the weights that make them the posterior's.

    Source: Vehtari et al. 2024, "Pareto smoothed importance sampling".

    Parameters
    ----------
    rig:
        Geometry; static.
    standard, covariance:
        Peak and Laplace's covariance of the unknowns.
    window:
        Of the record.
    seed:
        Of the draws.
    """
    standard, covariance = np.asarray(standard), np.asarray(covariance)
    unit = np.random.default_rng(seed).standard_normal((DRAWS, len(standard)))
    if not (np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance).min() > 0):
        return Weighed(np.tile(standard, (DRAWS, 1)), np.full(DRAWS, 1 / DRAWS), float("nan"))
    draws, height = jax.tree.map(np.asarray, _along(rig, window, standard, covariance, WIDER * unit))
    log_weights = np.nan_to_num(0.5 * np.sum(unit**2, axis=1) - height, nan=-np.inf)
    smooth, pareto_k = smooth_log_weights(log_weights)
    mean = float(np.logaddexp.reduce(log_weights) - np.log(len(log_weights)))
    return Weighed(draws, np.exp(smooth), pareto_k, mean)


class Valley(NamedTuple):
    """Coordinates along the valley: of independent normal(0, 1) numbers, if it were as it is about the peak.

    Attributes
    ----------
    peak:
        The most probable unknowns.
    steep, flat:
        Directions, a column each, as long as their posterior standard deviations.
    to_floor:
        What residuals are multiplied with for a chord step towards the floor.
    """

    peak: Float[Array, " unknowns"]
    steep: Float[Array, "unknowns steep"]
    flat: Float[Array, "unknowns flat"]
    to_floor: Float[Array, "unknowns residuals"]

    def at(self, rig: Rig, window: Window, unit: Float[Array, " unknowns"]) -> Float[Array, " unknowns"]:
        """Return unknowns at coordinates; the map leaves volumes as they are, but for a constant."""
        flat = self.flat.shape[1]
        return self.floor(rig, window, unit[-flat:]) + self.steep @ unit[:-flat]

    def floor(self, rig: Rig, window: Window, unit: Float[Array, " flat"]) -> Float[Array, " unknowns"]:
        """Return unknowns on the valley's floor at flat coordinates."""

        def lower(_: object, at: Array) -> Array:
            return at - self.to_floor @ residuals(rig, at, window)

        return jax.lax.fori_loop(0, CHORD_STEPS, lower, self.peak + self.flat @ unit)


def valley_about(rig: Rig, window: Window, standard: Array, covariance: Array) -> Valley:
    """Return the coordinates along the valley about a peak with Laplace's covariance."""
    _, jacobian = value_and_jacobian(rig, standard, window)
    variance, directions = jnp.linalg.eigh(covariance)
    coordinates = directions * jnp.sqrt(variance)
    steep, flat = coordinates[:, :-FLAT], coordinates[:, -FLAT:]
    return Valley(standard, steep, flat, steep @ (jacobian @ steep).T)


@functools.partial(jax.jit, static_argnums=0)
def _along(rig: Rig, window: Window, standard: Array, covariance: Array, unit: Array) -> tuple[Array, Array]:
    """Return draws and their negative log posterior density but for a constant, from normal(0, 1) numbers."""
    valley = valley_about(rig, window, standard, covariance)

    def draw(unit: Array) -> tuple[Array, Array]:
        at = valley.at(rig, window, unit)
        return at, 0.5 * jnp.sum(residuals(rig, at, window) ** 2)

    return jax.vmap(draw)(unit)
