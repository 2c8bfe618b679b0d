"""A few normal unknowns and a quadratic log likelihood of them: their posterior, in closed form.

Whatever is linear and normal in the models ends here: offsets of records, records about their case, cases about their
linear predictor. Cholesky's factor and its solves are written out: LAPACK would be called once a unit.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

#: The rows of a lower triangle, written out; each entry has the batch's shape.
_Rows = list[list[Array]]


class QuadraticApproximation(NamedTuple):
    """A log density of a few unknowns that is quadratic about a centre.

    Attributes
    ----------
    centre, slope:
        Shape (..., n): where it is expanded, and its slope there.
    precision:
        Shape (..., n, n): minus its curvature.
    """

    centre: Float[Array, "*batch n"]
    slope: Float[Array, "*batch n"]
    precision: Float[Array, "*batch n n"]

    def at(self, values: Float[Array, "*draws n"]) -> Float[Array, "*draws"]:
        """Return the log density at these values, or at several draws of them, less that at the centre."""
        off = values - self.centre
        return jnp.sum((self.slope - 0.5 * _times(self.precision, off)) * off, axis=-1)

    def slope_at(self, values: Float[Array, "*draws n"]) -> Float[Array, "*draws n"]:
        """Return its slope at these values."""
        return self.slope + _times(self.precision, self.centre - values)


class NormalPosterior:
    """The posterior of unknowns that are Normal(above, scale), each by itself, given a quadratic log likelihood.

    The unknowns of a unit are counted from the level above, and every scale may go to zero. Units come last, so that
    one kernel goes over all of them.

    Parameters
    ----------
    slope, precision:
        Of the log likelihood: slope at the level above, shape (n, ...), and minus its curvature, shape (n, n, ...).
    scale:
        Standard deviations, shape (n, ...).
    """

    def __init__(
        self, slope: Float[Array, "n *units"], precision: Float[Array, "n n *units"], scale: Float[Array, "n *units"]
    ) -> None:
        self.scale = scale
        # Taken apart once: each index would leave an array of zeros around one entry in the gradient.
        self._slopes, self._scales = jnp.unstack(slope), jnp.unstack(scale)
        self._precisions = [jnp.unstack(row) for row in jnp.unstack(precision)]
        # Slope and precision in units of `scale`, and what follows from them.
        self._slope = [slope * own for slope, own in zip(self._slopes, self._scales, strict=True)]
        self._gain = [
            [of_row[j] * own * self._scales[j] + float(i == j) for j in range(i + 1)]
            for i, (of_row, own) in enumerate(zip(self._precisions, self._scales, strict=True))
        ]
        self._root, self._half = _factorise(self._slope, self._gain)

    @property
    def log_marginal(self) -> Float[Array, "*units"]:
        """The log likelihood with the unknowns integrated out, less that at the level above."""
        return _log_marginal(self._slope, self._gain)

    @property
    def log_volume(self) -> Float[Array, "*units"]:
        """Logarithm of the volume that `draw` makes of a unit of z."""
        return jnp.sum(jnp.log(self.scale), axis=0) - _log_diagonal(self._root)

    def draw(self, z: Float[Array, "n *#units"]) -> Float[Array, "n *units"]:
        """Return the unknowns, less the level above, at standard normal z: zeros give the mean."""
        root, count = self._root, len(self._half)
        own: list[Array] = []
        for i in reversed(range(count)):
            behind = _dot([root[j][i] for j in range(i + 1, count)], own[::-1])
            own.append((self._half[i] + z[i] - behind) / root[i][i])
        return self.scale * jnp.stack(own[::-1])

    def root(self) -> Float[Array, "n n *units"]:
        """Return a square root of the covariance: times its transpose it is that."""
        mean = self.draw(jnp.zeros_like(self.scale))
        units = jnp.moveaxis(jnp.eye(len(mean)) + jnp.zeros((*mean.shape[1:], 1, 1)), (-2, -1), (0, 1))
        return jnp.stack([self.draw(unit) - mean for unit in units], axis=1)

    def for_above(self) -> tuple[Float[Array, "n *units"], Float[Array, "n n *units"]]:
        """Return slope and precision of `log_marginal` as a function of the level above."""
        count = len(self._half)
        columns: list[list[Array]] = []  # of the factor's inverse times scale times the precision
        for column in range(count):
            solved: list[Array] = []
            for i in range(count):
                of_row = self._scales[i] * self._precisions[i][column]
                solved.append((of_row - _dot(self._root[i], solved)) / self._root[i][i])
            columns.append(solved)
        slope = jnp.stack([self._slopes[i] - _dot(columns[i], self._half) for i in range(count)])
        left = [[self._precisions[i][j] - _dot(columns[i], columns[j]) for j in range(count)] for i in range(count)]
        return slope, jnp.stack([jnp.stack(row) for row in left])


def _factorise(slope: list[Array], gain: _Rows) -> tuple[_Rows, list[Array]]:
    """Return Cholesky's factor of a precision, given by its lower triangle, and its inverse times the slope."""
    root: _Rows = []
    half: list[Array] = []
    for i, of_row in enumerate(gain):
        row: list[Array] = []
        for j in range(i):
            row.append((of_row[j] - _dot(row, root[j])) / root[j][j])
        row.append(jnp.sqrt(of_row[i] - _dot(row, row)))
        half.append((slope[i] - _dot(row, half)) / row[i])
        root.append(row)
    return root, half


def _log_diagonal(root: _Rows) -> Array:
    return jnp.log(math.prod(row[-1] for row in root))


@jax.custom_jvp
def _log_marginal(slope: list[Array], gain: _Rows) -> Array:
    """Return the logarithm of the mean of exp(slope . u - u . (gain - 1) u / 2) over standard normal u."""
    root, half = _factorise(slope, gain)
    return 0.5 * _dot(half, half) - _log_diagonal(root)


@_log_marginal.defjvp
def _log_marginal_jvp(primals: tuple[list[Array], _Rows], tangents: tuple[list[Array], _Rows]) -> tuple[Array, Array]:
    """Fisher's identity: the derivative is the posterior mean of that of the exponent."""
    root, half = _factorise(*primals)
    count = len(half)
    inverse: _Rows = []  # of the root: its columns, each from the diagonal down
    for j in range(count):
        column = [1.0 / root[j][j]]
        for i in range(j + 1, count):
            column.append(-_dot(root[i][j:], column) / root[i][i])
        inverse.append(column)
    mean = [_dot(inverse[i], half[i:]) for i in range(count)]
    of_slope, of_gain = tangents
    tangent = _dot(mean, of_slope)
    for i in range(count):
        for j in range(i + 1):
            second_moment = mean[i] * mean[j] + _dot(inverse[j][i - j :], inverse[i])
            tangent = tangent - (0.5 if i == j else 1.0) * second_moment * of_gain[i][j]
    return 0.5 * _dot(half, half) - _log_diagonal(root), tangent


def _dot(left: list[Array], right: list[Array]) -> Array:
    """Return the sum of products, as far as the shorter one goes."""
    return sum((a * b for a, b in zip(left, right, strict=False)), jnp.zeros(()))


def _times(matrix: Float[Array, "*batch n n"], vector: Float[Array, "*draws n"]) -> Float[Array, "*draws n"]:
    return jnp.sum(matrix * vector[..., None, :], axis=-1)
