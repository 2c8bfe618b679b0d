"""Least-squares estimates of Equation 2 with standard errors, vectorised over records; failures are values."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int
from scipy.special import stdtrit

from bayes_tyre.inference.least_squares.beta_grid import grid_minima
from bayes_tyre.inference.least_squares.bounded_levenberg_marquardt import BoxLevenbergMarquardt
from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, C, K
from bayes_tyre.inference.least_squares.scaled_problem import Problem, ScaledProblem, scale_problem
from bayes_tyre.inference.least_squares.small_linear_algebra import r_factor
from bayes_tyre.inference.least_squares.starting_values import solve_linear, starting_values
from bayes_tyre.inference.least_squares.variable_projection import ends, optimum, profile_of, solve

__all__ = ["BETA", "D_I", "F_I", "C", "Estimate", "K", "Problem", "estimate_batch", "estimate_record"]

#: Most steps of a fit, and of a short fit from each tried d_i.
MAX_STEPS, SHORT_STEPS = 512, 32
TOLERANCE = 1e-11
#: Singular values of the column-scaled Jacobian below this, relative to the largest, count as 0.
RANK_TOLERANCE = 1e-7
#: Degrees of freedom up to which quantiles are tabulated; more have the last.
_MOST_FREEDOM = 1000
#: A parameter this near to its bound, in scaled units, is at it; beta, relative to itself.
AT_BOUND = 1e-11


#: Records vectorised in one block: few enough that their working set stays in a core's cache.
BLOCK = 16
_RECORDS = "records"


class Estimate(NamedTuple):
    """The least-squares estimate of a record, with its reliability; a leading axis batches it.

    Attributes
    ----------
    value, standard_error:
        Shape (5,), in the order and units of `PARAMETERS`; the error is NaN where not fitted or at a bound,
        and conditional on those at a bound.
    rss:
        Residual sum of squares, kN^2.
    at_bound:
        Shape (5,); True where the value is one of its bounds.
    undetermined:
        Shape (5,); True where the parameter is in the null space of the Jacobian.
    beta_open_below, beta_open_above:
        True where beta towards zero (infinity) fits no worse: the record gives only a bound. False to a side
        where a bound was given.
    converged:
        False where the solver ran out of steps or met values that are not finite.
    """

    value: Float[Array, "*records 5"]
    standard_error: Float[Array, "*records 5"]
    rss: Float[Array, "*records"]
    at_bound: Bool[Array, "*records 5"]
    undetermined: Bool[Array, "*records 5"]
    beta_open_below: Bool[Array, "*records"]
    beta_open_above: Bool[Array, "*records"]
    converged: Bool[Array, "*records"]


class _Fit(NamedTuple):
    """Parameters in scaled units, the RSS there (infinite if a value is not finite), and whether it is an optimum."""

    value: Float[Array, "5"]
    rss: Float[Array, ""]
    converged: Bool[Array, ""]


def _mask(indices: tuple[int, ...]) -> Bool[Array, "5"]:
    return jnp.array([i in indices for i in range(5)])


def _fit(value: Float[Array, "5"], scaled: ScaledProblem, free: tuple[int, ...], steps: int = MAX_STEPS) -> _Fit:
    """Return the optimum over the free parameters from `value`."""
    index = jnp.array(free)
    two_sided = jnp.isfinite(scaled.low) & jnp.isfinite(scaled.high)
    bends = _mask((K, C)) & ~two_sided
    side = jnp.where(jnp.isfinite(scaled.low), scaled.low, jnp.where(jnp.isfinite(scaled.high), scaled.high, 0.0))
    anchor = jnp.where(bends, side, 0.0)

    # Log beta, because steps in beta would leave its range. k and C less their bound, times the rise at full travel:
    # for beta beyond the travel only k / beta and C / beta are determined. Between two bounds they stay as they are.
    def rise(beta: Float[Array, ""]) -> Float[Array, "5"]:
        return jnp.where(bends, -jnp.expm1(-1.0 / beta), 1.0)

    def to_value(unknown: Float[Array, " free"]) -> Float[Array, "5"]:
        packed = scaled.base.at[index].set(unknown)
        if BETA in free:
            packed = packed.at[BETA].set(jnp.exp(packed[BETA]))
        return jnp.where(_mask(free), anchor + packed / rise(packed[BETA]), scaled.base)

    def to_unknown(value: Float[Array, "5"]) -> Float[Array, " free"]:
        packed = (value - anchor) * rise(value[BETA])
        return packed.at[BETA].set(jnp.log(packed[BETA]))[index]

    ends = jnp.log(jnp.stack(scaled.beta_ends))
    low, high = (
        (bound - anchor).at[BETA].set(end)[index] for bound, end in zip((scaled.low, scaled.high), ends, strict=True)
    )
    solution = optx.least_squares(
        lambda unknown, _: scaled.residual(to_value(unknown)),
        BoxLevenbergMarquardt(low=low, high=high, rtol=TOLERANCE, atol=TOLERANCE),
        jnp.clip(to_unknown(value), low, high),
        max_steps=steps,
        throw=False,
    )
    estimate = to_value(solution.value)
    rss = jnp.sum(scaled.residual(estimate) ** 2)
    finite = jnp.all(jnp.isfinite(estimate)) & jnp.isfinite(rss)
    return _Fit(estimate, jnp.where(finite, rss, jnp.inf), finite & (solution.result == optx.RESULTS.successful))


def _best_fit(starts: Float[Array, "starts 5"], scaled: ScaledProblem, free: tuple[int, ...]) -> _Fit:
    """Return the best of the fits from several starts: of those that converged, if any did."""
    # lax.map, not vmap: memory stays at one batch whatever the number of starts.
    if D_I not in free:
        return _best(jax.lax.map(lambda start: _fit(start, scaled, free), starts))
    # The RSS has a kink where d_i passes a point, near which the solver is slow: short fits choose among the starts.
    short = jax.lax.map(lambda start: _fit(start, scaled, free, SHORT_STEPS), starts)
    fits = [_fit(short.value[jnp.argmin(short.rss)], scaled, free)]
    others = tuple(i for i in free if i != D_I)
    if others:
        # Where a kink is a minimum, the solver stops on the way into it.
        value = fits[0].value
        kink = _nearest_kink(value[D_I], scaled)
        fits.append(_fit(value.at[D_I].set(kink), scaled._replace(base=scaled.base.at[D_I].set(kink)), others))
    return _best(jax.tree.map(lambda *fields: jnp.stack(fields), *fits))


def _nearest_kink(d_i: Float[Array, ""], scaled: ScaledProblem) -> Float[Array, ""]:
    """Return the d_i at a point, nearest to a value and within the bounds."""
    point = scaled.d[jnp.argmin(jnp.where(scaled.used, jnp.abs(scaled.d - d_i), jnp.inf))]
    return jnp.clip(point, scaled.low[D_I], scaled.high[D_I])


def _best(fits: _Fit) -> _Fit:
    """Return the fit of lowest RSS of those that converged, if any did, else of all."""
    sums = jnp.where(fits.converged | ~jnp.any(fits.converged), fits.rss, jnp.inf)
    return jax.tree.map(lambda field: field[jnp.argmin(sums)], fits)


def _errors(
    tangents: list[Float[Array, " points"]], scaled: ScaledProblem, fitted: Bool[Array, "5"], free: tuple[int, ...]
) -> tuple[Float[Array, "5"], Bool[Array, "5"]]:
    """Return standard errors over that of a point, and which parameters are in the null space of the Jacobian.

    `tangents`: derivative of the residuals with respect to each free parameter.
    """
    index = jnp.array(free)
    columns = [jnp.where(fitted[i], tangent, 0.0) for i, tangent in zip(free, tangents, strict=True)]
    size = jnp.stack([jnp.linalg.norm(column) for column in columns])
    scale = jnp.where(size > 0, size, 1.0)
    _, singular, vectors = jnp.linalg.svd(r_factor([column / s for column, s in zip(columns, scale, strict=True)]))
    nonzero = singular > RANK_TOLERANCE * singular[0]
    inverse = jnp.where(nonzero, 1.0 / jnp.where(nonzero, singular, 1.0), 0.0)
    root = jnp.zeros((5, len(free))).at[index].set(vectors.T * inverse / scale[:, None])
    lost = jnp.zeros(5, bool).at[index].set(jnp.max(jnp.abs(vectors) * ~nonzero[:, None], axis=0) > 0.1) & fitted
    # Away from zero displacement C is the line's force less k times the distance: no better known than k.
    lost = lost.at[C].set(lost[C] | (fitted[C] & lost[K] & (scaled.units.origin != 0)))
    return jnp.where(fitted & ~lost, scaled.units.deviations(root), jnp.nan), lost


def _exact_at_bounds(
    value: Float[Array, "5"], at_bound: Bool[Array, "5"], problem: Problem, free: tuple[int, ...]
) -> Float[Array, "5"]:
    """Return the values, those that are fixed or at a bound exactly as given."""
    low, high = problem.bounds
    bound = jnp.where(jnp.abs(value - low) < jnp.abs(value - high), low, high)
    inside = jnp.where(at_bound, bound, jnp.clip(value, low, high))
    return jnp.where(_mask(free), inside, problem.base)


def _f_95(spare: Int[Array, ""]) -> Float[Array, ""]:
    """Return the 95 % quantile of F with 1 and `spare` degrees of freedom.

    beta is unbounded to a side where the profile of the RSS rises by less, over the variance, which is estimated.
    """
    table = stdtrit(np.arange(1, _MOST_FREEDOM + 1), 0.975) ** 2
    return jnp.asarray(table)[jnp.clip(spare, 1, _MOST_FREEDOM) - 1]


class _Solution(NamedTuple):
    """A fit, the derivatives of its residuals by free parameter, and the RSS with beta at either limit."""

    fit: _Fit
    tangents: list[Float[Array, " points"]]
    rss_at_ends: list[Float[Array, ""]]


def _solve_profile(
    given: Float[Array, "starts 5"], scaled: ScaledProblem, free: tuple[int, ...], axis_name: str | None
) -> _Solution:
    """Return the best of the fits from several betas (mm; NaN: estimated from the data), all else being linear."""
    profile = profile_of(scaled)
    at_ends = [optimum(profile, beta, free) for beta in ends(profile)]
    low, second_counts = grid_minima(profile, at_ends[0], free, axis_name)
    log_given = jnp.log((given[:, BETA] - scaled.units.zero[BETA]) / scaled.units.unit[BETA])
    missing = jnp.isnan(log_given)[:, None]
    starts = jnp.where(missing, low, log_given[:, None]).ravel()
    wanted = jnp.where(missing, jnp.stack([jnp.array(True), second_counts]), jnp.array([True, False])).ravel()

    def fit(start: tuple[Float[Array, ""], Bool[Array, ""]]) -> _Fit:
        solution = solve(profile, *start, free, TOLERANCE, MAX_STEPS)
        rss = 2.0 * solution.state.f
        finite = jnp.isfinite(solution.value) & jnp.isfinite(rss)
        value = scaled.base.at[BETA].set(jnp.exp(solution.value))
        return _Fit(value, jnp.where(finite, rss, jnp.inf), finite & (solution.result == optx.RESULTS.successful))

    best = _best(jax.lax.map(fit, (starts, wanted)))
    point = optimum(profile, best.value[BETA], free)
    # Where the RSS is flat down to the least beta, rounding would choose beta: the least is taken.
    flat = at_ends[0].rss <= point.rss + profile.rounding
    point = jax.tree.map(lambda a, b: jnp.where(flat, a, b), at_ends[0], point)
    finite = jnp.all(jnp.isfinite(point.value)) & jnp.isfinite(point.rss)
    result = _Fit(point.value, jnp.where(finite, point.rss, jnp.inf), best.converged & finite)
    return _Solution(result, [point.tangents[i] for i in free], [end.rss for end in at_ends])


def _solve_full(given: Float[Array, "starts 5"], scaled: ScaledProblem, free: tuple[int, ...]) -> _Solution:
    """Return the best of the fits from several starts (kN, mm; NaN: estimated from the data), within bounds."""
    fit = _best_fit(starting_values(given, scaled, free), scaled, free)
    units = jnp.eye(5)
    tangents = [jax.jvp(scaled.residual, (fit.value,), (units[i],))[1] for i in free]
    if BETA not in free:
        return _Solution(fit, tangents, [])
    # Beside a point, a small beta would take it off the start of the curve: d_i is at the point too.
    beside = [fit.value]
    if D_I in free:
        beside.append(fit.value.at[D_I].set(_nearest_kink(fit.value[D_I], scaled)))
    ends = [
        jnp.min(jnp.stack([solve_linear(beta, value, scaled, free)[1] for value in beside]))
        for beta in scaled.beta_ends
    ]
    return _Solution(fit, tangents, ends)


def estimate_record(
    problem: Problem, free: tuple[int, ...], beta_alone: bool = False, axis_name: str | None = None
) -> Estimate:
    """Return the least-squares estimate of one record.

    Parameters
    ----------
    problem:
        The record, without a leading axis.
    free:
        Indices into `PARAMETERS` of those to fit; static.
    beta_alone:
        Whether beta is the only nonlinear free parameter, and none is bounded; static. The optimum is then found by
        variable projection.
    axis_name:
        Name of the `jax.vmap` axis of records, where they are vectorised.

    Source: Equation 2; Newton's method on the profile over log beta, or bounded Levenberg-Marquardt; errors from
    RSS / (points - fitted), where a parameter at its bound is not counted as fitted.
    """
    scaled = scale_problem(problem, free)
    given = problem.start
    solution = _solve_profile(given, scaled, free, axis_name) if beta_alone else _solve_full(given, scaled, free)
    (value, rss, converged), tangents, rss_at_ends = solution
    near = AT_BOUND * jnp.where(_mask((BETA,)), value, 1.0 + jnp.abs(value))
    at_bound = _mask(free) & ((value <= scaled.low + near) | (value >= scaled.high - near))
    fitted = _mask(free) & ~at_bound
    spare = jnp.sum(problem.used) - jnp.sum(fitted)
    # Exact data have no residual: the variance is then that of rounding.
    rounding = 1e-12 * jnp.max(jnp.where(problem.used, jnp.abs(problem.F), 0.0)) / scaled.units.span
    variance = jnp.maximum(rss / jnp.maximum(spare, 1), rounding**2)
    errors, lost = _errors(tangents, scaled, fitted, free)
    below = above = jnp.zeros((), bool)
    if rss_at_ends:
        ends = [at_end - rss < _f_95(spare) * variance for at_end in rss_at_ends]
        below, above = ends[0] & ~(scaled.low[BETA] > 0), ends[1] & ~jnp.isfinite(scaled.high[BETA])
    return Estimate(
        value=_exact_at_bounds(scaled.units.given(value), at_bound, problem, free),
        standard_error=errors * jnp.sqrt(jnp.where(spare > 0, variance, jnp.nan)),
        rss=rss * scaled.units.span**2,
        at_bound=at_bound,
        undetermined=lost,
        beta_open_below=below,
        beta_open_above=above,
        converged=converged,
    )


def estimate_batch(problems: Problem, free: tuple[int, ...]) -> Estimate:
    """Return `estimate_record` of every record of a batch, compiled by number of blocks and free parameters.

    Padded with the last record to whole blocks, because each number of blocks is compiled.
    """
    count = len(problems.d)
    rows = np.minimum(np.arange(count + -count % BLOCK), count - 1)
    padded = jax.tree.map(lambda field: jnp.asarray(np.asarray(field)[rows]), problems)
    estimates = _estimate_blocks(padded, free, _beta_alone(problems, free))
    return jax.tree.map(lambda field: np.asarray(field)[:count], estimates)


def _beta_alone(problems: Problem, free: tuple[int, ...]) -> bool:
    """Return whether beta is the only nonlinear free parameter, another is free, and none is bounded."""
    if BETA not in free or D_I in free or len(free) < 2:
        return False
    return not any(side is not None and np.isfinite(side).any() for side in (problems.low, problems.high))


@eqx.filter_jit
def _estimate_blocks(problems: Problem, free: tuple[int, ...], beta_alone: bool) -> Estimate:
    if not beta_alone:
        return jax.vmap(lambda problem: estimate_record(problem, free))(problems)
    unbounded = Problem(*problems[:5])
    blocks = jax.tree.map(lambda field: field.reshape(-1, BLOCK, *field.shape[1:]), unbounded)
    vectorised = jax.vmap(lambda problem: estimate_record(problem, free, True, _RECORDS), axis_name=_RECORDS)
    estimates = jax.lax.map(vectorised, blocks)
    return jax.tree.map(lambda field: field.reshape(-1, *field.shape[2:]), estimates)
