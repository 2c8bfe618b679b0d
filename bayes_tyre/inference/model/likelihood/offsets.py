"""The offsets of each record, in which its force is linear: integrated out in closed form, drawn afterwards.

The offsets are F_i - F_0 and J (kN): where the curve starts, about the first force, and how far the envelope lies off
there. Sampled beside k and beta they would leave a funnel where their scale goes to zero.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.record_data import RecordData

Records = Float[Array, " records"]


class OffsetsLikelihood(NamedTuple):
    """Log density of each record's forces as a function of its offsets o: constant + slope.o - o.precision.o / 2.

    Attributes
    ----------
    constant:
        Shape (records,): the log density at offsets of zero.
    slope:
        Shape (records, 2), 1 / kN.
    precision:
        Shape (records, 3), 1 / kN^2: of the level, of level and J together, of J.
    """

    constant: Records
    slope: Float[Array, "records 2"]
    precision: Float[Array, "records 3"]

    def at(self, offsets: Float[Array, "records 2"]) -> Records:
        """Return the log density of each record's forces at these offsets (kN)."""
        level, J = offsets.T
        of_level, of_both, of_J = self.precision.T
        square = of_level * level**2 + 2.0 * of_both * level * J + of_J * J**2
        return self.constant + jnp.sum(self.slope * offsets, axis=1) - 0.5 * square

    def about(self, level: Records, J: Records) -> "OffsetsLikelihood":
        """Return the same density as a function of how far the offsets are from these (kN)."""
        of_level, of_both, of_J = self.precision.T
        constant = self.at(jnp.stack([level, J], axis=1))
        slope = self.slope - jnp.stack([of_level * level + of_both * J, of_both * level + of_J * J], axis=1)
        return OffsetsLikelihood(constant, slope, self.precision)

    def with_prior(self, sd: Float[Array, "records 2"]) -> "OffsetsPosterior":
        """Return the posterior of offsets that are Normal(0, sd), each by itself (kN)."""
        # In units of the prior's sd, which may go to zero; Cholesky's factor of the precision is written out.
        sd_level, sd_J = sd.T
        of_level, of_both, of_J = self.precision.T
        level = jnp.sqrt(1.0 + of_level * sd_level**2)
        both = of_both * sd_level * sd_J / level
        J = jnp.sqrt(1.0 + of_J * sd_J**2 - both**2)
        slope = self.slope * sd
        half = slope[:, 0] / level
        half = jnp.stack([half, (slope[:, 1] - both * half) / J], axis=1)
        log_marginal = self.constant - jnp.log(level * J) + 0.5 * jnp.sum(half**2, axis=1)
        return OffsetsPosterior(sd, jnp.stack([level, both, J], axis=1), half, log_marginal)


class OffsetsPosterior(NamedTuple):
    """The normal posterior of each record's offsets.

    Attributes
    ----------
    sd:
        Shape (records, 2), kN: of their prior.
    root:
        Shape (records, 3): Cholesky's factor of the precision in units of `sd`: level, both, J.
    half:
        Shape (records, 2): the mean times the factor, in the same units.
    log_marginal:
        Shape (records,): log density of the forces, offsets integrated out.
    """

    sd: Float[Array, "records 2"]
    root: Float[Array, "records 3"]
    half: Float[Array, "records 2"]
    log_marginal: Records

    def draw(self, z: Float[Array, "records 2"]) -> Float[Array, "records 2"]:
        """Return offsets (kN) drawn by standard normal numbers."""
        return self.sd * self._in_sd(z)

    def log_prior_of_drawn(self, z: Float[Array, "records 2"]) -> Records:
        """Return the log density that the prior has at the offsets drawn by z, per unit of z, shape (records,)."""
        # In units of the prior's sd, which cancels.
        level, _, J = self.root.T
        return -0.5 * jnp.sum(self._in_sd(z) ** 2, axis=1) - jnp.log(2.0 * jnp.pi) - jnp.log(level * J)

    def _in_sd(self, z: Float[Array, "records 2"]) -> Float[Array, "records 2"]:
        level, both, J = self.root.T
        of_J = (self.half[:, 1] + z[:, 1]) / J
        of_level = (self.half[:, 0] + z[:, 0] - both * of_J) / level
        return jnp.stack([of_level, of_J], axis=1)


def sd_of_offsets(data: RecordData, sd_J: Float[Array, ""]) -> Float[Array, "records 2"]:
    """Return the standard deviations (kN) of the prior of F_i and of J of each record."""
    return jnp.stack([data.span, jnp.broadcast_to(sd_J, data.span.shape)], axis=1)


def start_of(
    data: RecordData, mean_J: Records, offsets: Float[Array, "*sample records 2"]
) -> Float[Array, "*sample records 2"]:
    """Return F_i and J (kN) from how far they are from F_0 and from the mean of J."""
    return offsets + jnp.stack([data.F_0, mean_J], axis=1)
