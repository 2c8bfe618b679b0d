"""The measured records as arrays for the models, and the force of the laws they may follow at their points."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from bayes_tyre.batch import Batch
from bayes_tyre.laws.fancher import equation_2_offset, small_step_limit_offset

#: Laws with a closed form along a record. In all of them the force settles on F_i + J + k u.
LAWS = {"equation_2": equation_2_offset, "small_step_limit": small_step_limit_offset}
#: What a posterior without the word was fitted with.
EQUATION_2 = "equation_2"


class RecordData(NamedTuple):
    """The measured records as arrays for the models: d_0 is the first displacement, u the distance from it.

    Attributes
    ----------
    u, F:
        Shape (records, points); mm, kN.
    present:
        Shape (records, points); False on padding.
    d_0, F_0, span:
        Shape (records,); first displacement (mm), first force (kN), largest change of force (kN).
    """

    u: Float[Array, "records points"]
    F: Float[Array, "records points"]
    present: Bool[Array, "records points"]
    d_0: Float[Array, " records"]
    F_0: Float[Array, " records"]
    span: Float[Array, " records"]


def record_data(batch: Batch) -> RecordData:
    """Return a batch of records as arrays for the models."""
    # In NumPy: JAX would compile each step by itself.
    d, F = batch.displacement_mm, batch.force_kN
    span = np.max(np.where(batch.present, np.abs(F - F[:, :1]), 0.0), axis=1)
    arrays = d - d[:, :1], F, batch.present, d[:, 0], F[:, 0], np.where(span > 0, span, 1.0)
    return RecordData(*map(jnp.asarray, arrays))


def force_curve(u: Float[Array, " points"], theta: Float[Array, "4"], law: str = EQUATION_2) -> Float[Array, " points"]:
    """Return the force (kN) of a law at u (mm) for theta = (F_i, J, log k, log beta)."""
    return theta[0] + LAWS[law](u, k=jnp.exp(theta[2]), J=theta[1], beta=jnp.exp(theta[3]))


@partial(jax.jit, static_argnames="law")
def force_curves(
    u: Float[Array, "records points"], theta: Float[Array, "records 4"], law: str
) -> Float[Array, "records points"]:
    """Return the forces (kN) of several records as `force_curve` does of one."""
    return jax.vmap(partial(force_curve, law=law))(u, theta)


def stiffness_column(u: Float[Array, "*#shape"], beta: Float[Array, "*#shape"], law: str) -> Float[Array, "*shape"]:
    """Return what k multiplies in a law's force at u (mm), which is linear in J and k given beta (mm)."""
    return LAWS[law](u, k=1.0, J=0.0, beta=beta)
