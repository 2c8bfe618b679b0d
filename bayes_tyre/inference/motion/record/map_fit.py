"""The motion of a record fitted: tyre, mass, damping and the load's step, from all three channels at once."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from bayes_tyre.inference.motion.record.forward_model import residuals
from bayes_tyre.inference.motion.record.parameters import in_units, names_of
from bayes_tyre.inference.motion.record.runout import ground_start
from bayes_tyre.inference.motion.record.window import Window
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig

#: Weights are eased to these shares, one after the other. Thousands of readings to a part in a thousand leave a valley
#: so steep and bent that a start beside it does not get in; with larger errors allowed the priors hold what the
#: readings do not need, and each stage begins near its end.
EASED = (0.003, 0.03, 0.3, 1.0)
#: Most steps of a stage, and of the first from each start, of which only the best goes on.
MAX_STEPS, TRIED_STEPS = 50, 15
#: Of a step in prior standard deviations; those of posteriors are a thousandth and more. Of the stages before the last.
TOLERANCE, ROUGH = 1e-6, 1e-3
#: Where the solver sees only rounding it may not stop by itself: it is there when Gauss-Newton's step is shorter than a
#: hundredth of the posterior's standard deviations, squared.
AT_PEAK = 1e-4
#: Betas (mm) and settled friction x - k beta (kN) that a fit starts from, each with each.
START_BETAS_MM, START_SETTLED_KN = (0.05, 0.2), (0.1, 0.3)


class Found(NamedTuple):
    """The most probable unknowns of a record and their Laplace covariance; a leading axis batches it.

    Attributes
    ----------
    standard:
        Shape (unknowns,), in standard deviations from their prior's locations.
    covariance:
        Of `standard`, by the Gauss-Newton Hessian: the prior is in it.
    chi_squared:
        Mean square of the residuals of acceleration, laser and load, in their variances, shape (3,).
    correlation:
        Lag-1 autocorrelation of the residuals of each, shape (3,).
    steps:
        That the last stage took.
    converged:
        False where the solver ran out of steps away from the peak, or met numbers that are not finite.
    """

    standard: Float[Array, "*records unknowns"]
    covariance: Float[Array, "*records unknowns unknowns"]
    chi_squared: Float[Array, "*records 3"]
    correlation: Float[Array, "*records 3"]
    steps: Int[Array, "*records"]
    converged: Bool[Array, "*records"]


def starts_of(rig: Rig, window: Window) -> Float[np.ndarray, "starts unknowns"]:
    """Return the unknowns that a fit starts from: k from the travel and the change of load, the rest before known."""
    location, scale = np.asarray(window.prior)
    names, by_friction = names_of(window.law), window.law.has_friction
    start = np.zeros((len(START_BETAS_MM) * len(START_SETTLED_KN) if by_friction else 1, len(location)))
    present = np.asarray(window.weight)[1] > 0
    laser = np.asarray(window.readings)[1, present]
    travel = float(geometry.wheel_centre_displacement(rig, laser[-len(laser) // 4 :].mean()))
    travel -= float(geometry.wheel_centre_displacement(rig, location[names.index("laser_at_rest_mm")]))
    before, after = location[names.index("load_before_kN")], location[names.index("load_after_kN")]
    force = float(geometry.wheel_centre_force(rig, after - before))
    slope = force / travel if travel != 0 else 0.0
    # Geometry at some 10 mm: what rollers make of the tyre's stiffness differs little about it.
    k = slope / (geometry.curvature_factor(rig) * float(geometry.sin_theta(rig, 10.0)) ** 2)
    start[:, 0] = (np.log(k) - location[0]) / scale[0] if 0.1 < k < 10 else 0.0
    if by_friction:
        pairs = [(settled, beta) for settled in START_SETTLED_KN for beta in START_BETAS_MM]
        start[:, 1:3] = (np.log(pairs) - location[1:3]) / scale[1:3]
    if window.rolling is not None:
        amplitudes = 2 * len(np.asarray(window.rolling.order))
        turn = location[len(names) + 2 : -amplitudes]
        at_rest = in_units(rig, jnp.asarray(start[0]), window.prior, window.rolling, window.law)
        at_wheel_centre = float(jnp.asarray(at_rest.law.k)) * geometry.curvature_factor(rig)
        ground = ground_start(window.rolling, turn, at_wheel_centre, float(at_rest.m_kg), float(at_rest.c_kN_s_per_mm))
        start[:, -amplitudes:] = ground / scale[-amplitudes:]
    return start


@functools.partial(jax.jit, static_argnums=0)
def find(rig: Rig, window: Window, starts: Float[ArrayLike, "starts unknowns"]) -> Found:
    """Return the fit of one record, compiled once a rig and length of window.

    optimistix's Levenberg-Marquardt by forward derivatives: some steps from each start with eased weights, then on
    from the lowest with weights that tighten.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    starts:
        In standard deviations, such as `starts_of`.
    """
    best = _best_start(rig, window, jnp.asarray(starts))
    return _judged(window, _tightened(rig, window, best, EASED[1:], (*[ROUGH] * len(EASED[2:]), TOLERANCE)))


@functools.partial(jax.jit, static_argnums=0)
def approach(rig: Rig, window: Window, starts: Float[ArrayLike, "starts unknowns"]) -> Float[Array, " unknowns"]:
    """Return where a fit is before its last stage; arguments as in `find`."""
    best, eased = _best_start(rig, window, jnp.asarray(starts)), EASED[1:-1]
    return _tightened(rig, window, best, eased, [ROUGH] * len(eased)).standard


@functools.partial(jax.jit, static_argnums=0)
def settle(rig: Rig, window: Window, standard: Float[Array, " unknowns"], tolerance: ScalarLike = TOLERANCE) -> Found:
    """Return what the last stage finds, from unknowns that are near; `tolerance` in prior standard deviations."""
    return _judged(window, _solve(rig, window, standard, MAX_STEPS, tolerance))


class _Solved(NamedTuple):
    """Where the solver is at its end, and what it knows there."""

    standard: Float[Array, "*stages unknowns"]
    residuals: Float[Array, "*stages residuals"]
    jacobian: Float[Array, "*stages residuals unknowns"]
    steps: Int[Array, "*stages"]
    done: Bool[Array, "*stages"]


def _best_start(rig: Rig, window: Window, starts: Float[Array, "starts unknowns"]) -> Float[Array, " unknowns"]:
    """Return the lowest of where some steps from each start lead."""
    tried = jax.vmap(lambda start: _solve(rig, _eased(window, EASED[0]), start, TRIED_STEPS, ROUGH))(starts)
    height = jnp.sum(tried.residuals**2, axis=1)
    return tried.standard[jnp.argmin(jnp.where(jnp.isfinite(height), height, jnp.inf))]


def _tightened(
    rig: Rig, window: Window, standard: Float[Array, " unknowns"], shares: Sequence[float], tolerances: Sequence[float]
) -> _Solved:
    """Return the end of stages with so large shares of the weights, one after the other."""

    def stage(standard: Array, share_and_tolerance: tuple[Array, Array]) -> tuple[Array, _Solved]:
        share, tolerance = share_and_tolerance
        solved = _solve(rig, _eased(window, share), standard, MAX_STEPS, tolerance)
        return solved.standard, solved

    _, stages = jax.lax.scan(stage, standard, (jnp.array(shares), jnp.array(tolerances)))
    return jax.tree.map(lambda values: values[-1], stages)


def _judged(window: Window, last: _Solved) -> Found:
    """Return what the end of the last stage says of the unknowns and of the fit."""
    off, jacobian = last.residuals, last.jacobian
    finite = jnp.all(jnp.isfinite(off)) & jnp.all(jnp.isfinite(jacobian))
    # The prior stands in its last rows: all directions have some information.
    covariance, gradient = jnp.linalg.inv(jacobian.T @ jacobian), jacobian.T @ off
    at_peak = gradient @ covariance @ gradient < AT_PEAK
    weight = jnp.asarray(window.weight)
    off = off[: weight.size].reshape(weight.shape)
    squares = jnp.sum(off**2, axis=1)
    return Found(
        standard=last.standard,
        covariance=covariance,
        chi_squared=squares / jnp.sum(weight > 0, axis=1),
        correlation=jnp.sum(off[:, 1:] * off[:, :-1], axis=1) / squares,
        steps=last.steps,
        converged=(last.done | at_peak) & finite,
    )


def _eased(window: Window, share: ScalarLike) -> Window:
    return window._replace(weight=jnp.asarray(window.weight) * share)


def _solve(rig: Rig, window: Window, start: Float[Array, " unknowns"], steps: int, tolerance: Any) -> _Solved:
    """Return the end of Levenberg-Marquardt.

    Residuals and Jacobian there are the solver's own: worked out anew they would be one more program of the motion to
    compile, and that takes longer than any fit.
    """
    function = _with_jacobian(rig, window)
    # The prior's rows keep the condition of J^T J to some 1e9: exact enough, and a tenth of the time that QR takes.
    linear = lx.Normal(lx.Cholesky())
    solver = optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance, linear_solver=linear)
    solution = optx.least_squares(lambda y, _: function(y), solver, start, max_steps=steps, throw=False)
    there, done = solution.state.f_info, solution.result == optx.RESULTS.successful
    return _Solved(solution.value, there.residual, there.jac.as_matrix(), solution.stats["num_steps"], done)


def value_and_jacobian(
    rig: Rig, standard: Float[Array, " unknowns"], window: Window
) -> tuple[Float[Array, " residuals"], Float[Array, "residuals unknowns"]]:
    """Return `residuals` and their derivative, all directions side by side through one run of the motion."""

    def twice(standard: Array) -> tuple[Array, Array]:
        off = residuals(rig, standard, window)
        return off, off

    jacobian, off = jax.jacfwd(twice, has_aux=True)(standard)
    return off, jacobian


def _with_jacobian(rig: Rig, window: Window) -> Callable[[Array], Array]:
    """Return the residuals as a function that brings its whole Jacobian along.

    A solver that linearises it then finds a matrix, and the scan of the motion is not taken apart into what is linear
    and what is not.
    """

    @jax.custom_jvp
    def function(standard: Array) -> Array:
        return residuals(rig, standard, window)

    @function.defjvp
    def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
        off, jacobian = value_and_jacobian(rig, primals[0], window)
        return off, jacobian @ tangents[0]

    return function
