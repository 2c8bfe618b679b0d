"""Levenberg-Marquardt with bounds on the parameters, as an optimistix solver.

Ours because optimistix has no bounded least-squares solver: to clip its steps, or to map the bounds to infinity, stops
short of an optimum at a bound. Each step here minimises the damped quadratic within the bounds. A fit that fails is a
value, as everywhere in optimistix (`throw=False`), so that one record of a vectorised batch does not stop the others.
"""

from collections.abc import Callable
from typing import Any, override

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Bool, Float, PyTree

from bayes_tyre.inference.least_squares.small_linear_algebra import minimise_bounded_quadratic, times

Info = optx.FunctionInfo.EvalGradHessian

#: The trust region grows where the gain is this part of the predicted one (Nocedal and Wright 2006, algorithm 4.1).
#: With optimistix's 0.99 one record in ten takes 144 steps or more, as k and beta are correlated, instead of 18.
_HIGH_CUTOFF = 0.75
#: Part of a sum of squares below which a gain is rounding.
_ROUNDING = 4 * float(jnp.finfo(jnp.float64).eps)


class _State(eqx.Module):
    first_step: Bool[Array, ""]
    y_eval: Float[Array, " n"]
    info: Info
    search: PyTree
    done: Bool[Array, ""]


class BoxLevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt whose steps minimise the damped Gauss-Newton quadratic within [`low`, `high`].

    The iterate stays within the bounds, reaches a bound exactly, and leaves it again where that is better. Only the
    sum of squares, its gradient and J^T J are carried from step to step: a few numbers a problem, which makes a large
    batch fast. J^T J loses digits below 1e-8 of a column's norm. This affects the step alone, not the gradient that is
    zero at the optimum.

    Attributes
    ----------
    low, high:
        Bounds; infinite where there is none.
    rtol, atol:
        A step below these ends the solve, as does one that gains no more than rounding. That step is taken without an
        evaluation: where the sum of squares is flat to rounding, its gradient is still accurate.
    """

    low: Float[Array, " n"]
    high: Float[Array, " n"]
    rtol: float
    atol: float
    norm: Callable[[PyTree], Float[Array, ""]] = optx.max_norm
    search: optx.ClassicalTrustRegion = eqx.field(
        default_factory=lambda: optx.ClassicalTrustRegion(high_cutoff=_HIGH_CUTOFF)
    )

    @override
    def init(self, fn, y, args, options, f_struct, aux_struct, tags) -> _State:
        """Return the state before the first step, which is always accepted and evaluates the start."""
        info = Info(jnp.zeros(()), jnp.zeros_like(y), lx.MatrixLinearOperator(jnp.zeros((y.size, y.size))))
        return _State(jnp.array(True), y, info, self.search.init(y, info), jnp.array(False))

    @override
    def step(self, fn, y, args, options, state: _State, tags) -> tuple[Float[Array, " n"], _State, PyTree]:
        """Evaluate the trial point, move there if it is better, and find the next trial point."""
        trial, aux = _evaluate(fn, state.y_eval, args)
        _, better, _, search = self.search.step(state.first_step, y, state.y_eval, state.info, trial, state.search)
        y, info = _where(better, (state.y_eval, trial), (y, state.info))
        hessian = info.hessian.as_matrix()
        damped = hessian + jnp.eye(y.size) / search.step_size
        best = minimise_bounded_quadratic(damped, info.grad, self.low - y, self.high - y)
        y_eval = jnp.clip(y + best, self.low, self.high)
        move = y_eval - y
        gain = -jnp.sum(move * (info.grad + 0.5 * times(hessian, move)))
        small = self.norm(jnp.abs(move) / (self.atol + self.rtol * jnp.abs(y))) < 1.0
        done = small | (gain <= _ROUNDING * info.f)
        return jnp.where(done, y_eval, y), _State(jnp.array(False), y_eval, info, search, done), aux

    @override
    def terminate(self, fn, y, args, options, state: _State, tags) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Return whether the last step was too small to matter."""
        return state.done, optx.RESULTS.successful

    @override
    def postprocess(self, fn, y, aux, args, options, state, tags, result) -> tuple[PyTree, PyTree, dict[str, Any]]:
        """Return the solution as it is."""
        return y, aux, {}


def _where(condition: Bool[Array, ""], one: PyTree, other: PyTree) -> PyTree:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), one, other)


def _evaluate(fn, y: Float[Array, " n"], args: PyTree) -> tuple[Info, PyTree]:
    """Return half the sum of squares at y, its gradient and its Gauss-Newton Hessian."""
    residual, tangent, aux = jax.linearize(lambda y: fn(y, args), y, has_aux=True)
    columns = jnp.concatenate([jax.vmap(tangent)(jnp.eye(y.size)), residual[None]])
    products = columns @ columns.T
    info = Info(0.5 * products[-1, -1], products[-1, :-1], lx.MatrixLinearOperator(products[:-1, :-1]))
    return info, aux
