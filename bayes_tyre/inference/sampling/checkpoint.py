"""Checkpoints of a run: a file a chunk of iterations, each with what run it is of, from which the run can go on."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.arrays import read_arrays, write_arrays
from bayes_tyre.inference.sampling.chunks import Chunk

_IDENTITY, _FORMAT, _STATE, _DRAWS, _STATISTICS = "identity", "format", "state", "draws", "statistics"
_NAME = "chunk-{:06d}.npz"
#: Raised when a state or a draw comes to mean something else, such as other coordinates: these are kept as they are
#: sampled.
FORMAT = 7
_OTHER_FORMAT = "was saved by a version whose states and draws mean something else"


@dataclass
class Checkpoints:
    """The checkpoints of one run, in a folder of their own.

    Attributes
    ----------
    folder:
        Made with the first checkpoint, removed by `clear`.
    identity:
        What the draws follow from: inputs, options, seed, versions; of what JSON can say.
    on_trouble:
        Called with one line on why a checkpoint could not be written or read; the run continues without it.
    first:
        Number that the first chunk has in its file's name: 0, but for a run repeated, which goes on counting.
    """

    folder: Path
    identity: Mapping[str, Any]
    on_trouble: Callable[[str], None] = lambda _: None
    first: int = 0
    _refused: bool = field(default=False, init=False)

    def save(self, number: int, chunk: Chunk) -> None:
        """Write the chunk of this number, from 0; where the disk refuses, say so once and write no more."""
        if self._refused:
            return
        identity = json.dumps(self.identity, sort_keys=True).encode()
        arrays = {_IDENTITY: np.frombuffer(identity, dtype=np.uint8), _FORMAT: np.int64(FORMAT)}
        arrays |= {f"{_STATE}/{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(chunk.state))}
        arrays |= {f"{_DRAWS}/{name}": values for name, values in chunk.unconstrained.items()}
        arrays |= {f"{_STATISTICS}/{name}": values for name, values in chunk.statistics.items()}
        try:
            write_arrays(arrays, self._path(number))
        except OSError as error:
            self._refused = True
            why = f"{error.filename or self.folder}: {error.strerror or error}"
            self.on_trouble(f"no more checkpoints ({why}); the fit goes on, --resume will repeat what follows")

    def exist(self) -> bool:
        """Return whether there is a first one, of whatever run."""
        return (self.folder / _NAME.format(0)).exists()

    def identity_found(self) -> Mapping[str, Any] | None:
        """Return of what run the first checkpoint in the folder is; None where there is none.

        Raises
        ------
        BadInput
            If it cannot be read, or means something else by its arrays.
        """
        path = self.folder / _NAME.format(0)
        if not self.exist():
            return None
        try:
            arrays = read_arrays(path)
            identity = json.loads(arrays[_IDENTITY].tobytes())
        except (BadInput, KeyError, ValueError) as error:
            raise BadInput(
                f"{path}: is no checkpoint that can be read ({str(error)[:200]}); leave out --resume to begin anew"
            ) from None
        if not _of_this_format(arrays):
            raise BadInput(f"{path}: {_OTHER_FORMAT}; leave out --resume to begin anew")
        return identity

    def load(self, like: Any, lengths: list[int]) -> list[Chunk]:
        """Return the chunks of this run from its beginning on, up to the first that is missing, torn or another's.

        Parameters
        ----------
        like:
            A state of the run, or its shapes.
        lengths:
            Iterations of each chunk.
        """
        chunks: list[Chunk] = []
        for number, length in enumerate(lengths):
            path = self._path(number)
            if not path.exists():
                break
            try:
                chunks.append(self._chunk(path, like, length))
            except (BadInput, KeyError, ValueError) as error:
                self.on_trouble(f"{str(error)[:300]}; the run goes on from the checkpoint before it")
                break
        return chunks

    def clear(self) -> None:
        """Remove the checkpoints and, where nothing else is in it, their folder."""
        if not self.folder.is_dir():
            return
        for path in (*self.folder.glob("chunk-*.npz"), *self.folder.glob(".chunk-*.npz")):
            path.unlink(missing_ok=True)
        if not any(self.folder.iterdir()):
            self.folder.rmdir()

    def _path(self, number: int) -> Path:
        return self.folder / _NAME.format(self.first + number)

    def _chunk(self, path: Path, like: Any, length: int) -> Chunk:
        arrays = read_arrays(path)
        if not _of_this_format(arrays):
            raise ValueError(f"{path}: {_OTHER_FORMAT}")
        if json.loads(arrays[_IDENTITY].tobytes()) != json.loads(json.dumps(self.identity)):
            raise ValueError(f"{path}: is of another run")
        shapes, form = jax.tree.flatten(like)
        leaves = [arrays[f"{_STATE}/{i}"] for i in range(len(shapes))]
        draws, statistics = _named(arrays, _DRAWS), _named(arrays, _STATISTICS)
        fit = all(
            (leaf.shape, leaf.dtype) == (like.shape, like.dtype) for leaf, like in zip(leaves, shapes, strict=True)
        )
        if not fit or any(values.shape[1:2] != (length,) for values in draws.values()):
            raise ValueError(f"{path}: does not fit the model")
        return Chunk(jax.tree.unflatten(form, leaves), draws, statistics)


def _of_this_format(arrays: Mapping[str, np.ndarray]) -> bool:
    return np.array_equal(arrays.get(_FORMAT, -1), FORMAT)


def _named(arrays: Mapping[str, np.ndarray], kind: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(f"{kind}/"): values for name, values in arrays.items() if name.startswith(f"{kind}/")}
