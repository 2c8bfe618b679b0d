"""A damped oscillator that a function of time drives: a mode of the rig, a valve that rings."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike


def oscillation(
    frequency_Hz: ScalarLike, damping_ratio: ScalarLike, driven: Float[Array, " nodes"], dt_s: ScalarLike
) -> Float[Array, "3 nodes"]:
    """Return y, y' and y'' of ``y'' + 2 zeta omega y' + omega^2 y = driven``, at rest in the beginning.

    By the trapezoidal rule, for the stiffness at which this has the oscillator's frequency at these nodes.

    Parameters
    ----------
    frequency_Hz, damping_ratio:
        omega / 2 pi, Hz, and zeta.
    driven:
        At nodes.
    dt_s:
        Spacing of the nodes, s.
    """
    half = 0.5 * jnp.asarray(dt_s)
    omega = jnp.tan(2 * jnp.pi * frequency_Hz * half) / half
    restoring = jnp.stack([omega**2, 2 * damping_ratio * omega])
    rates = jnp.stack([jnp.array([0.0, 1.0]), -restoring])
    onward = jnp.linalg.inv(jnp.eye(2) - half * rates)
    matrix = onward @ (jnp.eye(2) + half * rates)
    kicks = half * (driven[1:] + driven[:-1])[:, None] * onward[:, 1]

    def step(state: Array, kick: Array) -> tuple[Array, Array]:
        state = matrix @ state + kick
        return state, state

    _, states = jax.lax.scan(step, jnp.zeros(2), kicks)
    y, speed = jnp.concatenate([jnp.zeros((1, 2)), states]).T
    return jnp.stack([y, speed, driven - restoring @ jnp.stack([y, speed])])
