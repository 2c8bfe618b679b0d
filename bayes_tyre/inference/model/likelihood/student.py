"""Noise with heavy tails: the points of a record are independent Student-t about its curve.

The log density is no quadratic in the offsets F_i - F_0 and J, which have to be sampled with the rest. The normal
likelihood of points weighted by how far they are off says where they are: it shapes coordinates, never the posterior.
"""

from typing import override

import equinox as eqx
import jax.numpy as jnp
from jax.scipy.special import gammaln
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from numpyro.distributions import constraints

from bayes_tyre.inference.model.likelihood.direct import Likelihood, Records
from bayes_tyre.inference.model.likelihood.force_distribution import draw_forces
from bayes_tyre.inference.model.likelihood.offsets import OffsetsPosterior, sd_of_offsets, start_of
from bayes_tyre.inference.record_data import EQUATION_2, RecordData, force_curves


class StudentLikelihood(eqx.Module):
    """The likelihood of records with Student-t noise, point by point.

    Attributes
    ----------
    data:
        The records.
    weighted:
        Of normal noise, with points that are far off weighted less: about where the offsets are.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    """

    data: RecordData
    weighted: Likelihood
    law: str = eqx.field(static=True, default=EQUATION_2)

    def __call__(self, theta: Float[Array, "records 4"], sigma: Records, nu: Float[Array, ""]) -> Records:
        """Return the log density of each record at theta = (F_i, J, log k, log beta), shape (records,).

        Parameters
        ----------
        theta:
            F_i (kN), J (kN), log k, log beta.
        sigma:
            Scale of the noise of a point, kN.
        nu:
            Degrees of freedom.
        """
        return StudentForces(self.data, theta, sigma, nu, self.law).log_prob(self.data.F)

    def offsets_given(
        self,
        log_values: Float[Array, "records 2"],
        sigma: Records,
        nu: Float[Array, ""],
        mean_J: Records,
        sd_J: Float[Array, ""],
    ) -> OffsetsPosterior:
        """Return about where the offsets F_i - F_0 and J - mean_J (kN) of each record are, given the rest.

        As wide as the information that a t has on its location says. Source: Lange, Little and Taylor (1989), "Robust
        statistical modeling using the t distribution".
        """
        sd = sd_of_offsets(self.data, sd_J)
        of_offsets = self.weighted.of_offsets(log_values, sigma * jnp.sqrt((nu + 3.0) / (nu + 1.0)))
        return of_offsets.about(self.data.F_0 - self.weighted.first_force, mean_J).with_prior(sd)

    def at_coordinates(
        self,
        z: Float[Array, "records 2"],
        log_values: Float[Array, "records 2"],
        sigma: Records,
        nu: Float[Array, ""],
        mean_J: Records,
        sd_J: Float[Array, ""],
    ) -> Records:
        """Return the log density of each record's forces and offsets per unit of their coordinates z.

        Over z it integrates to the density of the forces, whatever `weighted` is.
        """
        given = self.offsets_given(log_values, sigma, nu, mean_J, sd_J)
        theta = jnp.concatenate([start_of(self.data, mean_J, given.draw(z)), log_values], axis=1)
        return self(theta, sigma, nu) + given.log_prior_of_drawn(z)


class StudentForces(dist.Distribution):
    """The forces (kN) of all records with Student-t noise; batch shape (records,), event shape (points,).

    Parameters
    ----------
    data:
        The records: where their points are.
    theta:
        F_i (kN), J (kN), log k, log beta of each.
    sigma, nu:
        Scale (kN) of the noise of each, and degrees of freedom of all.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`.
    """

    support = constraints.real_vector  # pyright: ignore[reportAssignmentType]  (as all of NumPyro's)

    def __init__(
        self,
        data: RecordData,
        theta: Float[Array, "records 4"],
        sigma: Float[Array, " records"],
        nu: Float[Array, ""],
        law: str = EQUATION_2,
    ) -> None:
        self.data, self.theta, self.sigma, self.nu, self.law = data, theta, sigma, nu, law
        super().__init__(data.u.shape[:1], data.u.shape[1:], validate_args=False)

    @override
    def sample(self, key: Array, sample_shape: tuple[int, ...] = ()) -> Float[Array, "*sample records points"]:
        """Draw the forces (kN)."""
        theta = jnp.broadcast_to(self.theta, (*sample_shape, *self.theta.shape))
        nu = jnp.broadcast_to(self.nu, self.sigma.shape)
        return draw_forces(key, self.data.u, theta, self.sigma, law=self.law, nu=nu)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " records"]:
        """Return the log density of the forces (kN) of each record."""
        residual = jnp.where(self.data.present, value - force_curves(self.data.u, self.theta, self.law), 0.0)
        half, points = 0.5 * (self.nu + 1.0), jnp.sum(self.data.present, axis=1)
        of_each = gammaln(half) - gammaln(0.5 * self.nu) - 0.5 * jnp.log(self.nu * jnp.pi) - jnp.log(self.sigma)
        tails = jnp.log1p((residual / self.sigma[:, None]) ** 2 / self.nu)
        return points * of_each - half * jnp.sum(tails, axis=1)
