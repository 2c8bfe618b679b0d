"""Batched Levenberg-Marquardt on Equation 2: all records of a batch in one jit and one vmap, failures as values."""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from bayes_tyre.laws.fancher import equation_2

#: The order of the parameters in every vector here: kN/mm, kN, mm, mm, kN.
PARAMETERS = ("k", "C", "beta", "d_i", "F_i")
K, C, BETA, D_I, F_I = range(5)
#: Equation 2 is linear in these once beta and d_i are known.
LINEAR = (K, C, F_I)

MAX_STEPS = 512
TOLERANCE = 1e-11
#: Singular values of the column-scaled Jacobian below this, relative to the largest, are rank lost.
RANK_TOLERANCE = 1e-7
#: 95 % point of chi-squared with one degree of freedom: a profile that rises less is open to that side.
CHI2_95 = 3.841458820694124
#: Betas tried for a start, over the travel: from far below any spacing of points to almost a straight line.
SCAN_DECADES = (-5.0, 2.0, 57)
#: Beta over the travel beyond which nothing tells betas apart: the fit ends there, and profiles are open or not.
BETA_ENDS = (1e-12, 1e3)


class Problem(NamedTuple):
    """One record and what is known of its parameters; a leading axis batches it.

    Attributes
    ----------
    d, F:
        Displacement (mm) and force (kN), shape (points,).
    used:
        Shape (points,); False on padding.
    fixed:
        Shape (5,), in the order of `PARAMETERS`; NaN where not given (d_i, F_i: the first point). Counts
        where the parameter is not free.
    start:
        Shape (starts, 5); NaN where not given: found from the data. The best of the fits is kept.
    """

    d: Float[Array, "*records points"]
    F: Float[Array, "*records points"]
    used: Bool[Array, "*records points"]
    fixed: Float[Array, "*records 5"]
    start: Float[Array, "*records starts 5"]


class Estimate(NamedTuple):
    """The least-squares estimate of a record, with what it is worth; a leading axis batches it.

    Attributes
    ----------
    value, standard_error:
        Shape (5,), in the order and units of `PARAMETERS`; the error is NaN where not fitted.
    rss:
        Residual sum of squares, kN^2.
    undetermined:
        Shape (5,); True where the Jacobian has lost the parameter.
    beta_open_below, beta_open_above:
        True where beta towards zero (infinity) fits no worse: the record gives only a bound.
    converged:
        False where the solver ran out of steps or met numbers that are not finite.
    """

    value: Float[Array, "*records 5"]
    standard_error: Float[Array, "*records 5"]
    rss: Float[Array, "*records"]
    undetermined: Bool[Array, "*records 5"]
    beta_open_below: Bool[Array, "*records"]
    beta_open_above: Bool[Array, "*records"]
    converged: Bool[Array, "*records"]


class _LevenbergMarquardt(optx.LevenbergMarquardt):
    def __init__(self):
        super().__init__(rtol=TOLERANCE, atol=TOLERANCE)

    def terminate(self, fn, y, args, options, state, tags):
        """Stop also when the step has shrunk to nothing: at an optimum, rounding alone may reject every step."""
        done, result = super().terminate(fn, y, args, options, state, tags)
        return done | (state.search_state.step_size < jnp.finfo(y.dtype).eps), result


def _residual(value: Float[Array, "5"], problem: Problem) -> Float[Array, " points"]:
    force = equation_2(problem.d, k=value[K], C=value[C], beta=value[BETA], d_i=value[D_I], F_i=value[F_I])
    return jnp.where(problem.used, force - problem.F, 0.0)


def _solve_linear(
    beta: Float[Array, ""], base: Float[Array, "5"], problem: Problem, free: tuple[int, ...]
) -> tuple[Float[Array, "5"], Float[Array, ""]]:
    """Return the parameters with the free linear ones at their optimum for this beta, and the RSS there."""
    gone = -jnp.expm1(-jnp.abs(problem.d - base[D_I]) / beta)
    # With C free the line is taken through the first point: far from zero displacement k and C are nearly collinear.
    pivot = problem.d[0] if C in free else jnp.zeros(())
    columns = {K: (problem.d - pivot) * gone, C: gone, F_I: 1.0 - gone}
    unknown = [i for i in LINEAR if i in free]
    value = base.at[BETA].set(beta)
    if unknown:
        known = sum(columns[i] * base[i] for i in LINEAR if i not in free)
        design = jnp.where(problem.used[:, None], jnp.stack([columns[i] for i in unknown], axis=1), 0.0)
        size = jnp.linalg.norm(design, axis=0)
        design = design / jnp.where(size > 0, size, 1.0)
        target = jnp.where(problem.used, problem.F - known, 0.0)
        # The Gram matrix of scaled columns is at most 3 x 3; its pseudo-inverse survives a column that vanishes.
        solution = jnp.linalg.pinv(design.T @ design, rtol=1e-14, hermitian=True) @ (design.T @ target)
        value = value.at[jnp.array(unknown)].set(solution / jnp.where(size > 0, size, 1.0))
        value = value.at[C].add(-value[K] * pivot)
    return value, jnp.sum(_residual(value, problem) ** 2)


def _scales(problem: Problem) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return travel (mm) and force span (kN) of the record, 1 where it has none: the units it is solved in."""
    travel = jnp.max(jnp.where(problem.used, jnp.abs(problem.d - problem.d[0]), 0.0))
    span = jnp.max(jnp.where(problem.used, jnp.abs(problem.F - problem.F[0]), 0.0))
    return jnp.where(travel > 0, travel, 1.0), jnp.where(span > 0, span, 1.0)


def _starts(problem: Problem, base: Float[Array, "5"], free: tuple[int, ...]) -> Float[Array, "starts 5"]:
    """Return starting values: as given, beta from a scan of its profile, the linear ones at their optimum."""
    travel, _ = _scales(problem)
    scanned = base[BETA]
    if BETA in free:
        # lax.map, not vmap: a scan over betas keeps memory at one batch whatever the number tried.
        candidates = travel * jnp.logspace(*SCAN_DECADES)
        rss = jax.lax.map(lambda beta: _solve_linear(beta, base, problem, free)[1], candidates)
        scanned = candidates[jnp.argmin(jnp.where(jnp.isfinite(rss), rss, jnp.inf))]
    is_free = jnp.array([i in free for i in range(5)])

    def complete(start: Float[Array, "5"]) -> Float[Array, "5"]:
        beta = jnp.where(is_free[BETA] & ~jnp.isnan(start[BETA]), start[BETA], scanned)
        value, _ = _solve_linear(beta, base, problem, free)
        return jnp.where(is_free & ~jnp.isnan(start), start, value)

    return jax.vmap(complete)(problem.start)


def _levenberg_marquardt(
    value: Float[Array, "5"], problem: Problem, free: tuple[int, ...]
) -> tuple[Float[Array, "5"], Bool[Array, ""]]:
    """Return the optimum over the free parameters from `value`, and whether the solver got there."""
    travel, span = _scales(problem)
    unit = jnp.stack([span / travel, span, travel, travel, span])
    pivot = problem.d[0] if C in free else jnp.zeros(())
    index = jnp.array(free)

    def reached(value: Float[Array, "5"]) -> Float[Array, ""]:
        return -jnp.expm1(-travel / value[BETA])

    # log beta: raw beta steps negative, and overflows. The line through the first point, times the part of it that
    # is reached at full travel: beyond the travel only k / beta and C / beta are determined.
    def to_unknown(value: Float[Array, "5"]) -> Float[Array, " free"]:
        line = jnp.stack([value[K], value[C] + value[K] * pivot]) * reached(value)
        packed = value.at[jnp.array([K, C])].set(line) / unit
        return packed.at[BETA].set(jnp.log(packed[BETA]))[index]

    def to_value(unknown: Float[Array, " free"]) -> Float[Array, "5"]:
        packed = jnp.zeros(5).at[index].set(unknown)
        packed = packed.at[BETA].set(jnp.exp(jnp.clip(packed[BETA], *map(math.log, BETA_ENDS)))) * unit
        full = value.at[BETA].set(packed[BETA]) if BETA in free else value
        line = packed / reached(full)
        full = full.at[K].set(line[K]) if K in free else full
        full = full.at[C].set(line[C] - full[K] * pivot) if C in free else full
        for i in {D_I, F_I} & set(free):
            full = full.at[i].set(packed[i])
        return full

    solution = optx.least_squares(
        lambda unknown, _: _residual(to_value(unknown), problem) / span,
        _LevenbergMarquardt(),
        to_unknown(value),
        max_steps=MAX_STEPS,
        throw=False,
    )
    found = to_value(solution.value)
    return found, (solution.result == optx.RESULTS.successful) & jnp.all(jnp.isfinite(found))


def _errors(
    value: Float[Array, "5"], problem: Problem, free: tuple[int, ...], variance: Float[Array, ""]
) -> tuple[Float[Array, "5"], Bool[Array, "5"]]:
    """Return standard errors from the Jacobian's inverse Gram matrix, and the parameters lost in its null space."""
    index = jnp.array(free)
    jacobian = jax.jacfwd(_residual)(value, problem)[:, index]
    size = jnp.linalg.norm(jacobian, axis=0)
    _, singular, vectors = jnp.linalg.svd(jacobian / jnp.where(size > 0, size, 1.0), full_matrices=False)
    kept = singular > RANK_TOLERANCE * singular[0]
    inverse = jnp.where(kept, 1.0 / jnp.where(kept, singular, 1.0), 0.0)
    spread = jnp.sqrt(jnp.sum((vectors.T * inverse) ** 2, axis=1)) / jnp.where(size > 0, size, 1.0)
    lost = (jnp.max(jnp.abs(vectors) * ~kept[:, None], axis=0) > 0.1) | (size == 0)
    error = jnp.full(5, jnp.nan).at[index].set(jnp.where(lost, jnp.nan, spread * jnp.sqrt(variance)))
    return error, jnp.zeros(5, bool).at[index].set(lost)


def estimate_record(problem: Problem, free: tuple[int, ...]) -> Estimate:
    """Return the least-squares estimate of one record.

    Parameters
    ----------
    problem:
        The record, without a leading axis.
    free:
        Indices into `PARAMETERS` of those to fit; static.

    Source: Equation 2; Levenberg-Marquardt in log beta (optimistix); errors from RSS / (points - fitted).
    """
    first = jnp.stack([jnp.zeros(()), jnp.zeros(()), jnp.ones(()), problem.d[0], problem.F[0]])
    base = jnp.where(jnp.isnan(problem.fixed), first, problem.fixed)
    values, converged = jax.vmap(lambda start: _levenberg_marquardt(start, problem, free))(_starts(problem, base, free))
    sums = jax.vmap(lambda value: jnp.sum(_residual(value, problem) ** 2))(values)
    converged = converged & jnp.isfinite(sums)
    best = jnp.argmin(jnp.where(converged, sums, jnp.inf))
    value, rss, converged = values[best], sums[best], converged[best]
    spare = jnp.sum(problem.used) - len(free)
    # Exact data have no residual: rounding stands in for the noise, so that profiles compare against something.
    rounding = 1e-12 * jnp.max(jnp.where(problem.used, jnp.abs(problem.F), 0.0))
    variance = jnp.maximum(rss / jnp.maximum(spare, 1), rounding**2)
    error, lost = _errors(value, problem, free, jnp.where(spare > 0, variance, jnp.nan))
    below = above = jnp.zeros((), bool)
    if BETA in free:
        travel, _ = _scales(problem)
        ends = [_solve_linear(factor * travel, value, problem, free)[1] for factor in BETA_ENDS]
        below, above = (end - rss < CHI2_95 * variance for end in ends)
    return Estimate(value, error, rss, lost, below, above, converged)


@eqx.filter_jit
def estimate_batch(problems: Problem, free: tuple[int, ...]) -> Estimate:
    """Return `estimate_record` of every record of a batch, compiled once a shape and set of free parameters."""
    return jax.vmap(lambda problem: estimate_record(problem, free))(problems)
