"""Least squares of Fancher's law on the readings of a slow cycle of load, vectorised over cycles.

Between readings the displacement is monotone, so that the small-step limit is exact over each step. With x the
friction and s the direction, force less k d + C settles on s (x - k beta), and before that is (x - k beta) w(d; beta),
where w is the same law with k = C = 0 and x = 1. So k, C and x - k beta are linear, and x > k beta is the bound
x - k beta >= 0. Readings much further apart than beta do not depend on it: w is +-1, and x is not identified.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from bayes_tyre.inference.least_squares.bounded_levenberg_marquardt import BoxLevenbergMarquardt
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.loop_energy import dissipated_energy_per_cycle

MAX_STEPS, TOLERANCE = 256, 1e-11
#: Least noise of a reading over the change of force; also the rounding of equal displacements, over the travel.
ROUNDING = 1e-12
RIDGE = 1e-14
#: Fewest readings within 2 beta of a reversal that determine beta.
FEWEST_LAGGING = 2

Theta = Float[Array, "4"]
"""k (kN/mm), C (kN), x - k beta (kN) and the logarithm of beta (mm)."""


class Cycle(NamedTuple):
    """Readings of a slow cycle; a leading axis batches it.

    Attributes
    ----------
    d, F:
        Displacement, mm, and force, kN, in measured order, shape (readings,); padding repeats the last.
    used:
        Shape (readings,); False on padding.
    start:
        1 if the first reading was reached by loading, -1 by unloading, from further away than beta, so that its force
        is settled.
    betas:
        Grid of betas, mm, ascending, shape (betas,); all equal where beta is known.
    rise:
        Rise of the residual sum of squares within a 95 % interval of one parameter, over the variance of a reading:
        the quantile of F(1, degrees of freedom).
    refuted:
        The same for an interval of 99.9 %: beta counts as determined where the least beta fits worse by this, because
        an error of beta is also one of x.
    """

    d: Float[Array, "*tests readings"]
    F: Float[Array, "*tests readings"]
    used: Bool[Array, "*tests readings"]
    start: Float[Array, "*tests"]
    betas: Float[Array, "*tests betas"]
    rise: Float[Array, "*tests"]
    refuted: Float[Array, "*tests"]


class CycleEstimate(NamedTuple):
    """The least-squares estimate of a cycle; a leading axis batches it.

    Attributes
    ----------
    value, standard_error:
        Shape (4,): k (kN/mm), C (kN), x - k beta (kN), beta (mm). The error is NaN for a beta that is known
        or bounded to one side only (the others are then conditional on the least beta of the grid, or on the best), and
        for x - k beta at its bound 0.
    x, x_se:
        Friction, kN; the error is NaN where beta is not determined.
    energy, energy_se:
        Dissipated a cycle over the stroke of the readings, J.
    x_range, beta_range:
        Shape (2,): the least and greatest values within 95 % by the profile over beta, kN and mm; x with the error of
        x - k beta added; the greatest beta is infinite where the greatest of the grid is within.
    rss:
        Residual sum of squares, kN^2.
    open_below, open_above:
        Whether the least beta of the grid is within 99.9 %, the greatest within 95 %; below also where fewer than two
        readings lie within 2 beta of a reversal.
    converged:
        False where the solver ran out of steps or met values that are not finite.
    """

    value: Float[Array, "*tests 4"]
    standard_error: Float[Array, "*tests 4"]
    x: Float[Array, "*tests"]
    x_se: Float[Array, "*tests"]
    energy: Float[Array, "*tests"]
    energy_se: Float[Array, "*tests"]
    x_range: Float[Array, "*tests 2"]
    beta_range: Float[Array, "*tests 2"]
    rss: Float[Array, "*tests"]
    open_below: Bool[Array, "*tests"]
    open_above: Bool[Array, "*tests"]
    converged: Bool[Array, "*tests"]


class _Scaled(NamedTuple):
    """A cycle about its centre, in units of its travel and its change of force."""

    cycle: Cycle
    travel: Float[Array, ""]
    span: Float[Array, ""]
    to_given: Float[Array, "4 4"]
    level: Float[Array, ""]

    def residual(self, unknown: Float[Array, "4"]) -> Float[Array, " readings"]:
        """Return law less readings at k, C, x - k beta and log beta, in scaled units."""
        k, C, settled, log_beta = unknown
        law = k * self.cycle.d + C + settled * _shape(self.cycle, jnp.exp(log_beta))
        return jnp.where(self.cycle.used, law - self.cycle.F, 0.0)

    def given(self, unknown: Float[Array, "4"]) -> Float[Array, "4"]:
        """Return k (kN/mm), C (kN), x - k beta (kN) and the logarithm of beta (mm) from scaled units."""
        shift = jnp.stack([jnp.zeros(()), self.level, jnp.zeros(()), jnp.log(self.travel)])
        return self.to_given @ unknown + shift


def _shape(cycle: Cycle, beta: Float[Array, ""]) -> Float[Array, " readings"]:
    """Return w: the force at each reading between the settled curves, -1 and 1."""
    return Fancher(k=0.0, C=0.0, x=1.0, beta=beta).force(cycle.d, cycle.start)


def _lagging(cycle: Cycle, beta: Float[Array, ""]) -> Float[Array, ""]:
    """Return how many readings lie within 2 beta of a reversal, where the force has not settled."""
    move = jnp.diff(cycle.d)
    lag = jnp.abs(_shape(cycle, beta)[1:] - jnp.sign(move))
    # Readings at an equal displacement do not count; compiled, their difference may be rounding instead of 0.
    moves = cycle.used[1:] & (jnp.abs(move) > ROUNDING)
    return jnp.sum(moves & (lag > 2 * jnp.exp(-2.0)), dtype=float)


def _scale_cycle(cycle: Cycle) -> _Scaled:
    def ends(values: Float[Array, " readings"]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        low = jnp.min(jnp.where(cycle.used, values, jnp.inf))
        return low, jnp.max(jnp.where(cycle.used, values, -jnp.inf))

    (nearest, farthest), (least, most) = ends(cycle.d), ends(cycle.F)
    travel, span = farthest - nearest, most - least
    origin, level = (nearest + farthest) / 2, (least + most) / 2
    zero, one = jnp.zeros(()), jnp.ones(())
    to_given = jnp.stack(
        [
            jnp.stack([span / travel, zero, zero, zero]),
            jnp.stack([-span * origin / travel, span, zero, zero]),
            jnp.stack([zero, zero, span, zero]),
            jnp.stack([zero, zero, zero, one]),
        ]
    )
    scaled = cycle._replace(d=(cycle.d - origin) / travel, F=(cycle.F - level) / span, betas=cycle.betas / travel)
    return _Scaled(scaled, travel, span, to_given, level)


def _given_beta(scaled: _Scaled, beta: Float[Array, ""]) -> tuple[Float[Array, "4"], Float[Array, ""]]:
    """Return the best k, C and x - k beta >= 0 at a beta, with its logarithm, and their residual sum of squares."""
    cycle = scaled.cycle
    columns = jnp.stack([cycle.d, jnp.ones_like(cycle.d), _shape(cycle, beta)], axis=1) * cycle.used[:, None]
    F = jnp.where(cycle.used, cycle.F, 0.0)
    # Normal equations are far faster for thousands of small systems, and accurate, because the columns are of order 1
    # and independent. The ridge, far below rounding of the readings, is for paths without a reversal.
    products, projections = columns.T @ columns, columns.T @ F
    products += RIDGE * jnp.sum(cycle.used) * jnp.eye(3)
    free = jnp.linalg.solve(products, projections)
    bound = jnp.append(jnp.linalg.solve(products[:2, :2], projections[:2]), 0.0)
    best = jnp.where(free[2] > 0, free, bound)
    return jnp.append(best, jnp.log(beta)), jnp.sum((columns @ best - F) ** 2)


def _optimum(scaled: _Scaled, start: Float[Array, "4"]) -> tuple[Float[Array, "4"], Bool[Array, ""]]:
    """Return the optimum near the best beta of the grid, and whether the solver converged."""
    ends = jnp.log(scaled.cycle.betas[jnp.array([0, -1])])
    low = jnp.array([-jnp.inf, -jnp.inf, 0.0, 0.0]).at[3].set(ends[0])
    high = jnp.array([jnp.inf, jnp.inf, jnp.inf, 0.0]).at[3].set(ends[1])
    solution = optx.least_squares(
        lambda unknown, _: scaled.residual(unknown),
        BoxLevenbergMarquardt(low=low, high=high, rtol=TOLERANCE, atol=TOLERANCE),
        jnp.clip(start, low, high),
        max_steps=MAX_STEPS,
        throw=False,
    )
    return solution.value, solution.result == optx.RESULTS.successful


class _Open(NamedTuple):
    """Which betas of the grid the readings leave possible, and whether those reach its ends."""

    within: Bool[Array, " grid"]
    below: Bool[Array, ""]
    above: Bool[Array, ""]


def _estimate(cycle: Cycle) -> CycleEstimate:
    scaled = _scale_cycle(cycle)
    on_grid, sums = jax.vmap(lambda beta: _given_beta(scaled, beta))(scaled.cycle.betas)
    best, converged = _optimum(scaled, on_grid[jnp.argmin(sums)])
    rss = jnp.sum(scaled.residual(best) ** 2)
    beta_is_given = cycle.betas[0] == cycle.betas[-1]
    spare = jnp.sum(cycle.used) - jnp.where(beta_is_given, 3, 4)
    variance = jnp.maximum(rss / jnp.maximum(spare, 1), ROUNDING**2)
    left = _left_open(cycle, scaled, best, (sums - jnp.minimum(rss, jnp.min(sums))) / variance)
    # Where no reading identifies beta, rounding and noise would choose it: the least is taken.
    at = jnp.where(left.below, on_grid[0], best)
    determined = ~left.below & ~left.above & ~beta_is_given
    fitted = jnp.stack([jnp.array(True), jnp.array(True), at[2] > 0, determined])
    covariance = _covariance(scaled, at, fitted) * jnp.where(spare > 0, variance, jnp.nan)
    theta = scaled.given(at)
    x, x_se = _with_error(_friction, theta, covariance)
    energy, energy_se = _with_error(lambda theta: _energy(theta, scaled.travel / 2), theta, covariance)
    errors = jnp.where(fitted, jnp.sqrt(jnp.diag(covariance)), jnp.nan)
    beta = jnp.exp(theta[3])
    least, greatest = _ends(scaled, best, rss, cycle.rise * variance, sums)
    ends = jnp.where(left.below, scaled.cycle.betas[0], least), greatest
    margin = jnp.sqrt(cycle.rise) * jnp.nan_to_num(errors[2])
    return CycleEstimate(
        value=theta.at[3].set(beta),
        standard_error=errors.at[3].multiply(beta),
        x=x,
        x_se=jnp.where(fitted[2] & (determined | beta_is_given), x_se, jnp.nan),
        energy=energy,
        energy_se=jnp.where(fitted[2], energy_se, jnp.nan),
        x_range=_friction_range(scaled, on_grid, left.within & ~beta_is_given, ends, x, margin),
        beta_range=scaled.travel * jnp.stack([ends[0], jnp.where(left.above, jnp.inf, greatest)]),
        rss=jnp.sum(scaled.residual(at) ** 2) * scaled.span**2,
        open_below=left.below,
        open_above=left.above,
        converged=converged & jnp.all(jnp.isfinite(theta)) & jnp.isfinite(rss),
    )


def _left_open(cycle: Cycle, scaled: _Scaled, best: Float[Array, "4"], excess: Float[Array, " grid"]) -> _Open:
    """Return what the readings leave open of beta; `excess`: sums of squares above the least, over the variance."""
    within, betas, beta_is_given = excess < cycle.rise, scaled.cycle.betas, cycle.betas[0] == cycle.betas[-1]
    # One reading near a reversal fits some beta whatever its noise: below the spacing there is only an upper bound.
    unidentified = ~beta_is_given & (
        (_lagging(scaled.cycle, jnp.exp(best[3])) < FEWEST_LAGGING) | (excess[0] < cycle.refuted)
    )
    within |= unidentified & (betas <= jnp.max(jnp.where(within, betas, jnp.exp(best[3]))))
    return _Open(within, within[0] & ~beta_is_given, within[-1] & ~beta_is_given)


def _covariance(scaled: _Scaled, at: Float[Array, "4"], fitted: Bool[Array, "4"]) -> Float[Array, "4 4"]:
    """Return the covariance of the unknowns as given for a variance of 1; 0 for what is not fitted."""
    jacobian = jax.jacfwd(scaled.residual)(at) * fitted
    information = jacobian.T @ jacobian + jnp.diag(jnp.where(fitted, 0.0, 1.0))
    covariance = jnp.where(fitted[:, None] & fitted, jnp.linalg.inv(information), 0.0)
    return scaled.to_given @ covariance @ scaled.to_given.T


def _with_error(
    quantity: Callable[[Theta], Float[Array, ""]], theta: Theta, covariance: Float[Array, "4 4"]
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return a quantity of the unknowns and its standard error."""
    value, slope = jax.value_and_grad(quantity)(theta)
    return value, jnp.sqrt(slope @ covariance @ slope)


def _friction_range(
    scaled: _Scaled,
    on_grid: Float[Array, "grid 4"],
    within: Bool[Array, " grid"],
    ends: tuple[Array, Array],
    x: Float[Array, ""],
    margin: Float[Array, ""],
) -> Float[Array, "2"]:
    """Return the least and the greatest friction (kN) of the betas left possible, and of the ends of their range."""
    frictions = jax.vmap(lambda unknown: _friction(scaled.given(unknown)))(on_grid)
    at_ends = [_friction(scaled.given(_given_beta(scaled, end)[0])) for end in ends]
    candidates = jnp.append(within, True), jnp.append(frictions, x)
    low, high = jnp.min(jnp.where(*candidates, jnp.inf)), jnp.max(jnp.where(*candidates, -jnp.inf))
    return jnp.stack([jnp.maximum(jnp.minimum(low, at_ends[0]) - margin, 0.0), jnp.maximum(high, at_ends[1]) + margin])


def _ends(
    scaled: _Scaled,
    best: Float[Array, "4"],
    rss: Float[Array, ""],
    rise: Float[Array, ""],
    sums: Float[Array, " betas"],
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the betas, in scaled units, where the profile has risen by `rise`; the ends of the grid if it has not.

    Between grid points the root of the rise is interpolated linearly over log beta, as near an optimum.
    """
    log_betas = jnp.append(jnp.log(scaled.cycle.betas), best[3])
    order = jnp.argsort(log_betas)
    at = log_betas[order]
    root = jnp.sqrt(jnp.maximum(jnp.append(sums, rss)[order] - rss, 0.0) / rise)
    places = jnp.arange(len(at))
    inner = (jnp.min(jnp.where(root < 1, places, len(at))), jnp.max(jnp.where(root < 1, places, -1)))
    ends = []
    for place, step in zip(inner, (-1, 1), strict=True):
        outer = jnp.clip(place + step, 0, len(at) - 1)
        far = jnp.maximum(root[outer] - root[place], jnp.finfo(float).tiny)
        part = jnp.clip((1.0 - root[place]) / far, 0.0, 1.0)
        ends.append(jnp.exp(at[place] + part * (at[outer] - at[place])))
    return ends[0], ends[1]


def _friction(theta: Theta) -> Float[Array, ""]:
    """Return x, kN."""
    k, _, settled, log_beta = theta
    return settled + k * jnp.exp(log_beta)


def _energy(theta: Theta, amplitude: Float[Array, ""]) -> Float[Array, ""]:
    """Return the energy that the law dissipates a cycle, J."""
    k, _, _, log_beta = theta
    return dissipated_energy_per_cycle(k=k, x=_friction(theta), beta=jnp.exp(log_beta), amplitude=amplitude)


@eqx.filter_jit
def estimate_cycles(cycles: Cycle) -> CycleEstimate:
    """Return the least-squares estimate of each cycle of a batch: a leading axis on every field.

    Source: the small-step limit of Eq. 1 on linear envelopes. k, C and x - k beta >= 0 are solved for at each beta
    of the grid; from the best, bounded Levenberg-Marquardt fits all four. Errors from the Jacobian there
    and RSS / (readings - 4), or - 3 where beta is known.
    """
    return jax.vmap(_estimate)(cycles)
