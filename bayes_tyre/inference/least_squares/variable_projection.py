"""Variable projection (Golub and Pereyra 1973): the RSS of Equation 2 as a function of log beta alone.

At each beta the force is linear in k, C and F_i, which take their optimum; this profile has one unknown, so that few
passes over the points fit a record.
"""

from typing import NamedTuple

import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, C, K
from bayes_tyre.inference.least_squares.scalar_newton import Derivatives, ScalarNewton
from bayes_tyre.inference.least_squares.scaled_problem import ScaledProblem
from bayes_tyre.inference.least_squares.small_linear_algebra import orthogonalised, solve_transposed, solve_upper
from bayes_tyre.inference.least_squares.starting_values import LINEAR

#: Residuals below this part of the forces are rounding.
_EXACT = 1e-14
#: Least beta over the distance from d_i to the nearest point: exp(-|d - d_i| / beta) is then rounding at every point,
#: and no smaller beta changes a force.
_LEAST_BETA = 1 / 40
#: The second derivative is used where it is at least this part of the Gauss-Newton one, which is never negative.
_LEAST_NEWTON = 0.1
#: A curvature below this part of the tangent's square is rounding.
_LEAST_CURVATURE = 1e-26


class Profile(NamedTuple):
    """A record prepared for its profile, in scaled units.

    Attributes
    ----------
    own:
        The record.
    distance:
        Shape (points,): |d - d_i|; 0 on padding.
    one, d, F:
        Shape (points,): 1, displacement and force; 0 on padding.
    rounding:
        Sum of squares below which residuals are rounding.
    """

    scaled: ScaledProblem
    distance: Float[Array, " points"]
    one: Float[Array, " points"]
    d: Float[Array, " points"]
    F: Float[Array, " points"]
    rounding: Float[Array, ""]

    def columns(self, rise: Float[Array, " points"]) -> dict[int, Float[Array, " points"]]:
        """Return the derivative of the force with respect to each linear parameter; `rise`: 1 - exp(-reach)."""
        return {K: self.d * rise, C: rise, F_I: self.one - rise}

    def offset(self, columns: dict[int, Float[Array, " points"]], free: tuple[int, ...]) -> Float[Array, " points"]:
        """Return the force less the part of the linear parameters that are fixed."""
        return self.F - sum((columns[i] * self.scaled.base[i] for i in LINEAR if i not in free), jnp.zeros(()))


def profile_of(scaled: ScaledProblem) -> Profile:
    """Return a record prepared for its profile."""
    distance, one, d, F = (
        jnp.where(scaled.used, row, 0.0)
        for row in (jnp.abs(scaled.d - scaled.base[D_I]), jnp.ones_like(scaled.d), scaled.d, scaled.F)
    )
    return Profile(scaled, distance, one, d, F, _EXACT**2 * jnp.sum(F**2))


def ends(profile: Profile) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the least and the largest beta to search: the record's limits, and none too small to change a force."""
    low, high = profile.scaled.beta_ends
    nearest = jnp.min(jnp.where(profile.distance > 0, profile.distance, jnp.inf))
    return jnp.clip(_LEAST_BETA * nearest, low, high), high


class Optimum(NamedTuple):
    """The best fit at one beta, in scaled units.

    Attributes
    ----------
    value:
        Shape (5,); the free linear parameters at their optimum.
    rss:
        Sum of squares of the residuals.
    tangents:
        Derivative of the force, shape (points,), by index of each free parameter.
    """

    value: Float[Array, "5"]
    rss: Float[Array, ""]
    tangents: dict[int, Float[Array, " points"]]


def optimum(profile: Profile, beta: Float[Array, ""], free: tuple[int, ...]) -> Optimum:
    """Return the best fit at a beta."""
    return profile_at(profile, beta, free)[2]


def profile_at(
    profile: Profile, beta: Float[Array, ""], free: tuple[int, ...]
) -> tuple[Float[Array, ""], Derivatives, Optimum]:
    """Return the profile at a beta: half the sum of squared residuals, its derivatives in log beta, and the best fit.

    Where the second derivative is negative or nearly so, the curvature is its Gauss-Newton approximation.

    By an orthogonal basis of the columns: the normal equations would lose twice the digits, which records almost
    without noise need.
    """
    reach = profile.distance / beta
    rise = -jnp.expm1(-reach)
    columns = profile.columns(rise)
    names = [i for i in LINEAR if i in free]
    basis = orthogonalised([*(columns[i] for i in names), profile.offset(columns, free)])
    residual = -basis.rest[-1]
    upper = [row[:-1] for row in basis.rows[:-1]]
    value = profile.scaled.base.at[jnp.array(names)].set(solve_upper(upper, [row[-1] for row in basis.rows[:-1]]))

    change = reach * (profile.one - rise)
    over = value[F_I] * profile.one - value[K] * profile.d - value[C] * profile.one
    tangent = over * change
    along, across = [], tangent
    for i in range(len(names)):
        component, across = basis.split(i, across)
        along.append(component)
    changes = {K: -profile.d * change, C: -change, F_I: change}
    projected = solve_transposed(upper, [jnp.sum(changes[i] * residual) for i in names])
    square, rss = jnp.sum(across**2), jnp.sum(residual**2)
    bend = square + jnp.sum(residual * tangent * (reach - 1.0))
    bend = bend - sum(((2.0 * a + v) * v for a, v in zip(along, projected, strict=True)), jnp.zeros(()))
    never_negative = jnp.maximum(square, _LEAST_CURVATURE * jnp.sum(tangent**2))
    exact = bend > _LEAST_NEWTON * never_negative
    derivatives = Derivatives(jnp.sum(residual * across), jnp.where(exact, bend, never_negative), exact)
    tangents = {i: columns[i] for i in names} | {BETA: tangent / beta}
    return 0.5 * rss, derivatives, Optimum(value.at[BETA].set(beta), rss, tangents)


def solve(
    profile: Profile,
    log_beta: Float[Array, ""],
    wanted: Bool[Array, ""],
    free: tuple[int, ...],
    tolerance: float,
    max_steps: int,
) -> optx.Solution:
    """Return the optimum over log beta from a start; the start itself, not evaluated, if it is not wanted."""
    low, high = jnp.log(jnp.stack(ends(profile)))

    def half_rss(log_beta: Float[Array, ""], _: None) -> tuple[Float[Array, ""], Derivatives]:
        return profile_at(profile, jnp.exp(log_beta), free)[:2]

    solver = ScalarNewton(
        low=low, high=high, rtol=tolerance, atol=tolerance, ftol=0.01 * profile.rounding, wanted=wanted
    )
    start = jnp.clip(log_beta, low, high)
    return optx.minimise(half_rss, solver, start, has_aux=True, max_steps=max_steps, throw=False)
