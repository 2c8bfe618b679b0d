"""The covariance that a random disturbance of the axle adds to the readings, and its size by their likelihood.

A disturbance is a sum of columns (waves of a road, a force between its knots) with normal weights b of covariance
size^2 L L'. To first order the readings' errors are G b, G their response to the columns. So b is integrated out: the
covariance of the readings grows by G L L' G' size^2 (`forward_model.residuals`), with no further parameters. Friction
answers slightly nonlinearly: the response is taken about the disturbance's estimate where a window has one.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion.record.forward_model import misfit
from bayes_tyre.inference.motion.record.map_fit import value_and_jacobian
from bayes_tyre.inference.motion.record.window import UNDISTURBED, Disturbance, DisturbanceResponse, Window
from bayes_tyre.rig.axle import Rig


class Columns(NamedTuple):
    """The columns of a disturbance, and what their weights may be.

    Attributes
    ----------
    columns:
        Of road, shape (columns, nodes), or force, or both.
    factors:
        Lower triangles L of the weights' possible covariances L L', shape (choices, columns, columns).
    sizes:
        Their possible standard deviations, shape (sizes,); from 0.
    penalties:
        What each size adds to -2 log likelihood, shape (sizes,).
    """

    columns: Disturbance
    factors: Float[Array, "choices columns columns"]
    sizes: Float[Array, " sizes"]
    penalties: Float[ArrayLike, "*sizes"] = 0.0


@functools.partial(jax.jit, static_argnums=0)
def disturbance_response(
    rig: Rig, window: Window, standard: Float[Array, " parameters"], among: Columns
) -> DisturbanceResponse:
    """Return the readings' response to a disturbance of the most probable size; that to size 0 is not a number.

    Size and factor are estimated by restricted maximum likelihood (Patterson and Thompson 1971) from the residuals of
    a fit, on a grid.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record; its `disturbance`, if any, is of the same columns.
    standard:
        Standardised parameters near the MAP estimate.
    among:
        Columns, with the factors and sizes to choose from.
    """
    given = window.disturbance
    mean = UNDISTURBED if given is None else given.mean
    responses = _responses(rig, window, standard, mean, among.columns)
    residual, jacobian = value_and_jacobian(rig, standard, window._replace(disturbance=_fixed(window, mean)))
    if given is not None:
        residual = residual.at[: len(responses)].add(-responses @ given.weights)
    padded = jnp.concatenate([responses, jnp.zeros((residual.size - len(responses), responses.shape[1]))])
    padded, rest = (
        padded - jacobian @ _least_squares(jacobian, padded),
        residual - jacobian @ _least_squares(jacobian, residual),
    )

    def objective(factor: Array) -> Array:
        left, singular_values, _ = _singular(padded @ factor)
        variance = 1 + (among.sizes[:, None] * singular_values) ** 2
        return jnp.sum(jnp.log(variance) + (left.T @ rest) ** 2 / variance, axis=1) + among.penalties

    objectives = jax.vmap(objective)(among.factors)
    choice, at = jnp.unravel_index(jnp.argmin(objectives), objectives.shape)
    factor, size = among.factors[choice], among.sizes[at]
    directions, singular_values, loadings = _singular(size * (responses @ factor))
    # The parameters are estimated jointly with the disturbance.
    shrink = 1 - 1 / jnp.sqrt(1 + singular_values**2)
    rows = jnp.concatenate([_whiten(jacobian[: len(responses)], directions, shrink), jacobian[len(responses) :]])
    rest = jnp.concatenate([_whiten(residual[: len(responses)], directions, shrink), residual[len(responses) :]])
    moved = (residual - jacobian @ _least_squares(rows, rest))[: len(responses)]
    unit = loadings.T @ (singular_values / (1 + singular_values**2) * (directions.T @ moved))
    weights = -size * (factor @ unit)
    response = (responses @ weights).reshape(window.readings.shape)
    estimate = jax.tree.map(lambda columns: weights @ columns, among.columns)
    whitening = None if given is None else given.whitening
    return DisturbanceResponse(estimate, size, weights, response, directions, shrink, whitening)


def _least_squares(rows: Array, residual: Array) -> Array:
    """Return the least-squares weights of a Jacobian's columns; its last rows are the prior's, and it has full rank."""
    return jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(rows.T @ rows), rows.T @ residual)


def _singular(columns: Float[Array, "rows columns"]) -> tuple[Array, Array, Array]:
    """Return the singular value decomposition of a tall matrix, by its Gram matrix: a tenth of the time.

    Values below a millionth of the largest are inaccurate and their directions not orthonormal; such directions are
    hardly scaled at all.
    """
    squares, vectors = jnp.linalg.eigh(columns.T @ columns)
    singular_values = jnp.sqrt(jnp.maximum(squares, 1e-12 * squares[-1]))
    return columns @ vectors / singular_values, singular_values, vectors.T


def _whiten(residual: Array, directions: Array, shrink: Array) -> Array:
    return residual - directions @ ((shrink * (directions.T @ residual).T).T)


def _fixed(window: Window, mean: Disturbance) -> DisturbanceResponse:
    """Return the response to a disturbance that is known: residuals are the noise alone."""
    whitening = None if window.disturbance is None else window.disturbance.whitening
    nothing, none = jnp.zeros_like(window.readings), jnp.zeros(1)
    return DisturbanceResponse(mean, none[0], none, nothing, jnp.zeros((window.readings.size, 1)), none, whitening)


def _responses(
    rig: Rig, window: Window, standard: Float[Array, " parameters"], mean: Disturbance, columns: Disturbance
) -> Float[Array, "readings columns"]:
    """Return the derivative of the standardised readings by the columns about a disturbance."""

    def response(column: Disturbance) -> Array:
        def along(b: Array) -> Array:
            moved = jax.tree.map(lambda mean, column: mean + b * column, mean, column)
            return misfit(rig, standard, window, moved).ravel()

        return jax.jvp(along, (0.0,), (1.0,))[1]

    return jax.vmap(response, out_axes=1)(columns)
