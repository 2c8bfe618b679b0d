"""One record of Equation 2 at a time, in numpy alone, and its least-squares estimate as numpy arrays."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from bayes_tyre.inference.least_squares.estimate import Estimate, estimate_batch
from bayes_tyre.inference.least_squares.parameters import BETA, PARAMETERS, C, K
from bayes_tyre.inference.least_squares.scaled_problem import Problem

NAN = np.nan
POINTS = 24
RAMP = (1 - np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))) / 2
Bounds = dict[str, tuple[float, float]]


class Fit(NamedTuple):
    """`Estimate` of one record, or of several, in numpy."""

    value: np.ndarray
    standard_error: np.ndarray
    rss: np.ndarray
    at_bound: np.ndarray
    undetermined: np.ndarray
    beta_open_below: np.ndarray
    beta_open_above: np.ndarray
    converged: np.ndarray


def rows(estimates: Estimate, names: list[str]) -> dict[str, Fit]:
    return {name: Fit(*(np.asarray(field)[i] for field in estimates)) for i, name in enumerate(names)}


def said(fit: Fit) -> list[list[bool]]:
    """Everything of an estimate that its status is made from: what is undetermined counts where beta is not open."""
    lost = fit.undetermined & ~(fit.beta_open_below | fit.beta_open_above)
    flags = (fit.at_bound, lost, fit.beta_open_below, fit.beta_open_above, fit.converged)
    return [np.atleast_1d(flag).tolist() for flag in flags]


def determined(fit: Fit) -> bool:
    return not (fit.undetermined.any() or fit.beta_open_below or fit.beta_open_above)


def equation_2(d: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Equation 2 in numpy, parameters in the order k, C, beta, d_i, F_i."""
    k, c, beta, d_i, F_i = value
    return F_i + (k * d + c - F_i) * -np.expm1(-np.abs(d - d_i) / beta)


def record(
    k: float = 1.6,
    J: float = 0.4,
    beta: float = 0.1,
    sign: int = 1,
    d_i: float = 10.0,
    noise: float = 0.0,
    seed: int = 5,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Displacement over 3 mm, force, and the truth in the order k, C, beta, d_i, F_i."""
    value = np.array([k, sign * J + 14.0 - k * d_i, beta, d_i, 14.0])
    d = d_i + sign * 3.0 * RAMP
    errors = np.random.default_rng(seed).normal(0, 1, POINTS) * noise * (RAMP > 0)
    return d, equation_2(d, value) + errors, value


def units(mm: float, kN: float) -> np.ndarray:
    """Factors on k, C, beta, d_i, F_i when displacements are multiplied by `mm` and forces by `kN`."""
    return np.array([kN / mm, kN, mm, mm, kN])


def fit_one(
    d: np.ndarray, F: np.ndarray, free: tuple[int, ...] = (K, C, BETA), bounds: Bounds | None = None, **start: float
) -> Fit:
    """Fit one record of 24 points, compiled once a set of free parameters."""
    low, high = np.array([(bounds or {}).get(name, (-np.inf, np.inf)) for name in PARAMETERS]).T
    nan = jnp.full((1, 5), NAN)
    given = jnp.array([[[start.get(name, NAN) for name in PARAMETERS]]])
    used = jnp.ones((1, len(d)), bool)
    problem = Problem(jnp.asarray(d)[None], jnp.asarray(F)[None], used, nan, given, jnp.array([low]), jnp.array([high]))
    return rows(estimate_batch(problem, free), ["one"])["one"]
