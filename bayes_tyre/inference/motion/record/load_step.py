"""The shape of a load's step: from one level to the other over its rise, by few numbers."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.laws.base import ScalarLike

#: Numbers that bend the raised cosine's time, and numbers by which it then still departs. A third departure would let
#: the onset of the step go its own way where nothing but the coarse load cell sees it, and k with it.
BENDS, DEPARTURES = 2, 2
SHAPE_TERMS = BENDS + DEPARTURES
# Powers of 0 have no derivative: the share is held so near to the ends of the rise.
_EDGE = 1e-9


def load_share(
    time_s: Float[Array, " times"],
    start_s: ScalarLike,
    rise_s: ScalarLike,
    shape: Float[Array, " terms"],
) -> Float[Array, " times"]:
    """Return which share of its step the load has gone, 0 before it and 1 after it.

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
