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

from bayes_tyre.inference.motion.record.map_fit import value_and_jacobian
from bayes_tyre.inference.motion.record.model.forward_model import misfit
from bayes_tyre.inference.motion.record.model.window import Disturbance, DisturbanceResponse, Window
from bayes_tyre.laws.base import ScalarLike
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
    rig: Rig, window: Window, standard: Float[Array, " parameters"], among: Columns, further: Disturbance | None = None
) -> DisturbanceResponse:
    """Return the readings' response to a disturbance of the most probable size; that to size 0 is not a number.

    Size and factor are estimated by restricted maximum likelihood (Patterson and Thompson 1971) from the residuals of
    a fit, on a grid.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record; its `disturbance`, if any, is of the same columns, or of the last of them.
    standard:
        Standardised parameters near the MAP estimate.
    among:
        Columns, with the factors and sizes to choose from.
    further:
        Columns of a disturbance of known size, with weights of standard deviation 1; its weights follow the others'.
    """
    given = window.disturbance
    mean = window.mean_disturbance
    responses = _responses(rig, window, standard, mean, among.columns)
    known = jnp.zeros((len(responses), 0)) if further is None else _responses(rig, window, standard, mean, further)
    all_responses = jnp.concatenate([responses, known], axis=1)
    residual, jacobian = value_and_jacobian(rig, standard, window._replace(disturbance=fixed(window, mean)))
    if given is not None:
        given_responses = all_responses[:, all_responses.shape[1] - len(given.weights) :]
        residual = residual.at[: len(responses)].add(-given_responses @ given.weights)
    if further is None:
        factor, size = most_probable(among, responses, residual, jacobian)
    else:
        directions, shrink, _ = _whitening(known)
        whitened = (_readings_whitened(each, directions, shrink) for each in (residual, jacobian))
        factor, size = most_probable(among, _whiten(responses, directions, shrink), *whitened)
    unit = conditional(jnp.concatenate([responses @ (size * factor), known], axis=1), residual, jacobian)
    weights = jnp.concatenate([size * (factor @ unit.weights[: len(factor)]), unit.weights[len(factor) :]])
    response = (all_responses @ weights).reshape(window.readings.shape)
    columns = (among.columns,) if further is None else (among.columns, further)
    estimate = jax.tree.map(lambda *each: weights @ jnp.concatenate(each), *columns)
    of_unit_weights = (jax.tree.map(lambda column: size * factor.T @ column, among.columns), *columns[1:])
    along = jax.tree.map(lambda *each: unit.loadings @ jnp.concatenate(each), *of_unit_weights)
    kept = {} if given is None else {name: getattr(given, name) for name in ("whitening", "load_size", "force_size")}
    return DisturbanceResponse(
        *(estimate, size, weights, response, unit.directions, unit.shrink, along, unit.loadings @ unit.weights), **kept
    )


def most_probable(
    among: Columns, responses: Float[Array, "readings columns"], residual: Array, jacobian: Array
) -> tuple[Float[Array, "columns columns"], Float[Array, ""]]:
    """Return the factor and the size of the greatest restricted likelihood, penalties included.

    Parameters
    ----------
    among:
        Factors and sizes to choose from.
    responses:
        Of the standardised readings to the columns.
    residual, jacobian:
        Of the fit: the readings' rows, then those of the prior.
    """
    padded = jnp.concatenate([responses, jnp.zeros((residual.size - len(responses), responses.shape[1]))])
    padded, rest = (each - jacobian @ _least_squares(jacobian, each) for each in (padded, residual))

    def objective(factor: Array) -> Array:
        left, singular_values, _ = _singular(padded @ factor)
        variance = 1 + (among.sizes[:, None] * singular_values) ** 2
        # Over that of size 0: factors need not span the same columns.
        return jnp.sum(jnp.log(variance) + (left.T @ rest) ** 2 * (1 / variance - 1), axis=1) + among.penalties

    objectives = jax.vmap(objective)(among.factors)
    choice, at = jnp.unravel_index(jnp.argmin(objectives), objectives.shape)
    return among.factors[choice], among.sizes[at]


class Conditional(NamedTuple):
    """A disturbance given the readings: its weights' estimate, and how the readings' covariance has grown.

    `directions` and `shrink` as in `DisturbanceResponse`; `loadings` are the directions of the weights that move the
    readings along these; `step` is how far the parameters move that are estimated with it.
    """

    step: Float[Array, " parameters"]
    weights: Float[Array, " columns"]
    directions: Float[Array, "readings columns"]
    shrink: Float[Array, " columns"]
    loadings: Float[Array, "columns columns"]


def conditional(responses: Float[Array, "readings columns"], residual: Array, jacobian: Array) -> Conditional:
    """Return a disturbance given the readings; its weights have standard deviation 1, the rest as `most_probable`."""
    directions, shrink, (singular_values, loadings) = _whitening(responses)
    # The parameters are estimated jointly with the disturbance.
    rows, rest = (_readings_whitened(each, directions, shrink) for each in (jacobian, residual))
    step = -_least_squares(rows, rest)
    moved = (residual + jacobian @ step)[: len(responses)]
    weights = -loadings.T @ (singular_values / (1 + singular_values**2) * (directions.T @ moved))
    return Conditional(step, weights, directions, shrink, loadings)


def log_evidence(responses: Float[Array, "readings columns"], residual: Array, jacobian: Array) -> Float[Array, ""]:
    """Return the log density of the readings, parameters and disturbance integrated out, but for their noise's own.

    By Laplace's approximation in the parameters; arguments as in `conditional`.
    """
    directions, shrink, (singular_values, _) = _whitening(responses)
    rows, rest = (_readings_whitened(each, directions, shrink) for each in (jacobian, residual))
    left = rest - rows @ _least_squares(rows, rest)
    volumes = jnp.sum(jnp.log1p(singular_values**2)) + jnp.linalg.slogdet(rows.T @ rows)[1]
    return -0.5 * (left @ left + volumes)


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


def _whitening(responses: Float[Array, "readings columns"]) -> tuple[Array, Array, tuple[Array, Array]]:
    """Return what whitens readings with a response to weights of standard deviation 1; singular values, loadings."""
    directions, singular_values, loadings = _singular(responses)
    return directions, 1 - 1 / jnp.sqrt(1 + singular_values**2), (singular_values, loadings)


def _whiten(residual: Array, directions: Array, shrink: Array) -> Array:
    return residual - directions @ ((shrink * (directions.T @ residual).T).T)


def _readings_whitened(rows: Array, directions: Array, shrink: Array) -> Array:
    """Return rows with those of the readings whitened; those of the prior follow them."""
    readings = len(directions)
    return jnp.concatenate([_whiten(rows[:readings], directions, shrink), rows[readings:]])


def fixed(
    window: Window, mean: Disturbance, weights: Float[ArrayLike, "*columns"] = 0.0, load_size: ScalarLike = 0.0
) -> DisturbanceResponse:
    """Return the response to a disturbance that is known: residuals are the noise alone."""
    whitening = None if window.disturbance is None else window.disturbance.whitening
    nothing, none = jnp.zeros_like(window.readings), jnp.zeros(1)
    directions = jnp.zeros((window.readings.size, 1))
    return DisturbanceResponse(
        *(mean, none[0], jnp.asarray(weights), nothing, directions, none),
        whitening=whitening,
        load_size=jnp.asarray(load_size),
    )


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
