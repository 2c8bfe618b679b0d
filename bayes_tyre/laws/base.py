"""The contract of a force law: force along a path of displacement, and init/step for laws that carry state."""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

type State = Any
"""Whatever a law remembers between two points: a pytree of arrays."""

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

        No move, no change: a step to the displacement where the state already is returns its force.
        """

    def check(self) -> None:
        """Refuse parameters, known numbers, with which a body moving on the law would gain energy from it.

        Raises
        ------
        ValueError
            If a closed loop of the law makes energy. A law that never does has nothing to refuse.
        """

    def force(self, path: Path, F_start: ScalarLike) -> Float[Array, " points"]:
        """Return the force, kN, at every point of the path, mm, by stepping along it from `F_start`, kN."""
        # A scan's carry keeps its dtype: let path, start and parameters agree on one before it starts.
        numbers = [leaf for leaf in jax.tree.leaves(self) if not callable(leaf)]
        dtype = jnp.result_type(path, F_start, *numbers)
        path = jnp.asarray(path, dtype)
        start = self.init(path[0], jnp.asarray(F_start, dtype))
        # A plain function, for scan hashes what it is given, and a law with traced fields has no hash.
        return jax.lax.scan(lambda state, d: self.step(state, d), start, path)[1]
