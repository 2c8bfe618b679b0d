"""Starting values: beta by a grid search of the RSS profile, the linear parameters at their optimum for that beta."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, C, K
from bayes_tyre.inference.least_squares.scaled_problem import ScaledProblem
from bayes_tyre.inference.least_squares.small_linear_algebra import minimise_bounded_quadratic

#: Equation 2 is linear in these once beta and d_i are known.
LINEAR = (K, C, F_I)
#: Range and number of betas of the grid, over the travel: far below the spacing of points to almost a straight line.
SCANNED_BETAS, SCANS = (1e-5, 1e2), 57
#: Values of d_i that are tried where it is free: distances from the first point, over the travel.
STEPS_OF_D_I = (0.0, -1.0, -0.3, -0.1, -0.03, -0.01, -0.003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)


def solve_linear(
    beta: Float[Array, ""], base: Float[Array, "5"], scaled: ScaledProblem, free: tuple[int, ...]
) -> tuple[Float[Array, "5"], Float[Array, ""]]:
    """Return `base` with this beta and the free linear parameters at their optimum within bounds; the RSS there.

    All in scaled units.
    """
    rise = -jnp.expm1(-jnp.abs(scaled.d - base[D_I]) / beta)
    columns = {K: scaled.d * rise, C: rise, F_I: 1.0 - rise}
    offset = sum((columns[i] * base[i] for i in LINEAR if i not in free), -scaled.F)
    unknown = [i for i in LINEAR if i in free]
    rows = jnp.where(scaled.used, jnp.stack([*(columns[i] for i in unknown), offset]), 0.0)
    value, rest = base.at[BETA].set(beta), rows[-1]
    if unknown:
        index = jnp.array(unknown)
        products = rows @ rows.T
        x = minimise_bounded_quadratic(products[:-1, :-1], products[:-1, -1], scaled.low[index], scaled.high[index])
        value, rest = value.at[index].set(x), rest + x @ rows[:-1]
    return value, jnp.sum(rest**2)


def starting_values(
    given: Float[Array, "starts 5"], scaled: ScaledProblem, free: tuple[int, ...]
) -> Float[Array, "tried 5"]:
    """Return starting values in scaled units: as given (kN, mm; NaN where not), the others estimated from the data.

    With d_i free each value of `STEPS_OF_D_I` has a start: the RSS has a kink, and may have a minimum, at every point.
    """
    is_free = jnp.array([i in free for i in range(5)])
    base = jnp.where(is_free, jnp.clip(scaled.base, scaled.low, scaled.high), scaled.base)
    away = jnp.where(scaled.used, scaled.d - scaled.d[0], 0.0)
    forward = jnp.sign(away[jnp.argmax(jnp.abs(away))])

    def complete(start: Float[Array, "5"], step: Float[Array, ""]) -> Float[Array, "5"]:
        is_given, in_units = is_free & ~jnp.isnan(start), (start - scaled.units.zero) / scaled.units.unit
        tried = jnp.clip(base[D_I] + step * forward, scaled.low[D_I], scaled.high[D_I])
        there = base.at[D_I].set(jnp.where(is_given[D_I], in_units[D_I], tried))
        beta = jnp.where(is_given[BETA], in_units[BETA], _grid_beta(there, scaled, free))
        estimate, _ = solve_linear(beta, there, scaled, free)
        value = scaled.units.scaled(jnp.where(is_given, start, scaled.units.given(estimate)))
        return jnp.where(is_free, jnp.clip(value, scaled.low, scaled.high), scaled.base)

    steps = jnp.array(STEPS_OF_D_I if D_I in free else (0.0,))
    return jax.lax.map(lambda start: jax.lax.map(lambda step: complete(start, step), steps), given).reshape(-1, 5)


def _grid_beta(base: Float[Array, "5"], scaled: ScaledProblem, free: tuple[int, ...]) -> Float[Array, ""]:
    """Return the beta of lowest RSS on the grid; the fixed one where beta is not free."""
    if BETA not in free:
        return base[BETA]
    least, most = (jnp.log(jnp.clip(beta, *scaled.beta_ends)) for beta in SCANNED_BETAS)
    candidates = jnp.exp(jnp.linspace(least, most, SCANS))
    # lax.map, not vmap: a scan over betas keeps memory at one batch whatever the number tried.
    rss = jax.lax.map(lambda beta: solve_linear(beta, base, scaled, free)[1], candidates)
    return candidates[jnp.argmin(jnp.where(jnp.isfinite(rss), rss, jnp.inf))]
