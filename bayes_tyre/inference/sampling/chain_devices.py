"""The devices that chains run on: each chain on one of its own where there are enough, otherwise in turns."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import ArrayLike

_CHAINS = "chains"


class ChainDevices:
    """Devices for so many chains.

    Attributes
    ----------
    together:
        How many chains run at once, a divisor of their number.
    """

    def __init__(self, chains: int) -> None:
        devices = jax.local_devices()
        self._chains = chains
        self.together = max(n for n in range(1, min(chains, len(devices)) + 1) if chains % n == 0)
        self._mesh = Mesh(np.asarray(devices[: self.together]), (_CHAINS,))

    def place(self, data: Any) -> Any:
        """Return data shared by all chains: devices of one host share its memory, where each would hold gigabytes."""
        everywhere = NamedSharding(self._mesh, PartitionSpec())

        def shared(leaf: ArrayLike) -> jax.Array:
            on_host = np.asarray(leaf)
            of_each = [jax.device_put(on_host, device, may_alias=True) for device in self._mesh.devices]
            return jax.make_array_from_single_device_arrays(on_host.shape, everywhere, of_each)

        return jax.tree.map(shared, data)

    def mapped(self, function: Callable[[Any, Any], Any]) -> Any:
        """Return a function of a chain and of what chains share, to be compiled for as many chains as go together."""

        def one(chain: Any, shared: Any) -> Any:
            result = function(jax.tree.map(lambda block: block[0], chain), shared)
            # Of no weak type: what a function returns is then what it takes, and it is compiled once.
            return jax.tree.map(lambda array: jax.lax.convert_element_type(array, jnp.result_type(array))[None], result)

        own, shared = PartitionSpec(_CHAINS), PartitionSpec()
        mapped = jax.shard_map(one, mesh=self._mesh, in_specs=(own, shared), out_specs=own, check_vma=False)
        shardings = tuple(NamedSharding(self._mesh, spec) for spec in (own, shared))
        return jax.jit(mapped, in_shardings=shardings)

    def in_turns(self, run: Callable[[Any, Any], Any], chain: Any, shared: Any) -> Any:
        """Return what a function that `mapped` gave returns for all chains."""
        if self.together == self._chains:
            return run(chain, shared)
        turns = range(0, self._chains, self.together)
        ends = [run(jax.tree.map(lambda a, i=i: np.asarray(a)[i : i + self.together], chain), shared) for i in turns]
        return jax.tree.map(lambda *arrays: np.concatenate([np.asarray(array) for array in arrays]), *ends)
