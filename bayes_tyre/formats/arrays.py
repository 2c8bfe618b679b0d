"""Named arrays on disk as NumPy's `.npz`: written whole, read without pickle, with one kind of error."""

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import whole_file
from bayes_tyre.plain_text import NAME, one_line, reason


def write_arrays(arrays: Mapping[str, np.ndarray], path: Path) -> Path:
    """Write arrays by name, whole or not at all; return the path."""
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise TypeError(f"{name}: an array of objects would need pickle")
    with whole_file(path) as beside, zipfile.ZipFile(beside, "w") as archive:
        for name, array in arrays.items():  # not savez, which takes names such as `file` for itself
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)
    return path


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays in a file by name; their check sums are compared.

    Raises
    ------
    BadInput
        If the file is missing, torn, changed or none of arrays.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if (torn := archive.testzip()) is not None:
                raise BadInput(f"{path}: {one_line(torn, NAME)} is not as it was written; remove the file")
            # Not np.load, which gives the bytes of an entry that is no array.
            return {name.removesuffix(".npy"): _read_array(archive, name) for name in archive.namelist()}
    except (OSError, EOFError, ValueError, KeyError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        raise BadInput(f"{path}: cannot be read as arrays: {reason(error)}; remove the file") from error


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    with archive.open(name) as entry:
        try:
            return np.lib.format.read_array(entry, allow_pickle=False)
        except Exception as error:  # a header is parsed as Python, whose errors are many, and may ask for any memory
            raise ValueError(f"{name}: {reason(error)}") from error
