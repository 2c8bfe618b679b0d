"""The likelihood of records under a force law: its contract, and the direct one, point by point.

Noise is normal: independent, or autoregressive of order one; either after a known linear map of a record's points
(`bayes_tyre.inference.correlated_noise.Whitening`). Given beta the force is linear in (F_i, J, k).
"""

from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from bayes_tyre.inference.correlated_noise import Whitening, innovations, whiten_records
from bayes_tyre.inference.model.likelihood.offsets import OffsetsLikelihood, Records
from bayes_tyre.inference.record_data import EQUATION_2, RecordData, force_curves, stiffness_column


class Likelihood(eqx.Module):
    """The contract: the log density of each record's forces, at given F_i and J or as a function of these."""

    @property
    @abstractmethod
    def first_force(self) -> Records:
        """The force (kN) of each record from which `of_offsets` counts F_i."""

    @abstractmethod
    def __call__(self, theta: Float[Array, "records 4"], sigma: Records, rho: Records | None = None) -> Records:
        """Return the log density of each record, shape (records,).

        Parameters
        ----------
        theta:
            F_i (kN), J (kN), log k, log beta.
        sigma:
            Standard deviation of the noise of a point, kN.
        rho:
            Lag-1 autocorrelation of the noise, inside (-1, 1); None: 0.
        """

    @abstractmethod
    def of_offsets(
        self, log_values: Float[Array, "records 2"], sigma: Records, rho: Records | None = None
    ) -> OffsetsLikelihood:
        """Return the log density of each record as a function of its offsets F_i - F_0 and J.

        Parameters
        ----------
        log_values:
            log k (kN/mm), log beta (mm).
        sigma, rho:
            As when called.
        """


class DirectLikelihood(Likelihood):
    """The likelihood as it is written down, point by point: the reference.

    Attributes
    ----------
    data:
        The records.
    whitening:
        Makes the noise independent, or autoregressive; None: it is.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    """

    data: RecordData
    whitening: Whitening | None = None
    law: str = eqx.field(static=True, default=EQUATION_2)

    @property
    def first_force(self) -> Records:
        """The first force (kN) of each record."""
        return self.data.F_0

    def __call__(self, theta: Float[Array, "records 4"], sigma: Records, rho: Records | None = None) -> Records:
        """Return the log density of each record at theta = (F_i, J, log k, log beta), shape (records,)."""
        present = self.data.present
        curves = force_curves(self.data.u, theta, self.law)
        residual = jnp.where(present, self.data.F - curves, 0.0)
        points = jnp.sum(present, axis=1)
        log_volume = jnp.zeros_like(sigma)
        if self.whitening is not None:
            residual, log_volume = whiten_records(self.whitening, residual, present), self.whitening.log_volume(points)
        if rho is None:
            return _log_normal(jnp.sum(residual**2, axis=1), points, sigma) + log_volume
        # The first point has the noise's own variance, every other that of what is new in it.
        new = jnp.where(present[:, 1:], residual[:, 1:] - rho[:, None] * residual[:, :-1], 0.0)
        rss = (1.0 - rho**2) * residual[:, 0] ** 2 + jnp.sum(new**2, axis=1)
        return _log_autoregressive(rss, points, sigma, rho) + log_volume

    def of_offsets(
        self, log_values: Float[Array, "records 2"], sigma: Records, rho: Records | None = None
    ) -> OffsetsLikelihood:
        """Return the log density of each record as a function of its offsets, given (log k, log beta)."""
        present, u = self.data.present, self.data.u
        k, beta = jnp.exp(log_values[:, :1]), jnp.exp(log_values[:, 1:])
        g = -jnp.expm1(-jnp.abs(u) / beta)
        left = self.data.F - self.data.F_0[:, None] - k * stiffness_column(u, beta, self.law)
        columns = jnp.stack([jnp.ones_like(u), g, left], axis=1)
        columns = jnp.where(present[:, None], columns, 0.0)
        log_volume = jnp.zeros(len(u))
        if self.whitening is not None:
            columns = _each_column(partial(whiten_records, self.whitening))(columns, present)
            log_volume = self.whitening.log_volume(jnp.sum(present, axis=1))
        if rho is not None:
            columns = _each_column(jax.vmap(innovations))(columns, present, rho)
        products = jnp.einsum("rip,rjp->rij", columns, columns)
        form = ResidualForm(
            products[:, 2, 2], products[:, :2, 2], products[:, np.array([0, 0, 1]), np.array([0, 1, 1])]
        )
        return offsets_of_form(form, jnp.sum(present, axis=1), sigma, rho, log_volume)


class ResidualForm(NamedTuple):
    """A bilinear form of the residual left - level - J g with itself, as a polynomial in level and J.

    Attributes
    ----------
    square:
        Of what is left at offsets of zero.
    slope:
        Last axis: of 1 and of g with it.
    precision:
        Last axis: of 1 with 1, of 1 with g, of g with g.
    """

    square: Float[Array, "records *forms"]
    slope: Float[Array, "records *forms 2"]
    precision: Float[Array, "records *forms 3"]


def offsets_of_form(
    form: ResidualForm, points: Array, sigma: Records, rho: Records | None, log_volume: Records
) -> OffsetsLikelihood:
    """Return the log density from the sum of squares of whitened residuals, the noise's variance not yet taken out."""
    constant = _log_normal(form.square, points, sigma) + log_volume
    if rho is not None:
        constant = constant - 0.5 * (points - 1) * jnp.log(1.0 - rho**2)
    variance = sigma[:, None] ** 2
    return OffsetsLikelihood(constant, form.slope / variance, form.precision / variance)


def _each_column(whiten: Callable[..., Array]) -> Callable[..., Array]:
    """Return a function of the points of all records as one of several columns of each record."""

    def columns(values: Array, *of_records: Array) -> Array:
        return jax.vmap(lambda column: whiten(column, *of_records), in_axes=1, out_axes=1)(values)

    return columns


def _log_normal(rss: Records, points: Array, sigma: Records) -> Records:
    return -0.5 * rss / sigma**2 - points * (jnp.log(sigma) + 0.5 * jnp.log(2.0 * jnp.pi))


def _log_autoregressive(rss: Records, points: Array, sigma: Records, rho: Records) -> Records:
    """Return the log density from the sum (1 - rho^2) r_1^2 + sum (r_t - rho r_(t-1))^2."""
    new = 1.0 - rho**2
    return _log_normal(rss / new, points, sigma) - 0.5 * (points - 1) * jnp.log(new)
