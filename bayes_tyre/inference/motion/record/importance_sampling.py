"""Importance sampling of the posterior of a motion: draws along a curved ridge of its density, with weights.

The step's shape, levels and rest are weakly identified, and the narrow parameters (stiffness, mass, timing) compensate
for what they do to the readings: along the wide directions the density's ridge bends by several of its own widths, and
Laplace's normal leaves it at once. The proposal here is normal along the wide directions alone. In the narrow ones a
draw starts from the conditional mode at its wide coordinates, found by a few chord steps. That shifts each draw by a
function of its wide coordinates alone, so volumes do not change and the density of the draws is the normal's.

Where the weights of the first draws have no reliable mean, further rounds follow. Each round's normal has mean and
covariance of all draws before it, and all are weighted together, by the mean of the rounds' densities.

Source: Vehtari et al. (2024), "Pareto smoothed importance sampling"; Cornuet et al. (2012), "Adaptive multiple
importance sampling".
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST, smooth_log_weights
from bayes_tyre.inference.motion.record.map_fit import value_and_jacobian
from bayes_tyre.inference.motion.record.model.forward_model import residuals
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.rig.axle import Rig

DRAWS = 400
#: Number of wide directions: those of the largest posterior standard deviations, and one more for each extension of the
#: law. In the others the posterior's are a hundredth of the prior's and less.
WIDE = 8
#: Steps towards the conditional mode; the third changes the log density by some 0.01.
CHORD_STEPS = 3
#: Factor of the draws' standard deviations on Laplace's, so that no tail of the posterior is missed.
PROPOSAL_WIDENING = 1.1
#: Rounds of draws at most.
ROUNDS = 8
#: With fewer effective draws the standard error of a mean exceeds a seventh of the posterior's standard deviation.
EFFECTIVE_LEAST = 50.0


class WeightedDraws(NamedTuple):
    """Draws and their importance weights.

    Attributes
    ----------
    standard:
        Parameters, in standard deviations of their prior, shape (draws, parameters).
    weights:
        Pareto-smoothed, their sum 1, shape (draws,).
    pareto_k:
        Of the weights; NaN where there is no proposal distribution.
    log_mean_weight:
        Logarithm of the weights' mean before smoothing and normalisation: prior times likelihood, without the constants
        of `evidence`, over the density of the draws in coordinates in which Laplace's covariance is 1.
    """

    standard: Float[np.ndarray, "draws parameters"]
    weights: Float[np.ndarray, " draws"]
    pareto_k: float
    log_mean_weight: float = float("nan")

    @property
    def effective(self) -> float:
        """Return the effective number of draws (Kish)."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def trusted(self) -> bool:
        """Return whether the weights have a reliable mean and enough effective draws."""
        return self.pareto_k <= PARETO_K_MOST and self.effective >= EFFECTIVE_LEAST


class _Normal(NamedTuple):
    """A round's density in the coordinates of `ProposalMap`: its mean, and the lower triangle of its covariance."""

    mean: Float[np.ndarray, " parameters"]
    triangle: Float[np.ndarray, "parameters parameters"]

    def draws(self, rng: np.random.Generator) -> Float[np.ndarray, "draws parameters"]:
        return self.mean + rng.standard_normal((DRAWS, len(self.mean))) @ self.triangle.T

    def log_density(self, unit: Float[np.ndarray, "draws parameters"]) -> Float[np.ndarray, " draws"]:
        """Return the log density but for the constant of a standard normal one."""
        normals = solve_triangular(self.triangle, (unit - self.mean).T, lower=True)
        return -0.5 * np.sum(normals**2, axis=0) - np.sum(np.log(np.diag(self.triangle)))


def weighted_draws(
    rig: Rig,
    standard: Float[ArrayLike, " parameters"],
    covariance: Float[ArrayLike, "parameters parameters"],
    window: Window,
    rounds: int = ROUNDS,
) -> WeightedDraws:
    """Return draws about a peak with the weights that make them draws from the posterior.

    Parameters
    ----------
    rig:
        Geometry; static.
    standard, covariance:
        Peak and Laplace's covariance of the parameters.
    window:
        Of the record.
    rounds:
        Of draws, at most: the first whose draws, with all before, have trusted weights is the last.
    """
    standard, covariance = np.asarray(standard), np.asarray(covariance)
    count, rng = len(standard), np.random.default_rng(0)
    if not (np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance).min() > 0):
        return WeightedDraws(np.tile(standard, (DRAWS, 1)), np.full(DRAWS, 1 / DRAWS), float("nan"))
    normals = [_Normal(np.zeros(count), PROPOSAL_WIDENING * np.eye(count))]
    unit, draws, heights = np.empty((0, count)), np.empty((0, count)), np.empty(0)
    while True:
        new_unit = normals[-1].draws(rng)
        new_draws, new_heights = jax.tree.map(np.asarray, _proposed(rig, window, standard, covariance, new_unit))
        unit, draws = np.concatenate([unit, new_unit]), np.concatenate([draws, new_draws])
        heights = np.concatenate([heights, new_heights])
        weighted = _weighted(normals, unit, draws, heights)
        if weighted.trusted or len(normals) == rounds:
            return weighted
        normals.append(_following(unit, weighted))


def _weighted(
    normals: Sequence[_Normal],
    unit: Float[np.ndarray, "draws parameters"],
    draws: Float[np.ndarray, "draws parameters"],
    heights: Float[np.ndarray, " draws"],
) -> WeightedDraws:
    """Return the draws of all rounds, of as many draws each, weighted by the mean of the rounds' densities."""
    log_density = logsumexp([normal.log_density(unit) for normal in normals], axis=0) - np.log(len(normals))
    log_weights = np.nan_to_num(-heights - log_density, nan=-np.inf)
    smooth, pareto_k = smooth_log_weights(log_weights)
    return WeightedDraws(draws, np.exp(smooth), pareto_k, float(logsumexp(log_weights) - np.log(len(unit))))


def _following(unit: Float[np.ndarray, "draws parameters"], weighted: WeightedDraws) -> _Normal:
    """Return the density of the next round: of mean and covariance of the weighted draws.

    The fewer effective draws, the more of Laplace's normal is kept: as much as if it were a draw a parameter.
    """
    share = weighted.effective / (weighted.effective + unit.shape[1])
    mean = weighted.weights @ unit
    deviations = unit - mean
    covariance = share * (weighted.weights * deviations.T) @ deviations + (1 - share) * np.eye(unit.shape[1])
    return _Normal(share * mean, PROPOSAL_WIDENING * np.linalg.cholesky(covariance))


class ProposalMap(NamedTuple):
    """The proposal: a map from independent normal(0, 1) numbers to parameters.

    Attributes
    ----------
    peak:
        The most probable parameters.
    narrow, wide:
        Directions, a column each, as long as their posterior standard deviations.
    chord:
        Matrix from residuals to a chord step towards the conditional mode.
    """

    peak: Float[Array, " parameters"]
    narrow: Float[Array, "parameters narrow"]
    wide: Float[Array, "parameters wide"]
    chord: Float[Array, "parameters residuals"]

    def at(self, rig: Rig, window: Window, unit: Float[Array, " parameters"]) -> Float[Array, " parameters"]:
        """Return the parameters at coordinates; the map preserves volumes but for a constant."""
        wide = self.wide.shape[1]
        return self.conditional_mode(rig, window, unit[-wide:]) + self.narrow @ unit[:-wide]

    def conditional_mode(self, rig: Rig, window: Window, unit: Float[Array, " wide"]) -> Float[Array, " parameters"]:
        """Return the parameters of highest density at given wide coordinates."""

        def step(_: object, at: Array) -> Array:
            return at - self.chord @ residuals(rig, at, window)

        return jax.lax.fori_loop(0, CHORD_STEPS, step, self.peak + self.wide @ unit)


def proposal_map(rig: Rig, window: Window, standard: Array, covariance: Array) -> ProposalMap:
    """Return the proposal about a peak with Laplace's covariance."""
    _, jacobian = value_and_jacobian(rig, standard, window)
    variance, directions = jnp.linalg.eigh(covariance)
    coordinates = directions * jnp.sqrt(variance)
    wide_ones = WIDE + len(window.law.extensions)
    narrow, wide = coordinates[:, :-wide_ones], coordinates[:, -wide_ones:]
    return ProposalMap(standard, narrow, wide, narrow @ (jacobian @ narrow).T)


@functools.partial(jax.jit, static_argnums=0)
def _proposed(rig: Rig, window: Window, standard: Array, covariance: Array, unit: Array) -> tuple[Array, Array]:
    """Return draws and their negative log posterior density but for a constant, from normal(0, 1) numbers."""
    proposal = proposal_map(rig, window, standard, covariance)

    def draw(unit: Array) -> tuple[Array, Array]:
        at = proposal.at(rig, window, unit)
        return at, 0.5 * jnp.sum(residuals(rig, at, window) ** 2)

    return jax.vmap(draw)(unit)
