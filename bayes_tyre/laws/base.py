"""The contract of a force law: force along a path of displacement, and init/step for laws that carry state."""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

type State = Any
"""The state of a law between two points: a pytree of arrays."""

ScalarLike = Float[ArrayLike, ""]
Path = Float[ArrayLike, " points"]


class Law(eqx.Module):
    """A force law; its parameters are its fields, so a law can be jitted, vmapped and differentiated."""

    @abc.abstractmethod
    def force(self, path: Path, F_start: ScalarLike) -> Float[Array, " points"]:
        """Return the force at every point of the path.

        Parameters
        ----------
        path:
            Displacement in the order in which it is run through, mm, shape (points,).
        F_start:
            Force at ``path[0]``, kN.

        Returns
        -------
        Force, kN, shape (points,); its first value is `F_start`.
        """


class StatefulLaw(Law):
    """A law that goes from point to point, so that an integrator of motion can carry its state along."""

    @abc.abstractmethod
    def init(self, d: ScalarLike, F: ScalarLike) -> State:
        """Return the state at displacement `d`, mm, under force `F`, kN."""

    @abc.abstractmethod
    def step(self, state: State, d: ScalarLike) -> tuple[State, Float[Array, ""]]:
        """Return the state and the force, kN, after a monotone move to displacement `d`, mm.

        No move, no change: a step to the displacement where the state already is returns its force. For a law that
        depends on time the move is quasi-static: all is at rest at its end.
        """

    def step_in(
        self, state: State, d: ScalarLike, dt_s: ScalarLike, rate: ScalarLike
    ) -> tuple[State, Float[Array, ""]]:
        """Return the same after a monotone move to `d`, mm, that takes `dt_s`, s, and ends at the rate `rate`, mm/s.

        Motions move laws by this. For a law that depends on displacement alone this is `step`, whatever the
        time.
        """
        del dt_s, rate
        return self.step(state, d)

    @property
    def carried_kg(self) -> ScalarLike:
        """Mass of its own that the tyre moves along with a slow motion, on flat ground, kg; 0 for most laws."""
        return 0.0

    def check(self) -> None:
        """Refuse parameters, concrete numbers, with which a body moving on the law would gain energy from it.

        Raises
        ------
        ValueError
            If a closed loop of the law makes energy. A law that never does has nothing to refuse.
        """

    def force(self, path: Path, F_start: ScalarLike, dt_s: ScalarLike | None = None) -> Float[Array, " points"]:
        """Return the force, kN, at every point of the path, mm, by stepping along it from `F_start`, kN.

        From point to point it takes `dt_s`, s; None: quasi-static, which differs only for a law that depends on time.
        """
        # A scan's carry keeps its dtype: let path, start and parameters agree on one before it starts.
        numbers = [leaf for leaf in jax.tree.leaves(self) if not callable(leaf)]
        dtype = jnp.result_type(path, F_start, *numbers)
        path = jnp.asarray(path, dtype)
        start = self.init(path[0], jnp.asarray(F_start, dtype))
        if dt_s is None:
            # A plain function, for scan hashes what it is given, and a law with traced fields has no hash.
            return jax.lax.scan(lambda state, d: self.step(state, d), start, path)[1]
        times = jnp.full(len(path), dt_s, dtype).at[0].set(0.0)
        rates = (_differences(path) / dt_s).astype(dtype)
        return jax.lax.scan(lambda state, move: self.step_in(state, *move), start, (path, times, rates))[1]


def _differences(path: Float[Array, " points"]) -> Float[Array, " points"]:
    """Return the slope at every point from a rest at the first: that of the parabola through the nearest three."""
    first, rise = jnp.zeros_like(path[:1]), jnp.diff(path)
    if len(path) < 3:
        return jnp.concatenate([first, rise])
    return jnp.concatenate([first, (rise[1:] + rise[:-1]) / 2, (3 * rise[-1:] - rise[-2:-1]) / 2])
