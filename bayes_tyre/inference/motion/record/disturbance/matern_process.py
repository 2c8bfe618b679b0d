"""A random function of time from a load's step on: Matern's of smoothness 3/2, known at its knots."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from bayes_tyre.inference.motion.record.model.forward_model import node_times
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.laws.base import ScalarLike

#: The knots: number and spacing (s) of the first, from the step's start on; then the number of those to the last,
#: evenly spaced, and when that one stands, s after the start.
KNOTS, SPACING_S, LATE_KNOTS, LAST_S = 40, 3e-3, 55, 0.45
#: Correlation times, s.
TIMES_S = (0.003, 0.008, 0.02, 0.05)
#: Standard deviations of the process, as shares of the load's step, and the mean of their exponential prior.
LEAST_SHARE, MOST_SHARE, TYPICAL_SHARE = 1e-4, 0.1, 0.01
#: A process is taken where it is so many times as probable as none. Without one, a size above zero is the better fit
#: in half of the records, by chance; twice the logarithm of this is exceeded in 0.7 % (half a chi-squared).
LEAST_ODDS = 20.0
_GRID = 61
# Added to the correlation's diagonal, that its factor be finite.
_JITTER = 1e-9


class Knots(NamedTuple):
    """The knots of a process in a window.

    Attributes
    ----------
    time_s:
        When they stand, s from the window's start, shape (knots,).
    functions:
        At the nodes of the integration, 1 at a knot and 0 at the others, shape (knots, nodes).
    """

    time_s: Float[Array, " knots"]
    functions: Float[Array, "knots nodes"]


def knots_from(window: Window, start_s: ScalarLike) -> Knots:
    """Return the knots of a process that begins at 0 when the load's step starts."""
    early, late = jnp.arange(KNOTS + 1) * SPACING_S, jnp.linspace(KNOTS * SPACING_S, LAST_S, LATE_KNOTS + 1)
    knots = jnp.asarray(start_s) + jnp.concatenate([early, late[1:]])
    functions = jax.vmap(lambda unit: _interpolated(node_times(window), knots, unit))(jnp.eye(len(knots)))
    return Knots(knots[1:], functions[1:])


def _interpolated(
    time_s: Float[Array, " times"], knots: Float[Array, " knots"], values: Float[Array, " knots"]
) -> Float[Array, " times"]:
    """Return the cubic Hermite interpolation, slopes by differences; constant before the first knot and after the last.

    A straight line between knots would be off by more than the accelerometer's noise where a load rings.
    """
    step = jnp.diff(knots)
    secant = jnp.diff(values) / step
    within = (secant[:-1] * step[1:] + secant[1:] * step[:-1]) / (step[:-1] + step[1:])
    slope = jnp.concatenate([secant[:1], within, secant[-1:]])
    i = jnp.clip(jnp.searchsorted(knots, time_s) - 1, 0, len(step) - 1)
    s = jnp.clip((time_s - knots[i]) / step[i], 0.0, 1.0)
    rise = s**2 * (3 - 2 * s)
    bend = s * (1 - s) * ((1 - s) * slope[i] - s * slope[i + 1])
    return values[i] + rise * (values[i + 1] - values[i]) + step[i] * bend


def correlation_factors(knots: Knots) -> Float[Array, "times knots knots"]:
    """Return the lower triangles of the knots' correlations, by each of `TIMES_S`."""

    def correlation(time_s: Array) -> Array:
        apart = jnp.sqrt(3.0) * jnp.abs(knots.time_s[:, None] - knots.time_s) / time_s
        return (1 + apart) * jnp.exp(-apart)

    diagonal = _JITTER * jnp.eye(len(knots.time_s))
    return jnp.linalg.cholesky(jax.vmap(correlation)(jnp.array(TIMES_S)) + diagonal)


def sizes_and_penalties(odds: ScalarLike = LEAST_ODDS) -> tuple[Float[Array, " sizes"], Float[Array, " sizes"]]:
    """Return the possible shares of the load's step, from 0, and what their prior adds to -2 log likelihood.

    A share above 0 has to be so many times, `odds`, as probable as none.
    """
    sizes = jnp.concatenate([jnp.zeros(1), jnp.geomspace(LEAST_SHARE, MOST_SHARE, _GRID)])
    return sizes, -2 * log_prior_of_size(sizes, odds)


def log_prior_of_size(size: Float[ArrayLike, "*sizes"], odds: ScalarLike = LEAST_ODDS) -> Float[Array, "*sizes"]:
    """Return the log prior of a share of the load's step, over that of 0; arguments as in `sizes_and_penalties`."""
    size = jnp.asarray(size)
    return jnp.where(size > 0, -jnp.log(odds) - size / TYPICAL_SHARE, 0.0)
