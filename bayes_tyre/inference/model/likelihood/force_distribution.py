"""The forces of all records given k, beta and noise: a law at every point, F_i and J integrated out."""

from functools import partial
from typing import override

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from numpyro.distributions import constraints

from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood, Likelihood
from bayes_tyre.inference.model.likelihood.offsets import OffsetsPosterior, sd_of_offsets, start_of
from bayes_tyre.inference.record_data import EQUATION_2, RecordData, force_curve


class RecordForces(dist.Distribution):
    """The forces (kN) of all records; batch shape (records,), event shape (points,).

    F_i is Normal about `data.F_0` with the span of the record's forces, J is Normal(mean_J, sd_J).

    Parameters
    ----------
    data:
        The records: where their points are.
    log_values:
        log k (kN/mm), log beta (mm) of each.
    mean_J, sd_J:
        Mean of J of each record's group, and standard deviation about it (kN).
    sigma, rho:
        Standard deviation (kN) and lag-1 autocorrelation of the noise of each; None: independent noise.
    likelihood:
        Of `data.F`, where a quicker or another one than point by point is to serve; it takes no other forces.
    law:
        One of `bayes_tyre.inference.record_data.LAWS`; a likelihood that is given has its own.
    """

    support = constraints.real_vector  # pyright: ignore[reportAssignmentType]  (as all of NumPyro's)

    def __init__(
        self,
        data: RecordData,
        log_values: Float[Array, "records 2"],
        mean_J: Float[Array, " records"],
        sd_J: Float[Array, ""],
        sigma: Float[Array, " records"],
        rho: Float[Array, " records"] | None = None,
        likelihood: Likelihood | None = None,
        law: str = EQUATION_2,
    ) -> None:
        self.data, self.log_values, self.sigma, self.rho, self.likelihood = data, log_values, sigma, rho, likelihood
        self.law, self.mean_J = law, mean_J
        self.sd_of_offsets = sd_of_offsets(data, sd_J)
        super().__init__(data.u.shape[:1], data.u.shape[1:], validate_args=False)

    @override
    def sample(self, key: Array, sample_shape: tuple[int, ...] = ()) -> Float[Array, "*sample records points"]:
        """Draw the forces (kN): the law from drawn F_i and J, and noise on every point."""
        of_offsets, of_noise = jax.random.split(key)
        z = jax.random.normal(of_offsets, (*sample_shape, *self.sd_of_offsets.shape))
        start = self.start(self.sd_of_offsets * z)
        theta = jnp.concatenate([start, jnp.broadcast_to(self.log_values, start.shape)], axis=-1)
        return draw_forces(of_noise, self.data.u, theta, self.sigma, self.rho, self.law)

    @override
    def log_prob(self, value: ArrayLike) -> Float[Array, " records"]:
        """Return the log density of the forces (kN) of each record."""
        return self.given(value).log_marginal

    def given(self, value: ArrayLike) -> OffsetsPosterior:
        """Return the posterior of the offsets of each record given its forces (kN)."""
        likelihood = self.likelihood or DirectLikelihood(self.data._replace(F=jnp.asarray(value)), law=self.law)
        of_offsets = likelihood.of_offsets(self.log_values, self.sigma, self.rho)
        # What a likelihood counts from is the first force measured; a prior may be about another.
        return of_offsets.about(self.data.F_0 - likelihood.first_force, self.mean_J).with_prior(self.sd_of_offsets)

    def start(self, offsets: Float[Array, "*sample records 2"]) -> Float[Array, "*sample records 2"]:
        """Return F_i and J (kN) from how far they are from F_0 and from the mean of J."""
        return start_of(self.data, self.mean_J, offsets)


def draw_forces(
    key: Array,
    u: Float[Array, "records points"],
    theta: Float[Array, "*sample records 4"],
    sigma: Float[Array, " records"],
    rho: Float[Array, " records"] | None = None,
    law: str = EQUATION_2,
    nu: Float[Array, " records"] | None = None,
) -> Float[Array, "*sample records points"]:
    """Draw forces (kN) at displacements u (mm) from the start, given (F_i, J, log k, log beta) and the noise."""
    shape = (*theta.shape[:-1], u.shape[1])
    noise = jax.random.normal(key, shape) if nu is None else jax.random.t(key, nu[:, None], shape)
    if rho is not None:
        noise = _autoregressive(noise, rho[:, None])
    curves = jnp.vectorize(partial(force_curve, law=law), signature="(p),(t)->(p)")
    return curves(u, theta) + sigma[:, None] * noise


def _autoregressive(z: Float[Array, "*batch points"], rho: Float[Array, "*#batch 1"]) -> Float[Array, "*batch points"]:
    """Return noise of variance 1 that follows the point before, from independent noise."""
    new = jnp.sqrt(1.0 - rho**2)

    def follow(before: Array, z: Array) -> tuple[Array, Array]:
        value = rho[..., 0] * before + new[..., 0] * z
        return value, value

    by_point = jnp.moveaxis(z, -1, 0)
    # A sum of one point: records without points, of which nothing is wanted but their parameters, have none.
    _, values = jax.lax.scan(follow, jnp.sum(by_point[:1], axis=0), by_point[1:])
    return jnp.moveaxis(jnp.concatenate([by_point[:1], values]), 0, -1)
