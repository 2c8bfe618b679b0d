"""What a fitted motion says of its record: k, x, beta, m and c with their covariance, and whether to trust it."""

import functools
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from arviz_stats.base import array_stats  # pyright: ignore[reportPrivateImportUsage]
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion_fit import Found, find, starts_of
from bayes_tyre.inference.motion_model import residuals
from bayes_tyre.inference.motion_unknowns import in_units
from bayes_tyre.inference.motion_window import Recorded, Window, window_of
from bayes_tyre.rig.axle import Rig

#: The order of what is estimated; units kN/mm, kN, mm, kg, kN s/mm.
MOTION_PARAMETERS = ("k", "x", "beta", "m", "c")
#: Above this, importance weights have no reliable mean, and Laplace's covariance is not to be trusted (Vehtari 2024).
PARETO_K_MOST = 0.7
DRAWS = 400
#: Residuals' mean square beyond 1 by more, or a lag-1 autocorrelation above, says that the model misses something. Of
#: 1100 white residuals a channel the standard deviations are 0.04 and 0.03.
MISFIT_MOST, CORRELATION_MOST = 0.3, 0.2


@dataclass(frozen=True)
class MotionEstimate:
    """The estimate of a record.

    Attributes
    ----------
    log_mean, log_covariance:
        Of the natural logarithms of `MOTION_PARAMETERS`, shape (5,) and (5, 5): Laplace's, priors included.
    found:
        All unknowns, misfit of each channel, steps taken.
    window:
        What was fitted.
    pareto_k:
        Of the importance weights of draws from Laplace's normal.
    status:
        Empty, or why the estimate is not to be trusted as it stands.
    """

    log_mean: Float[np.ndarray, "5"]
    log_covariance: Float[np.ndarray, "5 5"]
    found: Found
    window: Window
    pareto_k: float
    status: str

    @property
    def value(self) -> Float[np.ndarray, "5"]:
        """Return the estimates in units."""
        return np.exp(self.log_mean)


def estimate_motion(rig: Rig, recorded: Recorded) -> MotionEstimate:
    """Return the estimate of one stationary record.

    Parameters
    ----------
    rig:
        Geometry, effective mass and how well it is known.
    recorded:
        Its three channels, rest and ramp.
    """
    window = window_of(rig, recorded)
    found = jax.tree.map(np.asarray, find(rig, window, starts_of(rig, window)))
    mean, covariance = log_parameters(rig, found, window)
    pareto_k = laplace_check(rig, found.standard, found.covariance, window)
    return MotionEstimate(mean, covariance, found, window, pareto_k, _status(found, pareto_k))


def log_parameters(rig: Rig, found: Found, window: Window) -> tuple[Float[np.ndarray, "5"], Float[np.ndarray, "5 5"]]:
    """Return mean and covariance of the logarithms of `MOTION_PARAMETERS`, to first order in the unknowns."""
    prior = jnp.asarray(window.prior)
    mean, jacobian = _logs(rig, jnp.asarray(found.standard), prior)
    return np.asarray(mean), np.asarray(jacobian @ found.covariance @ jacobian.T)


@functools.partial(jax.jit, static_argnums=0)
def _logs(rig: Rig, standard: Array, prior: Array) -> tuple[Array, Array]:
    def logs(standard: Array) -> Array:
        unknowns = in_units(rig, standard, prior)
        law = unknowns.law
        values = (law.k, law.x, law.beta, unknowns.m_kg, unknowns.c_kN_s_per_mm)
        return jnp.log(jnp.stack([jnp.asarray(value) for value in values]))

    return logs(standard), jax.jacfwd(logs)(standard)


def laplace_check(
    rig: Rig,
    standard: Float[ArrayLike, " unknowns"],
    covariance: Float[ArrayLike, "unknowns unknowns"],
    window: Window,
    seed: int = 0,
) -> float:
    """Return Pareto's k of the weights that take draws of Laplace's normal to the posterior; NaN where it has none.

    Source: Vehtari et al. 2024, "Pareto smoothed importance sampling".
    """
    if not (np.isfinite(covariance).all() and np.linalg.eigvalsh(np.asarray(covariance)).min() > 0):
        return float("nan")
    root = np.linalg.cholesky(np.asarray(covariance))
    normal = np.random.default_rng(seed).standard_normal((DRAWS, len(root)))
    height = _heights(rig, jnp.asarray(standard + normal @ root.T), jax.tree.map(jnp.asarray, window))
    weights = np.nan_to_num(0.5 * np.sum(normal**2, axis=1) - np.asarray(height), nan=-np.inf)
    # ArviZ takes the logarithm of what the weights are one over, as in leave-one-out.
    return float(array_stats.psislw(weights.max() - weights)[1])


@functools.partial(jax.jit, static_argnums=0)
def _heights(rig: Rig, draws: Float[Array, "draws unknowns"], window: Window) -> Float[Array, " draws"]:
    return jax.vmap(lambda draw: 0.5 * jnp.sum(residuals(rig, draw, window) ** 2))(draws)


def _status(found: Found, pareto_k: float) -> str:
    reasons = []
    if not found.converged:
        reasons.append("the fit did not converge")
    if not pareto_k <= PARETO_K_MOST:
        reasons.append(f"the posterior is not normal about its peak (Pareto k {pareto_k:.2g} > {PARETO_K_MOST:g})")
    for name, square, alike in zip(
        ("acceleration", "laser", "load"), found.chi_squared, found.correlation, strict=True
    ):
        if square > 1 + MISFIT_MOST or alike > CORRELATION_MOST:
            reasons.append(f"{name} is off by {np.sqrt(square):.2g} times its noise, lag-1 autocorrelation {alike:.2g}")
    return "; ".join(reasons)
