"""The normal approximation of a posterior at its mode: where chains begin, and what their first mass matrix is.

It serves where the coordinates make the posterior nearly normal, as those of what records share are once the records
are integrated out. It is no posterior: NUTS begins there, and adapts from there.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

type Potential = Callable[
    [Float[np.ndarray, "points unknowns"]], tuple[Float[np.ndarray, " points"], Float[np.ndarray, "points unknowns"]]
]

#: Gradient at which the mode is found, where standard deviations are about 1; and iterations, at most.
_GRADIENT_MOST, _ITERATIONS = 0.1, 500
#: Step of the finite differences.
_STEP = 1e-4
#: Least curvature, that of a standard deviation of 2: coordinates have about 1, and at a flat mode a normal as wide as
#: its curvature says would begin chains anywhere.
_LEAST_CURVATURE = 0.25


class NormalApproximation(NamedTuple):
    """A normal distribution of the unknowns of a posterior, unconstrained.

    Attributes
    ----------
    mode:
        Shape (unknowns,).
    covariance:
        Shape (unknowns, unknowns).
    """

    mode: Float[np.ndarray, " unknowns"]
    covariance: Float[np.ndarray, "unknowns unknowns"]

    def draw(self, count: int, seed: int) -> Float[np.ndarray, "count unknowns"]:
        """Return so many draws."""
        z = np.random.default_rng(seed).standard_normal((count, len(self.mode)))
        return self.mode + z @ np.linalg.cholesky(self.covariance).T


def normal_approximation(
    potential: Potential,
    start: Float[np.ndarray, " unknowns"],
    points: int,
    covariance: Float[np.ndarray, "unknowns unknowns"] | None = None,
) -> NormalApproximation | None:
    """Return the normal approximation at the mode; None where its potential energy or curvature is not finite.

    Parameters
    ----------
    potential:
        Gives the potential energy and its gradient at `points` points at once.
    start:
        Where the search for the mode begins.
    points:
        How many points that takes.
    covariance:
        Of a similar posterior, such as that of the round before: it scales the search for the mode and is returned
        unchanged. None: the inverse curvature at the mode is computed, one gradient for each unknown.
    """
    root = None if covariance is None else np.linalg.cholesky(covariance)

    def at(z: Float[np.ndarray, " unknowns"]) -> tuple[float, Float[np.ndarray, " unknowns"]]:
        energies, gradients = potential(np.tile(z, (points, 1)))
        return float(energies[0]), gradients[0]

    def along_axes(w: Float[np.ndarray, " unknowns"]) -> tuple[float, Float[np.ndarray, " unknowns"]]:
        if root is None:
            return at(start + w)
        energy, gradient = at(start + root @ w)
        return energy, root.T @ gradient

    options = {"maxiter": _ITERATIONS, "gtol": _GRADIENT_MOST, "maxcor": 20}
    found = minimize(along_axes, np.zeros_like(start), jac=True, method="L-BFGS-B", options=options)
    mode = start + (found.x if root is None else root @ found.x)
    if not np.isfinite(found.fun):
        return None
    covariance = _inverse_curvature(potential, mode, points) if covariance is None else covariance
    return None if covariance is None else NormalApproximation(mode, covariance)


def _inverse_curvature(
    potential: Potential, mode: Float[np.ndarray, " unknowns"], points: int
) -> Float[np.ndarray, "unknowns unknowns"] | None:
    """Return the inverse of the curvature at the mode, by finite differences; None where it is not finite."""
    beside = np.concatenate([mode[None], mode + _STEP * np.eye(len(mode))])
    room = np.tile(mode, (-len(beside) % points, 1))
    each = np.concatenate([beside, room]).reshape(-1, points, len(mode))
    gradients = np.concatenate([potential(some)[1] for some in each])[: len(beside)]
    curvature = (gradients[1:] - gradients[0]) / _STEP
    if not np.isfinite(curvature).all():
        return None
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    return (vectors / np.maximum(values, _LEAST_CURVATURE)) @ vectors.T
