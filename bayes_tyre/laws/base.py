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
Point = tuple[ScalarLike, ScalarLike]
"""State of a law that remembers nothing but where it is: displacement, mm, and force, kN."""
Path = Float[ArrayLike, " points"]


class StatefulLaw(eqx.Module):
    """A force law that goes from point to point, so that an integrator of motion can carry its state along.

    Its parameters are its fields, so a law can be jitted, vmapped and differentiated.
    """

    def init(self, d: ScalarLike, F: ScalarLike) -> State:
        """Return the state at displacement `d`, mm, under force `F`, kN: a `Point`, unless the law remembers more."""
        return d, F

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

    def force(self, path: Path, F_start: ScalarLike) -> Float[Array, " points"]:
        """Return the force at every point of the path, by stepping along it; quasi-static where a law depends on time.

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
        # A scan's carry keeps its dtype: let path, start and parameters agree on one before it starts.
        numbers = [leaf for leaf in jax.tree.leaves(self) if not callable(leaf)]
        dtype = jnp.result_type(path, F_start, *numbers)
        path = jnp.asarray(path, dtype)
        start = self.init(path[0], jnp.asarray(F_start, dtype))
        # A plain function, for scan hashes what it is given, and a law with traced fields has no hash.
        return jax.lax.scan(lambda state, d: self.step(state, d), start, path)[1]
