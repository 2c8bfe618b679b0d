"""What chains leave, chunk by chunk: iterations in one call, and what they are drawn by.

Between two chunks a run can be watched, saved and continued.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array
from numpyro.infer.hmc import HMCState

#: Iterations of a chunk, at most.
CHUNK = 100


class Chunk(NamedTuple):
    """What some iterations leave; every array has the chains first.

    Attributes
    ----------
    state:
        Of each chain after them.
    unconstrained:
        Draws as the sampler sees them, shape (chains, iterations, unknowns), in one or two blocks.
    statistics:
        By ArviZ's name, shape (chains, iterations).
    """

    state: HMCState
    unconstrained: dict[str, np.ndarray]
    statistics: dict[str, np.ndarray]


def draw_keys(seed: Sequence[int], chains: int) -> np.ndarray:
    """Return a raw key for each draw of a chunk, shape (chains, CHUNK, 2)."""
    return np.random.SeedSequence(seed).generate_state(chains * CHUNK * 2).reshape(chains, CHUNK, 2)


def named_normals(key: Array, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Array]:
    """Return standard normals of these shapes by name, all drawn at once: each by itself takes as long to compile."""
    ends = np.cumsum([0, *(math.prod(shape) for shape in shapes.values())])
    z = jax.random.normal(key, (ends[-1],))
    return {name: z[i:j].reshape(shape) for (name, shape), (i, j) in zip(shapes.items(), pairwise(ends), strict=True)}


def joined(parts: Iterable[Mapping[str, np.ndarray]], draws: int) -> dict[str, np.ndarray]:
    """Return parts of so many draws one after the other; each may go before the next is made."""
    whole, done = dict[str, np.ndarray](), 0
    for part in parts:
        end = done
        for name, values in part.items():
            end = done + values.shape[1]
            if name not in whole:
                whole[name] = np.empty((len(values), draws, *values.shape[2:]), values.dtype)
            whole[name][:, done:end] = values
        done = end
    return whole
