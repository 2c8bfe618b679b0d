"""Equation 2 in log beta alone: for each beta the force is linear in k, C and F_i, which are put at their optimum.

Variable projection (Golub and Pereyra 1973). One unknown is left, so that few passes over the points fit a record.
"""

from typing import NamedTuple

import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, C, K
from bayes_tyre.inference.least_squares.scalar_newton import NewtonOnALine, Slope
from bayes_tyre.inference.least_squares.scaled_problem import OwnProblem
from bayes_tyre.inference.least_squares.small_linear_algebra import orthogonalised, solve_forward, solve_upper
from bayes_tyre.inference.least_squares.starting_values import LINEAR

#: Residuals below this part of the forces are rounding.
_EXACT = 1e-14
#: exp(-|d - d_i| / beta) of the point next to d_i is below rounding where beta is this part of that distance: no
#: smaller beta changes a force.
_NEXT_TO_NOTHING = 1 / 40
#: Newton's curvature is taken where it is at least this part of Gauss and Newton's, which is never negative.
_LEAST_NEWTON = 0.1
#: A curvature below this part of the tangent's square is rounding.
_LEAST_CURVATURE = 1e-26


class Profile(NamedTuple):
    """A record as its profile needs it, in own units.

    Attributes
    ----------
    own:
        The record.
    distance:
        Shape (points,): |d - d_i|; 0 on padding.
    one, d, F:
        Shape (points,): 1, displacement and force; 0 on padding.
    rounding:
        Sum of squares of residuals that are rounding.
    """

    own: OwnProblem
    distance: Float[Array, " points"]
    one: Float[Array, " points"]
    d: Float[Array, " points"]
    F: Float[Array, " points"]
    rounding: Float[Array, ""]

    def columns(self, gone: Float[Array, " points"]) -> dict[int, Float[Array, " points"]]:
        """Return the derivative of the force with respect to each linear parameter; `gone`: 1 - exp(-reach)."""
        return {K: self.d * gone, C: gone, F_I: self.one - gone}

    def offset(self, columns: dict[int, Float[Array, " points"]], free: tuple[int, ...]) -> Float[Array, " points"]:
        """Return the force less what the linear parameters that are not free make of it."""
        return self.F - sum((columns[i] * self.own.base[i] for i in LINEAR if i not in free), jnp.zeros(()))


def profile_of(own: OwnProblem) -> Profile:
    """Return a record as its profile needs it."""
    distance, one, d, F = (
        jnp.where(own.used, row, 0.0) for row in (jnp.abs(own.d - own.base[D_I]), jnp.ones_like(own.d), own.d, own.F)
    )
    return Profile(own, distance, one, d, F, _EXACT**2 * jnp.sum(F**2))


def ends(profile: Profile) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the least and the largest beta worth a look: the record's own ends, but no beta too small to be seen."""
    low, high = profile.own.beta_ends
    nearest = jnp.min(jnp.where(profile.distance > 0, profile.distance, jnp.inf))
    return jnp.clip(_NEXT_TO_NOTHING * nearest, low, high), high


class Optimum(NamedTuple):
    """The best fit for one beta, in own units.

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


class Point(NamedTuple):
    """The profile at one beta, in own units.

    Attributes
    ----------
    rss, slope, curvature:
        Sum of squares of the residuals; half its first derivative in log beta, and half its second, or what Gauss
        and Newton take for it where the second is negative or nearly so.
    exact:
        Whether it is the second.
    """

    rss: Float[Array, ""]
    slope: Float[Array, ""]
    curvature: Float[Array, ""]
    exact: Bool[Array, ""]


def at(profile: Profile, log_beta: Float[Array, ""], free: tuple[int, ...]) -> Point:
    """Return the profile at a beta, with its derivatives."""
    return _at(profile, jnp.exp(log_beta), free)[0]


def optimum(profile: Profile, beta: Float[Array, ""], free: tuple[int, ...]) -> Optimum:
    """Return the best fit for a beta."""
    return _at(profile, beta, free)[1]


def _at(profile: Profile, beta: Float[Array, ""], free: tuple[int, ...]) -> tuple[Point, Optimum]:
    """Return the profile and the best fit at a beta.

    Through an orthogonal basis of the columns: inner products of the columns themselves would lose twice the digits,
    and with them the fits of records that are almost without noise.
    """
    reach = profile.distance / beta
    gone = -jnp.expm1(-reach)
    columns = profile.columns(gone)
    names = [i for i in LINEAR if i in free]
    basis = orthogonalised([*(columns[i] for i in names), profile.offset(columns, free)])
    residual = -basis.rest[-1]
    upper = [row[:-1] for row in basis.rows[:-1]]
    value = profile.own.base.at[jnp.array(names)].set(solve_upper(upper, [row[-1] for row in basis.rows[:-1]]))

    change = reach * (profile.one - gone)
    over = value[F_I] * profile.one - value[K] * profile.d - value[C] * profile.one
    tangent = over * change
    along, across = [], tangent
    for i in range(len(names)):
        part, across = basis.split(i, across)
        along.append(part)
    changes = {K: -profile.d * change, C: -change, F_I: change}
    turned = solve_forward(upper, [jnp.sum(changes[i] * residual) for i in names])
    square, rss = jnp.sum(across**2), jnp.sum(residual**2)
    bend = square + jnp.sum(residual * tangent * (reach - 1.0))
    bend = bend - sum(((2.0 * a + v) * v for a, v in zip(along, turned, strict=True)), jnp.zeros(()))
    never_negative = jnp.maximum(square, _LEAST_CURVATURE * jnp.sum(tangent**2))
    exact = bend > _LEAST_NEWTON * never_negative
    point = Point(rss, jnp.sum(residual * across), jnp.where(exact, bend, never_negative), exact)
    tangents = {i: columns[i] for i in names} | {BETA: tangent / beta}
    return point, Optimum(value.at[BETA].set(beta), rss, tangents)


def solve(
    profile: Profile,
    log_beta: Float[Array, ""],
    wanted: Bool[Array, ""],
    free: tuple[int, ...],
    tolerance: float,
    max_steps: int,
) -> optx.Solution:
    """Return the optimum over log beta from a start; if it is not wanted, at once, and nothing was looked at."""
    low, high = jnp.log(jnp.stack(ends(profile)))

    def half_rss(log_beta: Float[Array, ""], _: None) -> tuple[Float[Array, ""], Slope]:
        point = at(profile, log_beta, free)
        return 0.5 * point.rss, Slope(point.slope, point.curvature, point.exact)

    solver = NewtonOnALine(
        low=low, high=high, rtol=tolerance, atol=tolerance, ftol=0.01 * profile.rounding, wanted=wanted
    )
    start = jnp.clip(log_beta, low, high)
    return optx.minimise(half_rss, solver, start, has_aux=True, max_steps=max_steps, throw=False)
