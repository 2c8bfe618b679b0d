"""Newton's method for a function of one unknown that knows its derivatives, as an optimistix solver."""

from collections.abc import Callable
from typing import Any, NamedTuple, override

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, PyTree

#: Part of a sum of squares below which a gain cannot be told from rounding.
_ROUNDING = 4 * float(jnp.finfo(jnp.float64).eps)
#: The first step goes no farther than this, and each accepted one lets the next go this many times as far.
_FIRST_REACH, _GROWTH = 1.0, 3.0
#: After a step that ended higher, the next goes no farther than this part of it.
_SHRINK = 0.25
#: How much smaller than the tolerance the next step must promise to be, for the solve to end before it.
_NEXT = 1e-3


class Slope(NamedTuple):
    """What a function tells beside its value, as `aux`.

    Attributes
    ----------
    slope, curvature:
        Its first derivative; its second, or a stand-in for it; above 0.
    exact:
        Whether it is the second.
    """

    slope: Float[Array, ""]
    curvature: Float[Array, ""]
    exact: Bool[Array, ""]


class _State(eqx.Module):
    first_step: Bool[Array, ""]
    y_eval: Float[Array, ""]
    f: Float[Array, ""]
    aux: Slope
    reach: Float[Array, ""]
    done: Bool[Array, ""]


class NewtonOnALine(optx.AbstractMinimiser):
    """Newton's method within [`low`, `high`] for `fn(y, args) -> (value, Slope)`; the value is a sum of squares.

    A step that ends higher is taken back and shortened. The iterate never rises and never leaves the interval.

    Attributes
    ----------
    low, high:
        Ends of the interval.
    rtol, atol:
        A step below these ends the solve, as does one after which the next would be, by the rate at which the last
        ones shrank, or one that gains no more than rounding. That step is taken unjudged: where the sum of squares is
        flat, its derivative still tells the way.
    ftol:
        A gain below this is rounding too: of a sum of squares that may end at zero.
    wanted:
        False ends the solve before it begins, at the start and with the value infinite: of a batch, those that are
        left out.
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
        slope = Slope(nothing, nothing, jnp.array(False))
        return _State(jnp.array(True), y, jnp.asarray(jnp.inf), slope, reach, ~jnp.asarray(self.wanted))

    @override
    def step(self, fn, y, args, options, state: _State, tags) -> tuple[Float[Array, ""], _State, PyTree]:
        """Judge the point tried, move there if it is no higher, and find the next one to try."""
        f_tried, tried = fn(state.y_eval, args)
        better = state.first_step | (f_tried <= state.f)
        went = jnp.abs(state.y_eval - y)
        longer = jnp.where(went >= 0.9 * state.reach, _GROWTH * state.reach, state.reach)
        reach = jnp.where(state.first_step, state.reach, jnp.where(better, longer, _SHRINK * went))
        y, f, aux = jax.tree.map(
            lambda a, b: jnp.where(better, a, b), (state.y_eval, f_tried, tried), (y, state.f, state.aux)
        )
        flat = ~(aux.curvature > 0)
        newton = jnp.where(flat, 0.0, -aux.slope / jnp.where(flat, 1.0, aux.curvature))
        y_eval = jnp.clip(y + jnp.clip(newton, -reach, reach), self.low, self.high)
        move = y_eval - y
        gain = -move * (aux.slope + 0.5 * move * aux.curvature)
        # Newton squares what is off: from |went| to |move|, so from |move| to |move|^3 / |went|^2.
        length, small = jnp.abs(move), self.atol + self.rtol * jnp.abs(y)
        squares = aux.exact & better & ~state.first_step & (length < 0.1 * went)
        done = (
            (length < small) | (squares & (length**3 < _NEXT * small * went**2)) | (gain <= _ROUNDING * f + self.ftol)
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
