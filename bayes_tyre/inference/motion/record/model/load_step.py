"""The shape of a load step, a parametric family: from one level to the other over its rise."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike

#: Number of exponents that warp the raised cosine's time, and number of additive departures. A third departure would
#: make the onset of the step, which only the coarse load cell measures, weakly identified, and with it k.
BENDS, DEPARTURES = 2, 2
SHAPE_TERMS = BENDS + DEPARTURES
# Powers of 0 have no derivative: the share is clipped at this distance from 0 and 1.
_EDGE = 1e-9


def load_share(
    time_s: Float[Array, " times"], start_s: ScalarLike, rise_s: ScalarLike, shape: Float[Array, " terms"]
) -> Float[Array, " times"]:
    """Return the share of its step that the load has completed, 0 before it and 1 after it.

    ``(1 - cos(pi w)) / 2 + (s (1 - s))^2 sum_j b_j P_j(2 s - 1)``, s = (t - start) / rise held within 0 and 1,
    time bent to ``w = 1 - (1 - s^exp(a_1))^exp(a_2)``, P_j Legendre's polynomials. All shape 0: the
    raised cosine. A straight ramp, minimum jerk and a lag cut off after four time constants are in it to 0.5 % of the
    step (tested): a_1 < 0 starts with a jerk, a_2 > 0 ends slowly. Without departures b it never overshoots.

    Parameters
    ----------
    time_s:
        Times, s.
    start_s, rise_s:
        When the step begins and how long it takes, s.
    shape:
        The bends a_1 and a_2, then the departures b, shares of the step.
    """
    s = jnp.clip((time_s - start_s) / rise_s, _EDGE, 1.0 - _EDGE)
    w = 1 - (1 - s ** jnp.exp(shape[0])) ** jnp.exp(shape[1])
    z = 2 * s - 1
    before, polynomial, departure = jnp.zeros_like(z), jnp.ones_like(z), jnp.zeros_like(z)
    for order in range(len(shape) - BENDS):
        departure = departure + shape[BENDS + order] * polynomial
        before, polynomial = polynomial, ((2 * order + 1) * z * polynomial - order * before) / (order + 1)
    return (1 - jnp.cos(jnp.pi * w)) / 2 + (s * (1 - s)) ** 2 * departure
