"""The unknowns of a model in one vector or two: NUTS would do with each site by itself what it can do with all at once.

Wherever a trajectory takes a step or a tree is joined, a leaf costs some kernels; a hierarchy has a dozen sites.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

#: Names of the vectors: of the unknowns whose block of the mass matrix is dense, and of all others.
DENSE, DIAGONAL = "dense", "diagonal"


class Blocks(NamedTuple):
    """Which sites' unknowns stand one after the other in each vector.

    Attributes
    ----------
    shapes:
        Of each site, unconstrained.
    dense:
        The sites in the dense block, in order; the others follow in that of their names, as in NumPyro's mass matrix.
    """

    shapes: Mapping[str, tuple[int, ...]]
    dense: tuple[str, ...]

    @property
    def sites(self) -> dict[str, list[str]]:
        """The sites of each vector; none is without any."""
        both = {DENSE: list(self.dense), DIAGONAL: sorted(self.shapes.keys() - set(self.dense))}
        return {block: names for block, names in both.items() if names}

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return sum(map(self._size, self.sites))

    def pack(self, values: Mapping[str, Float[np.ndarray, "chains *site"]]) -> dict[str, np.ndarray]:
        """Return the vectors, shape (chains, unknowns)."""
        return {
            block: np.concatenate([values[name].reshape(len(values[name]), -1) for name in names], axis=1)
            for block, names in self.sites.items()
        }

    def split(self, points: Float[np.ndarray, "*points unknowns"]) -> dict[str, np.ndarray]:
        """Return the vectors of points that have all unknowns one after the other, as `join` gives them."""
        ends = np.cumsum([self._size(block) for block in self.sites])
        return dict(zip(self.sites, np.split(points, ends[:-1], axis=-1), strict=True))

    def join(self, vectors: Mapping[str, ArrayLike]) -> Float[np.ndarray, "*points unknowns"]:
        """Return points with all unknowns one after the other, in the order of the vectors."""
        return np.concatenate([np.asarray(vectors[block]) for block in self.sites], axis=-1)

    def inverse_mass(
        self, covariance: Float[np.ndarray, "unknowns unknowns"] | None = None
    ) -> dict[tuple[str], np.ndarray]:
        """Return the inverse mass matrix of each vector, by NumPyro's name for it, of unknowns with this covariance.

        None: they are independent, with a variance of 1.
        """
        if covariance is None:
            covariance = np.eye(self.size)
        of_rows = self.split(covariance.T)
        square = {block: self.split(rows.T)[block] for block, rows in of_rows.items()}
        return {(block,): values if block == DENSE else np.diagonal(values) for block, values in square.items()}

    def _size(self, block: str) -> int:
        return sum(math.prod(self.shapes[name]) for name in self.sites[block])

    def unpack(self, vectors: Mapping[str, Float[Array, " unknowns"]]) -> dict[str, Array]:
        """Return the unknowns of one chain by site."""
        parameters = {}
        for block, names in self.sites.items():
            ends = np.cumsum([math.prod(self.shapes[name]) for name in names])
            pieces = jnp.split(vectors[block], ends[:-1])
            parameters |= {
                name: jnp.reshape(piece, self.shapes[name]) for name, piece in zip(names, pieces, strict=True)
            }
        return parameters
