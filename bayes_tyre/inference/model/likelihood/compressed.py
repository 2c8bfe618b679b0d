"""The likelihood of records compressed without loss: a few inner products in place of the points.

Given beta the force is linear in (F_i, J, k). A record's log-likelihood therefore needs its points only through
inner products of `1`, `g` (g = 1 - exp(-|u| / beta)) and `h`, what k multiplies (u g in Equation 2), with each other
and with the force: seven smooth functions of log beta, and three numbers. Tabulated once as piecewise Chebyshev
polynomials, they make one evaluation independent of the number of points. Of autoregressive noise the exponent is a
quadratic in its coefficient rho with the same products, of neighbours and of either end too.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.correlated_noise import Whitening
from bayes_tyre.inference.model.likelihood.direct import Likelihood, Records, ResidualForm, offsets_of_form
from bayes_tyre.inference.model.likelihood.offsets import OffsetsLikelihood
from bayes_tyre.inference.record_data import EQUATION_2, RecordData, stiffness_column

#: Cells in log beta, and the degree in each: the table is then off by 1e-7 in the log density (see the tests).
CELLS, DEGREE = 48, 12
#: The table reaches from where even the first point has left (|u| = 40 beta) to a nearly straight line.
_FIRST_POINT_OVER_BETA, _BETA_OVER_TRAVEL = 40.0, 100.0
_SMALLEST_STEP_OVER_TRAVEL = 1e-9
#: Products of a form that depend on beta: g, h with 1, with each other, and with y.
_PRODUCTS = 7
#: Records tabulated at once: what is between the points and the table takes several times the memory of the table.
_AT_ONCE = 1000


class CompressedLikelihood(Likelihood):
    """The same likelihood from a table of inner products; build it with `compress`.

    A form is a bilinear form in the residual: the sum of squares, and for autoregressive noise the sum over neighbours
    and the squares of the first and the last point.

    Attributes
    ----------
    table:
        Shape (records, cells, degree + 1, 7 forms): Chebyshev coefficients of the products in each cell of log beta.
    low, width:
        Shape (records,): log beta (mm) at which the table starts, and the width of a cell.
    constants:
        Shape (records, forms, 3): the form of 1 with 1, of 1 with y = F - F_0 (kN), and of y with y.
    points, F_0, log_volume:
        Shape (records,): number of points, first force (kN), log volume of the whitening (0 without).
    """

    table: Float[Array, "records cells coefficients products"]
    low: Records
    width: Records
    constants: Float[Array, "records forms 3"]
    points: Records
    F_0: Records
    log_volume: Records

    @property
    def first_force(self) -> Records:
        """The first force (kN) of each record."""
        return self.F_0

    def __call__(self, theta: Float[Array, "records 4"], sigma: Records, rho: Records | None = None) -> Records:
        """Return the log density of each record at theta = (F_i, J, log k, log beta), shape (records,).

        Beyond the table's ends in log beta the density stays as it is there.

        Raises
        ------
        ValueError
            For a rho where the table holds no products of neighbours.
        """
        offsets = theta[:, :2] - jnp.stack([self.F_0, jnp.zeros_like(self.F_0)], axis=1)
        return self.of_offsets(theta[:, 2:], sigma, rho).at(offsets)

    def of_offsets(
        self, log_values: Float[Array, "records 2"], sigma: Records, rho: Records | None = None
    ) -> OffsetsLikelihood:
        """Return the log density of each record as a function of its offsets, given (log k, log beta).

        Raises
        ------
        ValueError
            For a rho where the table holds no products of neighbours.
        """
        weights = jnp.ones((len(log_values), 1))
        if rho is not None:
            if self.constants.shape[1] < 2:
                raise ValueError("autoregressive noise needs the products of neighbours: compress(neighbours=True)")
            # (1 - rho^2) r_1^2 + sum (r_t - rho r_(t-1))^2: the ends count once in the sum of squares.
            weights = jnp.stack([1.0 + rho**2, -2.0 * rho, -(rho**2)], axis=1) / (1.0 - rho**2)[:, None]
        forms = self._forms(log_values)
        form = jax.tree.map(lambda of: jnp.einsum("rf,rf...->r...", weights, of[:, : weights.shape[1]]), forms)
        return offsets_of_form(form, self.points, sigma, rho, self.log_volume)

    def _forms(self, log_values: Float[Array, "records 2"]) -> ResidualForm:
        """Return each form of the residual y - level - J g - k h; leaves (records, forms, ...)."""
        k = jnp.exp(log_values[:, :1])
        products = self._products(log_values[:, 1]).reshape(len(k), -1, _PRODUCTS)
        g, h, gg, gh, hh, yg, yh = jnp.moveaxis(products, 2, 0)
        one, y, yy = jnp.moveaxis(self.constants, 2, 0)
        slope = jnp.stack([y - k * h, yg - k * gh], axis=2)
        return ResidualForm(yy - 2.0 * k * yh + k**2 * hh, slope, jnp.stack([one, g, gg], axis=2))

    def _inside(self, log_beta: Records) -> Records:
        return jnp.clip(log_beta, self.low, self.low + self.table.shape[1] * self.width)

    def _products(self, log_beta: Records) -> Float[Array, "records products"]:
        cells = self.table.shape[1]
        place = (self._inside(log_beta) - self.low) / self.width
        cell = jnp.clip(jnp.floor(place), 0, cells - 1).astype(int)
        coefficients = jax.vmap(lambda rows, i: rows[i])(self.table, cell)
        # Not `einsum`, which would copy the cell of each record before it sums: most of the time of a draw.
        return jnp.sum(coefficients * _chebyshev(2.0 * (place - cell) - 1.0, self.table.shape[2])[:, :, None], axis=1)


def _chebyshev(t: Records, count: int) -> Float[Array, "records count"]:
    """Return the Chebyshev polynomials T_0 to T_(count - 1) at t in [-1, 1]."""
    values = [jnp.ones_like(t), t]
    while len(values) < count:
        values.append(2.0 * t * values[-1] - values[-2])
    return jnp.stack(values[:count], axis=1)


def _form_products(columns: Float[Array, "4 points"], other: Float[Array, "4 points"]) -> Float[Array, "4 4"]:
    """Return the symmetric form of (1, g, h, y) that pairs each point of `columns` with one of `other`."""
    products = columns @ other.T
    return 0.5 * (products + products.T)


def _all_products(
    log_beta: Float[Array, ""], data: RecordData, whitening: Whitening | None, neighbours: bool, law: str
) -> Float[Array, "forms 4 4"]:
    """Return the forms of (1, g, h, y) of one record at log beta (mm): sums over its points."""
    y = jnp.where(data.present, data.F - data.F_0, 0.0)
    g = jnp.where(data.present, -jnp.expm1(-jnp.abs(data.u) / jnp.exp(log_beta)), 0.0)
    of_k = jnp.where(data.present, stiffness_column(data.u, jnp.exp(log_beta), law), 0.0)
    columns = jnp.stack([data.present.astype(y.dtype), g, of_k, y])
    if whitening is not None:
        columns = jax.vmap(whitening.whiten, in_axes=(0, None))(columns, data.present)
    forms = [_form_products(columns, columns)]
    if neighbours:
        # Padding is zero in every column, and follows the points.
        forms.append(_form_products(columns[:, 1:], columns[:, :-1]))
        last = jnp.sum(data.present) - 1
        ends = jnp.stack([columns[:, 0], columns[:, last]], axis=1)
        forms.append(_form_products(ends, ends))
    return jnp.stack(forms)


@eqx.filter_jit
def compress(
    data: RecordData, *, neighbours: bool = False, whitening: Whitening | None = None, law: str = EQUATION_2
) -> CompressedLikelihood:
    """Return the compressed likelihood of the records, off by 1e-7 at most inside its range of beta.

    The range of each record is from a fortieth of its smallest displacement to a hundred times its travel.

    Parameters
    ----------
    data:
        The records.
    neighbours:
        Whether to tabulate products of neighbours and of the ends too, for autoregressive noise.
    whitening:
        Of the records' noise; None: it needs none.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    """
    records = len(data.present)
    if records <= _AT_ONCE:
        return _compress(data, neighbours, whitening, law)

    def some(start: Array | int) -> CompressedLikelihood:
        def cut(leaf: Array) -> Array:
            return jax.lax.dynamic_slice_in_dim(leaf, start, _AT_ONCE)

        of_some = whitening if whitening is None or whitening.axis is None else jax.tree.map(cut, whitening)
        return _compress(jax.tree.map(cut, data), neighbours, of_some, law)

    def fill(number: Array, whole: CompressedLikelihood) -> CompressedLikelihood:
        # The last ones overlap with those before them.
        start = jnp.minimum(number * _AT_ONCE, records - _AT_ONCE)
        return jax.tree.map(
            lambda all, new: jax.lax.dynamic_update_slice_in_dim(all, new, start, 0), whole, some(start)
        )

    empty = jax.tree.map(lambda leaf: jnp.zeros((records, *leaf.shape[1:])), jax.eval_shape(some, 0))
    return jax.lax.fori_loop(0, -(-records // _AT_ONCE), fill, empty)


def _compress(data: RecordData, neighbours: bool, whitening: Whitening | None, law: str) -> CompressedLikelihood:
    distance = jnp.where(data.present, jnp.abs(data.u), 0.0)
    travel = jnp.max(distance, axis=1)
    least = jnp.min(jnp.where(distance > 0, distance, jnp.inf), axis=1)
    low = jnp.log(jnp.maximum(least / _FIRST_POINT_OVER_BETA, _SMALLEST_STEP_OVER_TRAVEL * travel))
    width = (jnp.log(_BETA_OVER_TRAVEL * travel) - low) / CELLS
    count = DEGREE + 1
    angle = np.pi * (np.arange(count) + 0.5) / count
    places = (jnp.arange(CELLS)[:, None] + 0.5 * (jnp.asarray(np.cos(angle)) + 1.0)).ravel()

    def at(place: Float[Array, ""]) -> Float[Array, "records forms 4 4"]:
        def of_record(log_beta: Array, record: RecordData, whitening: Whitening | None) -> Array:
            return _all_products(log_beta, record, whitening, neighbours, law)

        return jax.vmap(of_record, in_axes=(0, 0, None if whitening is None else whitening.axis))(
            low + width * place, data, whitening
        )

    # lax.map keeps memory at one value of beta for all records, however many nodes there are.
    forms = jax.lax.map(at, places)
    # The order in which `_forms` takes them; (1, g, h, y) are numbered 0 to 3.
    left, right = np.array([(0, 1), (0, 2), (1, 1), (1, 2), (2, 2), (1, 3), (2, 3)]).T
    values = forms[..., left, right].reshape(CELLS, count, len(low), -1)
    to_coefficients = np.cos(np.outer(np.arange(count), angle)) * 2.0 / count
    to_coefficients[0] /= 2.0
    points = jnp.sum(data.present, axis=1)
    return CompressedLikelihood(
        table=jnp.einsum("mj,cjrq->rcmq", jnp.asarray(to_coefficients), values),
        low=low,
        width=width,
        constants=forms[0][..., np.array([0, 0, 3]), np.array([0, 3, 3])],
        points=points.astype(low.dtype),
        F_0=data.F_0,
        log_volume=jnp.zeros_like(low) if whitening is None else whitening.log_volume(points),
    )
