"""The MAP estimate of a record's motion: tyre, mass, damping and load step, from all three channels."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from bayes_tyre.inference.motion.record.model.forward_model import residuals
from bayes_tyre.inference.motion.record.model.parameters import parameter_names
from bayes_tyre.inference.motion.record.model.runout import ground_start
from bayes_tyre.inference.motion.record.model.second_mode import largest_peak
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.laws.base import ScalarLike
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import Rig

#: Shares of the weights, stage by stage. Thousands of precise readings make the posterior a narrow curved ridge that a
#: solver does not reach from a distant start. With smaller weights the priors dominate, and each stage starts near its
#: own optimum.
WEIGHT_SHARES = (0.003, 0.03, 0.3, 1.0)
#: Most steps of a stage, and of the first stage from each starting point, of which only the best continues.
MAX_STEPS, TRIED_STEPS = 50, 15
#: Tolerances of a step in prior standard deviations, of the last stage and of those before; posterior standard
#: deviations are a thousandth and more.
TOLERANCE, ROUGH_TOLERANCE = 1e-6, 1e-3
#: Rounding may keep the solver from stopping. It has converged where the squared Gauss-Newton step, in posterior
#: standard deviations, is below this.
AT_PEAK = 1e-4
#: A mean square of the residuals above 1 by more than the first, or a lag-1 autocorrelation above the second and what
#: rounding makes of it, indicates a misfit. Of 1100 white residuals a channel standard deviations are 0.04 and 0.03.
MISFIT_MOST, CORRELATION_MOST = 0.3, 0.2
#: Starting values of beta (mm) and of the settled friction x - k beta (kN), all combinations.
START_BETAS_MM, START_SETTLED_KN = (0.05, 0.2), (0.1, 0.3)


class MapEstimate(NamedTuple):
    """The MAP estimate of a record's parameters and its Laplace covariance; a leading axis batches it.

    Attributes
    ----------
    standard:
        Standardised parameters, shape (parameters,).
    covariance:
        Of `standard`, by the Gauss-Newton Hessian, prior included.
    chi_squared:
        Mean square of the residuals of acceleration, laser and load, in their variances, shape (3,).
    correlation:
        Lag-1 autocorrelation of the residuals of each, shape (3,).
    steps:
        Of the last stage.
    ringing_Hz, ringing_power:
        Frequency and power of the largest peak in the spectrum of what is left of the acceleration (`second_mode`).
    converged:
        False where the solver ran out of steps before convergence, or met numbers that are not finite.
    rounding:
        Part of each channel's variance that is rounding which readings share (`Window.rounding`).
    """

    standard: Float[Array, "*records parameters"]
    covariance: Float[Array, "*records parameters parameters"]
    chi_squared: Float[Array, "*records 3"]
    correlation: Float[Array, "*records 3"]
    steps: Int[Array, "*records"]
    ringing_Hz: Float[Array, "*records"]
    ringing_power: Float[Array, "*records"]
    converged: Bool[Array, "*records"]
    rounding: Float[ArrayLike, "*records 3"] = 0.0

    @property
    def misfits(self) -> Bool[Array, "*records 3"]:
        """Whether the residuals of each channel indicate a misfit: more, or more alike, than noise and rounding."""
        squares = jnp.asarray(self.chi_squared)
        alike = squares * (jnp.asarray(self.correlation) - CORRELATION_MOST) > jnp.asarray(self.rounding)
        return (squares > 1 + MISFIT_MOST) | alike


def log_density(window: Window, estimate: MapEstimate) -> float:
    """Return the log of prior times likelihood at an estimate, but for the constants of the window's noise."""
    present = np.sum(np.asarray(window.weight) > 0, axis=1)
    return float(-0.5 * (estimate.chi_squared @ present + estimate.standard @ estimate.standard))


def starting_points(rig: Rig, window: Window) -> Float[np.ndarray, "starts parameters"]:
    """Return starting points of a fit: k from the travel and the change of load, the others from their priors."""
    mean, sd = np.asarray(window.prior)
    names, has_friction = parameter_names(window.law), window.law.has_friction
    start = np.zeros((len(START_BETAS_MM) * len(START_SETTLED_KN) if has_friction else 1, len(mean)))
    present = np.asarray(window.weight)[1] > 0
    laser = np.asarray(window.readings)[1, present]
    travel = float(geometry.wheel_centre_displacement(rig, laser[-len(laser) // 4 :].mean()))
    travel -= float(geometry.wheel_centre_displacement(rig, mean[names.index("laser_at_rest_mm")]))
    before, after = mean[names.index("load_before_kN")], mean[names.index("load_after_kN")]
    force = float(geometry.wheel_centre_force(rig, after - before))
    slope = force / travel if travel != 0 else 0.0
    # Geometry at some 10 mm: what rollers make of the tyre's stiffness differs little about it.
    k = slope / (geometry.curvature_factor(rig) * float(geometry.sin_theta(rig, 10.0)) ** 2)
    start[:, 0] = (np.log(k) - mean[0]) / sd[0] if 0.1 < k < 10 else 0.0
    if has_friction:
        pairs = [(settled, beta) for settled in START_SETTLED_KN for beta in START_BETAS_MM]
        start[:, 1:3] = (np.log(pairs) - mean[1:3]) / sd[1:3]
    if window.rolling is not None:
        end = len(names) + window.rolling.ground_parameters
        of_amplitudes = slice(end - 2 * len(np.asarray(window.rolling.order)), end)
        turn = mean[len(names) + 2 : of_amplitudes.start]
        at_rest = window.in_units(rig, jnp.asarray(start[0]))
        at_wheel_centre = float(jnp.asarray(at_rest.law.k)) * geometry.curvature_factor(rig)
        ground = ground_start(window.rolling, turn, at_wheel_centre, float(at_rest.m_kg), float(at_rest.c_kN_s_per_mm))
        start[:, of_amplitudes] = ground / sd[of_amplitudes]
    return start


@functools.partial(jax.jit, static_argnums=0)
def fit_map(rig: Rig, window: Window, starts: Float[ArrayLike, "starts parameters"]) -> MapEstimate:
    """Return the fit of one record, compiled once for each rig and length of window.

    optimistix's Levenberg-Marquardt with forward derivatives: some steps from each starting point with small weights,
    then stages of growing weights from the best.

    Parameters
    ----------
    rig:
        Geometry; static.
    window:
        Of the record.
    starts:
        Standardised, such as `starting_points`.
    """
    best = _best_start(rig, window, jnp.asarray(starts))
    return _map_estimate(
        window,
        _staged(rig, window, best, WEIGHT_SHARES[1:], (*[ROUGH_TOLERANCE] * len(WEIGHT_SHARES[2:]), TOLERANCE)),
    )


@functools.partial(jax.jit, static_argnums=0)
def rough_map(rig: Rig, window: Window, starts: Float[ArrayLike, "starts parameters"]) -> Float[Array, " parameters"]:
    """Return the parameters before the last stage of a fit; arguments as in `fit_map`."""
    best, eased = _best_start(rig, window, jnp.asarray(starts)), WEIGHT_SHARES[1:-1]
    return _staged(rig, window, best, eased, [ROUGH_TOLERANCE] * len(eased)).standard


@functools.partial(jax.jit, static_argnums=0)
def refine_map(
    rig: Rig,
    window: Window,
    standard: Float[Array, " parameters"],
    tolerance: ScalarLike = TOLERANCE,
    at_peak: ScalarLike = AT_PEAK,
) -> MapEstimate:
    """Return the result of the last stage from a nearby point.

    `tolerance` is in prior standard deviations, `at_peak` in squared posterior ones (`AT_PEAK`).
    """
    return _map_estimate(window, _solve(rig, window, standard, MAX_STEPS, tolerance), at_peak)


class _Solved(NamedTuple):
    """The end point of the solver, with residuals and Jacobian."""

    standard: Float[Array, "*stages parameters"]
    residuals: Float[Array, "*stages residuals"]
    jacobian: Float[Array, "*stages residuals parameters"]
    steps: Int[Array, "*stages"]
    done: Bool[Array, "*stages"]


def _best_start(rig: Rig, window: Window, starts: Float[Array, "starts parameters"]) -> Float[Array, " parameters"]:
    """Return the best end point of some steps from each starting point."""
    tried = jax.vmap(
        lambda start: _solve(rig, _with_weight_share(window, WEIGHT_SHARES[0]), start, TRIED_STEPS, ROUGH_TOLERANCE)
    )(starts)
    objective = jnp.sum(tried.residuals**2, axis=1)
    return tried.standard[jnp.argmin(jnp.where(jnp.isfinite(objective), objective, jnp.inf))]


def _staged(
    rig: Rig,
    window: Window,
    standard: Float[Array, " parameters"],
    shares: Sequence[float],
    tolerances: Sequence[float],
) -> _Solved:
    """Return the end point of successive stages with these shares of the weights."""

    def stage(standard: Array, share_and_tolerance: tuple[Array, Array]) -> tuple[Array, _Solved]:
        share, tolerance = share_and_tolerance
        solved = _solve(rig, _with_weight_share(window, share), standard, MAX_STEPS, tolerance)
        return solved.standard, solved

    _, stages = jax.lax.scan(stage, standard, (jnp.array(shares), jnp.array(tolerances)))
    return jax.tree.map(lambda values: values[-1], stages)


def _map_estimate(window: Window, last: _Solved, at_peak: ScalarLike = AT_PEAK) -> MapEstimate:
    """Return the estimate and its statistics from the end point of the last stage."""
    residual, jacobian = last.residuals, last.jacobian
    finite = jnp.all(jnp.isfinite(residual)) & jnp.all(jnp.isfinite(jacobian))
    # The last rows are the prior's: the matrix has full rank.
    covariance, gradient = jnp.linalg.inv(jacobian.T @ jacobian), jacobian.T @ residual
    near = gradient @ covariance @ gradient < at_peak
    weight = jnp.asarray(window.weight)
    residual = residual[: weight.size].reshape(weight.shape)
    squares = jnp.sum(residual**2, axis=1)
    ringing_Hz, ringing_power = largest_peak(residual[0], window.block_s)
    return MapEstimate(
        standard=last.standard,
        covariance=covariance,
        chi_squared=squares / jnp.sum(weight > 0, axis=1),
        correlation=jnp.sum(residual[:, 1:] * residual[:, :-1], axis=1) / squares,
        steps=last.steps,
        ringing_Hz=ringing_Hz,
        ringing_power=ringing_power,
        converged=(last.done | near) & finite,
        rounding=jnp.asarray(window.rounding),
    )


def _with_weight_share(window: Window, share: ScalarLike) -> Window:
    return window._replace(weight=jnp.asarray(window.weight) * share)


def _solve(rig: Rig, window: Window, start: Float[Array, " parameters"], steps: int, tolerance: Any) -> _Solved:
    """Return the end point of Levenberg-Marquardt.

    Residuals and Jacobian are the solver's own: to evaluate them again would compile the motion once more, which takes
    longer than a fit.
    """
    function = _with_jacobian(rig, window)
    # The prior's rows bound the condition number of J^T J by some 1e9: precise enough, and ten times as fast as QR.
    linear = lx.Normal(lx.Cholesky())
    solver = optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance, linear_solver=linear)
    solution = optx.least_squares(lambda y, _: function(y), solver, start, max_steps=steps, throw=False)
    end, done = solution.state.f_info, solution.result == optx.RESULTS.successful
    return _Solved(solution.value, end.residual, end.jac.as_matrix(), solution.stats["num_steps"], done)


def value_and_jacobian(
    rig: Rig, standard: Float[Array, " parameters"], window: Window
) -> tuple[Float[Array, " residuals"], Float[Array, "residuals parameters"]]:
    """Return `residuals` and their Jacobian, vectorised over directions in one run of the motion."""

    def with_value(standard: Array) -> tuple[Array, Array]:
        residual = residuals(rig, standard, window)
        return residual, residual

    jacobian, residual = jax.jacfwd(with_value, has_aux=True)(standard)
    return residual, jacobian


def _with_jacobian(rig: Rig, window: Window) -> Callable[[Array], Array]:
    """Return the residuals as a function whose derivative is its whole Jacobian.

    A solver that linearises it then gets a matrix, and JAX does not partially evaluate the scan of the motion.
    """

    @jax.custom_jvp
    def function(standard: Array) -> Array:
        return residuals(rig, standard, window)

    @function.defjvp
    def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
        residual, jacobian = value_and_jacobian(rig, primals[0], window)
        return residual, jacobian @ tangents[0]

    return function
