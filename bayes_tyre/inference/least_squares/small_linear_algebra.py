"""Linear algebra for two to five unknowns, unrolled for `jax.vmap`: Cholesky-like solves, QR, a bounded quadratic.

Ours because LAPACK is called once a matrix, and those calls take most of the time of a batch of matrices this small.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

#: Pivots below this, in a matrix scaled to a unit diagonal, are rounding: the column depends on those before it.
SMALLEST_PIVOT = 1e-15
#: An orthogonalised column whose norm is below this part of the column's is rounding.
LEAST_REST = 1e-13
#: Most iterations of the active-set method. Three an unknown are many; rounding may make it cycle at the optimum.
MAX_ROUNDS = 30


def solve_positive(matrix: Float[Array, "n n"], right: Float[Array, " n"]) -> Float[Array, " n"]:
    """Return x of `matrix` x = `right`, for a symmetric positive (semi-)definite matrix, by elimination.

    An unknown whose column depends on those before it (its pivot is rounding) is 0.
    """
    n = len(right)
    size = jnp.sqrt(jnp.diagonal(matrix))
    scale = jnp.where(size > 0, 1.0 / jnp.where(size > 0, size, 1.0), 0.0)
    scaled, rest = matrix * scale[:, None] * scale, right * scale
    a = [[scaled[i, j] for j in range(n)] for i in range(n)]
    b = [rest[i] for i in range(n)]
    inverse = []
    for i in range(n):
        sound = a[i][i] > SMALLEST_PIVOT
        inverse.append(jnp.where(sound, 1.0 / jnp.where(sound, a[i][i], 1.0), 0.0))
        for j in range(i + 1, n):
            factor = a[j][i] * inverse[i]
            for m in range(i + 1, n):
                a[j][m] = a[j][m] - factor * a[i][m]
            b[j] = b[j] - factor * b[i]
    x = list(b)
    for i in reversed(range(n)):
        for j in range(i + 1, n):
            x[i] = x[i] - a[i][j] * x[j]
        x[i] = x[i] * inverse[i]
    return jnp.stack(x) * scale


class QR(NamedTuple):
    """The QR decomposition of a matrix given by its columns.

    Attributes
    ----------
    rows:
        R, row by row.
    rest:
        Columns of Q, not normalised.
    scales:
        Reciprocals of their norms; 0 for a column that depends on those before it. To normalise Q would take one more
        pass over the points.
    """

    rows: list[list[Float[Array, ""]]]
    rest: list[Float[Array, " points"]]
    scales: list[Float[Array, ""]]

    def split(self, i: int, column: Float[Array, " points"]) -> tuple[Float[Array, ""], Float[Array, " points"]]:
        """Return the component of a column along column i of Q, and the column without it."""
        along = self.scales[i] * jnp.sum(self.rest[i] * column)
        return along, column - (along * self.scales[i]) * self.rest[i]


def orthogonalised(columns: list[Float[Array, " points"]]) -> QR:
    """Return the QR decomposition of a matrix given by its columns.

    Modified Gram-Schmidt: as accurate as Householder reflections for R and, where the last column is a
    right-hand side, for least squares (Bjorck 1967, Solving linear least squares problems by Gram-Schmidt
    orthogonalization, BIT 7). A column that depends on those before it, to rounding, has a zero diagonal element.
    """
    squares = [jnp.sum(column**2) for column in columns]
    qr = QR([], list(columns), [])
    for i in range(len(columns)):
        square = squares[i] if i == 0 else jnp.sum(qr.rest[i] ** 2)
        sound = square > LEAST_REST**2 * squares[i]
        size = jnp.where(sound, jnp.sqrt(jnp.where(sound, square, 1.0)), 0.0)
        qr.scales.append(jnp.where(sound, 1.0 / jnp.where(sound, size, 1.0), 0.0))
        row = [jnp.zeros(()) for _ in range(i)] + [size]
        for j in range(i + 1, len(columns)):
            along, qr.rest[j] = qr.split(i, qr.rest[j])
            row.append(along)
        qr.rows.append(row)
    return qr


def r_factor(columns: list[Float[Array, " points"]]) -> Float[Array, "n n"]:
    """Return R of the QR decomposition of a matrix given by its columns."""
    return jnp.stack([jnp.stack(row) for row in orthogonalised(columns).rows])


def solve_upper(rows: list[list[Float[Array, ""]]], right: list[Float[Array, ""]]) -> Float[Array, " n"]:
    """Return x of R x = `right`, R upper triangular; an unknown whose pivot is 0 is 0."""
    x = list(right)
    for i in reversed(range(len(x))):
        for j in range(i + 1, len(x)):
            x[i] = x[i] - rows[i][j] * x[j]
        x[i] = _over(x[i], rows[i][i])
    return jnp.stack(x)


def solve_transposed(rows: list[list[Float[Array, ""]]], right: list[Float[Array, ""]]) -> list[Float[Array, ""]]:
    """Return x of R^T x = `right`, R upper triangular; an unknown whose pivot is 0 is 0."""
    x = list(right)
    for i in range(len(x)):
        for j in range(i):
            x[i] = x[i] - rows[j][i] * x[j]
        x[i] = _over(x[i], rows[i][i])
    return x


def _over(number: Float[Array, ""], pivot: Float[Array, ""]) -> Float[Array, ""]:
    return jnp.where(pivot != 0, number / jnp.where(pivot != 0, pivot, 1.0), 0.0)


def residual_of_last(products: list[list[Float[Array, "*batch"]]]) -> Float[Array, "*batch"]:
    """Return the residual sum of squares of the last of some columns regressed on the others.

    `products`: the inner products of each column with those up to itself. A column that depends on those before it, to
    rounding, is ignored.
    """
    rest = [list(row) for row in products]
    for i in range(len(rest) - 1):
        sound = rest[i][i] > SMALLEST_PIVOT * products[i][i]
        inverse = jnp.where(sound, 1.0 / jnp.where(sound, rest[i][i], 1.0), 0.0)
        for j in range(i + 1, len(rest)):
            for m in range(i + 1, j + 1):
                rest[j][m] = rest[j][m] - rest[j][i] * inverse * rest[m][i]
    return jnp.maximum(rest[-1][-1], 0.0)


def times(matrix: Float[Array, "n n"], x: Float[Array, " n"]) -> Float[Array, " n"]:
    """Return `matrix` x, as a sum that XLA fuses with its neighbours."""
    return jnp.sum(matrix * x, axis=1)


class _Search(NamedTuple):
    """State of the active-set method: `x` within bounds, each unknown free or held at a bound."""

    x: Float[Array, " n"]
    free: Bool[Array, " n"]
    done: Bool[Array, ""]
    rounds: Int[Array, ""]


def minimise_bounded_quadratic(
    matrix: Float[Array, "n n"], gradient: Float[Array, " n"], low: Float[Array, " n"], high: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Return the x in [`low`, `high`] at which x . matrix x / 2 + gradient . x is lowest.

    Parameters
    ----------
    matrix, gradient:
        Of a convex quadratic.
    low, high:
        Bounds, low <= high; infinite where there is none.

    Source: the active set method of Stark and Parker (1995), Bounded-variable least squares, Computational
    Statistics 10. Every iteration lowers the value or holds one more unknown, so that no active set recurs.
    """
    size = jnp.sqrt(jnp.diagonal(matrix))
    size = jnp.where(size > 0, size, 1.0)
    rounding = 1e-14 * jnp.max(jnp.abs(gradient) / size)

    def unconstrained(x: Float[Array, " n"], free: Bool[Array, " n"]) -> Float[Array, " n"]:
        held = jnp.where(free, 0.0, x)
        reduced = jnp.where(free[:, None] & free, matrix, jnp.eye(len(x)))
        return jnp.where(free, solve_positive(reduced, jnp.where(free, -gradient - times(matrix, held), 0.0)), x)

    def move(search: _Search) -> _Search:
        x, free = search.x, search.free
        aim = unconstrained(x, free)
        side = jnp.where(aim > high, high, low)
        outside = (aim > high) | (aim < low)
        way = jnp.where(outside, (side - x) / jnp.where(outside, aim - x, 1.0), 1.0)
        nearest = jnp.min(way)
        met = outside & (way <= nearest)
        x = jnp.where(met, side, jnp.where(nearest < 1, x + nearest * (aim - x), aim))
        push = -(times(matrix, x) + gradient) / size
        inward = ~free & jnp.where(x <= low, push > rounding, push < -rounding)
        let_go = (nearest >= 1) & inward & (jnp.abs(push) >= jnp.max(jnp.where(inward, jnp.abs(push), 0.0)))
        return _Search(x, (free & ~met) | let_go, (nearest >= 1) & ~jnp.any(let_go), search.rounds + 1)

    nothing = jnp.zeros(len(gradient))
    start = _Search(jnp.clip(nothing, low, high), nothing == 0, jnp.array(False), jnp.array(0))
    final = jax.lax.while_loop(lambda search: ~search.done & (search.rounds < MAX_ROUNDS), move, move(start))
    return jnp.clip(final.x, low, high)
