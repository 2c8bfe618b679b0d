"""Newton's method within an interval for a sum of squares of one unknown, as an optimistix solver.

Ours because the function gives its exact first and second derivative in the same pass over the points as its value;
optimistix's minimisers would differentiate it again, or ignore the curvature.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, override

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, PyTree

#: Part of a sum of squares below which a gain is rounding.
_ROUNDING = 4 * float(jnp.finfo(jnp.float64).eps)
#: Largest first step, and by how much the step limit grows after an accepted step of that length.
_FIRST_REACH, _GROWTH = 1.0, 3.0
#: After a rejected step the limit is this part of it.
_SHRINK = 0.25
#: The solve ends early where the predicted next step is below this part of the tolerance.
_NEXT = 1e-3


class Derivatives(NamedTuple):
    """First and second derivative of a function, returned as `aux`.

    Attributes
    ----------
    slope, curvature:
        The first derivative; the second, or a positive approximation of it.
    exact:
        Whether the curvature is the second derivative.
    """

    slope: Float[Array, ""]
    curvature: Float[Array, ""]
    exact: Bool[Array, ""]


class _State(eqx.Module):
    first_step: Bool[Array, ""]
    y_eval: Float[Array, ""]
    f: Float[Array, ""]
    aux: Derivatives
    reach: Float[Array, ""]
    done: Bool[Array, ""]


class ScalarNewton(optx.AbstractMinimiser):
    """Newton's method within [`low`, `high`] for `fn(y, args) -> (value, Derivatives)`; the value is a sum of squares.

    A step that raises the value is rejected and shortened. The iterate never leaves the interval.

    Attributes
    ----------
    low, high:
        Ends of the interval.
    rtol, atol:
        A step below these ends the solve, as does one after which quadratic convergence predicts a step below them, or
        one that gains no more than rounding. That step is taken without an evaluation: where the sum of squares is
        flat to rounding, its derivative is still accurate.
    ftol:
        A gain below this is rounding too, for a sum of squares that may be zero at the optimum.
    wanted:
        False ends the solve at the start, with an infinite value: for members of a batch that need no solve.
    """

    low: Float[Array, ""]
    high: Float[Array, ""]
    rtol: float
    atol: float
    ftol: Float[Array, ""]
    wanted: Bool[Array, ""] = eqx.field(default_factory=lambda: jnp.array(True))
    norm: Callable[[PyTree], Float[Array, ""]] = optx.max_norm

    @override
    def init(self, fn, y, args, options, f_struct, aux_struct, tags) -> _State:
        """Return the state before the first step, which is always accepted and evaluates the start."""
        nothing, reach = jnp.zeros(()), jnp.asarray(_FIRST_REACH)
        derivatives = Derivatives(nothing, nothing, jnp.array(False))
        return _State(jnp.array(True), y, jnp.asarray(jnp.inf), derivatives, reach, ~jnp.asarray(self.wanted))

    @override
    def step(self, fn, y, args, options, state: _State, tags) -> tuple[Float[Array, ""], _State, PyTree]:
        """Evaluate the trial point, move there if it is no higher, and find the next trial point."""
        f_trial, trial = fn(state.y_eval, args)
        better = state.first_step | (f_trial <= state.f)
        went = jnp.abs(state.y_eval - y)
        longer = jnp.where(went >= 0.9 * state.reach, _GROWTH * state.reach, state.reach)
        reach = jnp.where(state.first_step, state.reach, jnp.where(better, longer, _SHRINK * went))
        y, f, aux = jax.tree.map(
            lambda a, b: jnp.where(better, a, b), (state.y_eval, f_trial, trial), (y, state.f, state.aux)
        )
        flat = ~(aux.curvature > 0)
        newton = jnp.where(flat, 0.0, -aux.slope / jnp.where(flat, 1.0, aux.curvature))
        y_eval = jnp.clip(y + jnp.clip(newton, -reach, reach), self.low, self.high)
        move = y_eval - y
        gain = -move * (aux.slope + 0.5 * move * aux.curvature)
        # Quadratic convergence from |went| to |move| predicts |move|^3 / |went|^2 for the next step.
        length, small = jnp.abs(move), self.atol + self.rtol * jnp.abs(y)
        quadratic = aux.exact & better & ~state.first_step & (length < 0.1 * went)
        done = (
            (length < small) | (quadratic & (length**3 < _NEXT * small * went**2)) | (gain <= _ROUNDING * f + self.ftol)
        )
        state = _State(jnp.array(False), y_eval, f, aux, reach, done)
        return jnp.where(done, y_eval, y), state, aux

    @override
    def terminate(self, fn, y, args, options, state: _State, tags) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Return whether the last step was too small to matter."""
        return state.done, optx.RESULTS.successful

    @override
    def postprocess(self, fn, y, aux, args, options, state, tags, result) -> tuple[PyTree, PyTree, dict[str, Any]]:
        """Return the solution as it is."""
        return y, aux, {}
