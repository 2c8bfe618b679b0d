"""A law along a path that is run through at a pace, as motions move it."""

import jax
import jax.numpy as jnp

from bayes_tyre.laws.base import StatefulLaw


def force_in_time(law: StatefulLaw, path, F_start: float, dt_s: float) -> jax.Array:
    """Return the force, kN, at every point of the path, mm, `dt_s` (s) apart, from a rest at the first.

    Rates are slopes of the parabola through the nearest three points.
    """
    path = jnp.asarray(path, float)
    rise = jnp.diff(path)
    slopes = jnp.concatenate([path[:1] * 0, (rise[1:] + rise[:-1]) / 2, (3 * rise[-1:] - rise[-2:-1]) / 2])
    times = jnp.full(len(path), dt_s).at[0].set(0.0)
    state = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), law.init(path[0], jnp.asarray(F_start, float)))
    return jax.lax.scan(lambda state, move: law.step_in(state, *move), state, (path, times, slopes / dt_s))[1]
