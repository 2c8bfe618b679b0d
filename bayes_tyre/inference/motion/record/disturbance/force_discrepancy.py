"""The force that load and law leave out of a stationary tyre's record, as a random disturbance.

A load step of another shape, rubber that relaxes, friction that falls with speed: each is a small force that the model
has not, and where it is left out, k, x and beta take it up and their intervals do not show it. Here it is a normal
process of mean zero with Matern's covariance of smoothness 3/2, from the step's start on, larger while the tyre moves
(`disturbance.response` integrates it out). Its size is estimated with a prior that shrinks it: to exactly zero where
the readings do not ask for it. A force slower than the ringing is the same as k or x; correlation times end before.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.motion.record.disturbance.response import Columns
from bayes_tyre.inference.motion.record.forward_model import node_times, simulated
from bayes_tyre.inference.motion.record.parameters import MotionParameters, in_units
from bayes_tyre.inference.motion.record.window import Disturbance, Window
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig

#: The process's knots: their number and spacing (s) from the step's start on, then the number of those to the last,
#: evenly spaced, and when that one stands, s after the start.
KNOTS, SPACING_S, LATE_KNOTS, LAST_S = 48, 2.5e-3, 36, 0.45
#: Correlation times, s.
TIMES_S = (0.003, 0.008, 0.02, 0.05)
#: Standard deviations of the force while the tyre moves fastest, as shares of the load's step, and the mean of their
#: exponential prior.
LEAST_SHARE, MOST_SHARE, TYPICAL_SHARE = 1e-4, 0.1, 0.01
#: A force is taken where it is so many times as probable as none. Without one, a size above zero is the better fit in
#: half of the records, by chance; twice the logarithm of this is exceeded in 0.7 % (half a chi-squared).
LEAST_ODDS = 20.0
_GRID = 61
#: Standard deviation of the force at rest as a share of that while the tyre moves fastest; width over which the speed
#: is averaged, s.
AT_REST, SPEED_WIDTH_S = 0.15, 0.01
# Added to the correlation's diagonal, that its factor be finite.
_JITTER = 1e-9


@functools.partial(jax.jit, static_argnums=0)
def force_columns(rig: Rig, window: Window, standard: Float[Array, " parameters"]) -> Columns:
    """Return the columns of the force: a knot each, linear between them; sizes are shares of the load's step.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    standard:
        Standardised parameters near the MAP estimate.
    """
    parameters = in_units(rig, standard, window.prior, window.rolling, window.law)
    time_s = node_times(window)
    early, late = jnp.arange(KNOTS + 1) * SPACING_S, jnp.linspace(KNOTS * SPACING_S, LAST_S, LATE_KNOTS + 1)
    knots = parameters.start_s + jnp.concatenate([early, late[1:]])
    # The first knot is held at 0: the force begins with the step.
    between = jax.vmap(lambda unit: jnp.interp(time_s, knots, unit))(jnp.eye(len(knots)))[1:]
    knots = knots[1:]
    _, motion, _ = simulated(rig, parameters, window)
    near = jnp.exp(-0.5 * ((knots[:, None] - time_s) / SPEED_WIDTH_S) ** 2)
    speed = jnp.sqrt(near @ motion.velocity_mm_per_s**2 / jnp.sum(near, axis=1))
    sd = load_step_kN(rig, parameters) * jnp.sqrt(AT_REST**2 + (speed / jnp.max(speed)) ** 2)

    def correlation(time_s: Array) -> Array:
        apart = jnp.sqrt(3.0) * jnp.abs(knots[:, None] - knots) / time_s
        return (1 + apart) * jnp.exp(-apart)

    factors = sd[:, None] * jnp.linalg.cholesky(
        jax.vmap(correlation)(jnp.array(TIMES_S)) + _JITTER * jnp.eye(len(knots))
    )
    sizes = jnp.concatenate([jnp.zeros(1), jnp.geomspace(LEAST_SHARE, MOST_SHARE, _GRID)])
    columns = Disturbance(jnp.zeros_like(between), between)
    penalties = jnp.where(sizes > 0, 2 * jnp.log(LEAST_ODDS) + 2 * sizes / TYPICAL_SHARE, 0.0)
    return Columns(columns, factors, sizes, penalties)


def load_step_kN(rig: Rig, parameters: MotionParameters) -> Array:
    """Return the size of a load's step at the wheel centre, kN."""
    before, after = geometry.tyre_load(rig, parameters.load_kN)
    return jnp.abs(after - before)
