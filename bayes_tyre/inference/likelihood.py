"""The likelihood of records under Equation 2 and independent normal noise: directly, and compressed without loss.

Given beta the force is linear in (F_i, J, k). A record's log-likelihood therefore needs its points only through
inner products of `1`, `g` and `u g` (g = 1 - exp(-|u| / beta)) with each other and with the force: seven smooth
functions of log beta. Tabulated once as piecewise Chebyshev polynomials, they make one evaluation independent of
the number of points.
"""

from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.picture import RecordData, force_curve

#: Cells in log beta, and the degree in each: the table is then off by 1e-7 in the log density (see the tests).
CELLS, DEGREE = 48, 12
#: The table reaches from where even the first point has left (|u| = 40 beta) to a nearly straight line.
_FIRST_POINT_OVER_BETA, _BETA_OVER_TRAVEL = 40.0, 100.0
_SMALLEST_STEP_OVER_TRAVEL = 1e-9


class Likelihood(eqx.Module):
    """The contract: the log density of each record's forces."""

    @abstractmethod
    def __call__(self, theta: Float[Array, "records 4"], sigma: Float[Array, " records"]) -> Float[Array, " records"]:
        """Return the log density at theta = (F_i, J, log k, log beta) and noise sigma (kN), shape (records,)."""


class DirectLikelihood(Likelihood):
    """The likelihood as it is written down, point by point: the reference."""

    data: RecordData

    def __call__(self, theta: Float[Array, "records 4"], sigma: Float[Array, " records"]) -> Float[Array, " records"]:
        """Return the log density at theta = (F_i, J, log k, log beta) and noise sigma (kN), shape (records,)."""
        force = jax.vmap(force_curve)(self.data.u, theta)
        residual = jnp.where(self.data.present, self.data.F - force, 0.0)
        return _log_normal(jnp.sum(residual**2, axis=1), jnp.sum(self.data.present, axis=1), sigma)


class CompressedLikelihood(Likelihood):
    """The same likelihood from a table of inner products; build it with `compress`.

    Attributes
    ----------
    table:
        Shape (records, cells, degree + 1, 7): Chebyshev coefficients of the products in each cell of log beta.
    low, width:
        Shape (records,): log beta (mm) at which the table starts, and the width of a cell.
    points, F_0, sum_y, sum_yy:
        Shape (records,): number of points, first force (kN), and sums of y = F - F_0 (kN) and of its square.
    """

    table: Float[Array, "records cells coefficients 7"]
    low: Float[Array, " records"]
    width: Float[Array, " records"]
    points: Float[Array, " records"]
    F_0: Float[Array, " records"]
    sum_y: Float[Array, " records"]
    sum_yy: Float[Array, " records"]

    def __call__(self, theta: Float[Array, "records 4"], sigma: Float[Array, " records"]) -> Float[Array, " records"]:
        """Return the log density at theta = (F_i, J, log k, log beta) and noise sigma (kN), shape (records,).

        Beyond the table's ends in log beta the density stays as it is there.
        """
        level, J, k = theta[:, 0] - self.F_0, theta[:, 1], jnp.exp(theta[:, 2])
        g, ug, gg, ugg, uugg, yg, yug = self._products(theta[:, 3]).T
        squares = self.points * level**2 + J**2 * gg + 2.0 * J * k * ugg + k**2 * uugg + 2.0 * level * (J * g + k * ug)
        rss = self.sum_yy - 2.0 * (level * self.sum_y + J * yg + k * yug) + squares
        return _log_normal(rss, self.points, sigma)

    def _products(self, log_beta: Float[Array, " records"]) -> Float[Array, "records 7"]:
        cells = self.table.shape[1]
        place = jnp.clip((log_beta - self.low) / self.width, 0.0, cells)
        cell = jnp.clip(jnp.floor(place), 0, cells - 1).astype(int)
        coefficients = jax.vmap(lambda rows, i: rows[i])(self.table, cell)
        return jnp.einsum("rmq,rm->rq", coefficients, _chebyshev(2.0 * (place - cell) - 1.0, self.table.shape[2]))


def _log_normal(
    rss: Float[Array, " records"], points: Float[Array, " records"] | Array, sigma: Float[Array, " records"]
) -> Float[Array, " records"]:
    return -0.5 * rss / sigma**2 - points * (jnp.log(sigma) + 0.5 * jnp.log(2.0 * jnp.pi))


def _chebyshev(t: Float[Array, " records"], count: int) -> Float[Array, "records count"]:
    """Return the Chebyshev polynomials T_0 to T_(count - 1) at t in [-1, 1]."""
    values = [jnp.ones_like(t), t]
    while len(values) < count:
        values.append(2.0 * t * values[-1] - values[-2])
    return jnp.stack(values[:count], axis=1)


def _inner_products(log_beta: Float[Array, ""], data: RecordData) -> Float[Array, "7"]:
    """Return the seven inner products of one record at log beta (mm); sums over its points."""
    u, y = data.u, jnp.where(data.present, data.F - data.F_0, 0.0)
    g = jnp.where(data.present, -jnp.expm1(-jnp.abs(u) / jnp.exp(log_beta)), 0.0)
    ug = u * g
    return jnp.stack([jnp.sum(term) for term in (g, ug, g * g, ug * g, ug * ug, y * g, y * ug)])


@eqx.filter_jit
def compress(data: RecordData) -> CompressedLikelihood:
    """Return the compressed likelihood of the records, off by 1e-7 at most inside its range of beta.

    The range of each record is from a fortieth of its smallest displacement to a hundred times its travel.
    """
    distance = jnp.where(data.present, jnp.abs(data.u), 0.0)
    travel = jnp.max(distance, axis=1)
    least = jnp.min(jnp.where(distance > 0, distance, jnp.inf), axis=1)
    low = jnp.log(jnp.maximum(least / _FIRST_POINT_OVER_BETA, _SMALLEST_STEP_OVER_TRAVEL * travel))
    width = (jnp.log(_BETA_OVER_TRAVEL * travel) - low) / CELLS
    count = DEGREE + 1
    angle = np.pi * (np.arange(count) + 0.5) / count
    nodes = jnp.asarray(np.cos(angle))
    places = (jnp.arange(CELLS)[:, None] + 0.5 * (nodes + 1.0)).ravel()
    # lax.map keeps memory at one value of beta for all records, however many nodes there are.
    values = jax.lax.map(lambda place: jax.vmap(_inner_products)(low + width * place, data), places)
    to_coefficients = np.cos(np.outer(np.arange(count), angle)) * 2.0 / count
    to_coefficients[0] /= 2.0
    by_cell = values.reshape(CELLS, count, *values.shape[1:])
    y = jnp.where(data.present, data.F - data.F_0[:, None], 0.0)
    return CompressedLikelihood(
        table=jnp.einsum("mj,cjrq->rcmq", jnp.asarray(to_coefficients), by_cell),
        low=low,
        width=width,
        points=jnp.sum(data.present, axis=1).astype(low.dtype),
        F_0=data.F_0,
        sum_y=jnp.sum(y, axis=1),
        sum_yy=jnp.sum(y**2, axis=1),
    )
