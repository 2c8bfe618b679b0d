"""Where a fit of Equation 2 starts: beta by a scan of its profile, what is linear at its optimum for that beta."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, C, K
from bayes_tyre.inference.least_squares.scaled_problem import OwnProblem
from bayes_tyre.inference.least_squares.small_linear_algebra import lowest_in_box

#: Equation 2 is linear in these once beta and d_i are known.
LINEAR = (K, C, F_I)
#: Betas tried for a start, over the travel: from far below any spacing of points to almost a straight line.
SCANNED_BETAS, SCANS = (1e-5, 1e2), 57
#: Where d_i is tried when it is free: from the first point on, over the travel.
STEPS_OF_D_I = (0.0, -1.0, -0.3, -0.1, -0.03, -0.01, -0.003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)


def solve_linear(
    beta: Float[Array, ""], base: Float[Array, "5"], own: OwnProblem, free: tuple[int, ...]
) -> tuple[Float[Array, "5"], Float[Array, ""]]:
    """Return `base` with this beta and the free linear parameters at their optimum within bounds; the RSS there.

    All in own units. The profile of the RSS over beta, one value of it.
    """
    gone = -jnp.expm1(-jnp.abs(own.d - base[D_I]) / beta)
    columns = {K: own.d * gone, C: gone, F_I: 1.0 - gone}
    offset = sum((columns[i] * base[i] for i in LINEAR if i not in free), -own.F)
    unknown = [i for i in LINEAR if i in free]
    rows = jnp.where(own.used, jnp.stack([*(columns[i] for i in unknown), offset]), 0.0)
    value, rest = base.at[BETA].set(beta), rows[-1]
    if unknown:
        index = jnp.array(unknown)
        products = rows @ rows.T
        x = lowest_in_box(products[:-1, :-1], products[:-1, -1], own.low[index], own.high[index])
        value, rest = value.at[index].set(x), rest + x @ rows[:-1]
    return value, jnp.sum(rest**2)


def starting_values(given: Float[Array, "starts 5"], own: OwnProblem, free: tuple[int, ...]) -> Float[Array, "tried 5"]:
    """Return starting values in own units: as given (kN, mm; NaN where not), the others found from the data.

    With d_i free each start is tried from several d_i: the RSS has a kink, and may have a minimum, at every point.
    """
    is_free = jnp.array([i in free for i in range(5)])
    base = jnp.where(is_free, jnp.clip(own.base, own.low, own.high), own.base)
    away = jnp.where(own.used, own.d - own.d[0], 0.0)
    forward = jnp.sign(away[jnp.argmax(jnp.abs(away))])

    def complete(start: Float[Array, "5"], step: Float[Array, ""]) -> Float[Array, "5"]:
        taken, start_alone = is_free & ~jnp.isnan(start), (start - own.units.zero) / own.units.unit
        tried = jnp.clip(base[D_I] + step * forward, own.low[D_I], own.high[D_I])
        there = base.at[D_I].set(jnp.where(taken[D_I], start_alone[D_I], tried))
        beta = jnp.where(taken[BETA], start_alone[BETA], _scanned_beta(there, own, free))
        found, _ = solve_linear(beta, there, own, free)
        value = own.units.own(jnp.where(taken, start, own.units.given(found)))
        return jnp.where(is_free, jnp.clip(value, own.low, own.high), own.base)

    steps = jnp.array(STEPS_OF_D_I if D_I in free else (0.0,))
    return jax.lax.map(lambda start: jax.lax.map(lambda step: complete(start, step), steps), given).reshape(-1, 5)


def _scanned_beta(base: Float[Array, "5"], own: OwnProblem, free: tuple[int, ...]) -> Float[Array, ""]:
    """Return the beta of lowest RSS among those tried; the fixed one where it is not free."""
    if BETA not in free:
        return base[BETA]
    least, most = (jnp.log(jnp.clip(beta, *own.beta_ends)) for beta in SCANNED_BETAS)
    candidates = jnp.exp(jnp.linspace(least, most, SCANS))
    # lax.map, not vmap: a scan over betas keeps memory at one batch whatever the number tried.
    rss = jax.lax.map(lambda beta: solve_linear(beta, base, own, free)[1], candidates)
    return candidates[jnp.argmin(jnp.where(jnp.isfinite(rss), rss, jnp.inf))]
