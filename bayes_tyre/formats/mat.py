"""Variables of MATLAB files (`.mat`): version 5 by scipy, 7.3 by h5py; no object in them is built or run."""

import warnings
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import scipy.io

from bayes_tyre.errors import BadInput
from bayes_tyre.plain_text import reason

#: Structs within structs; a damaged file may hold one within itself.
_DEEPEST = 8
#: Bytes of one variable: a damaged or empty one may claim any size.
_MOST_BYTES = 1 << 32


def read_mat_variables(path: Path) -> dict[str, np.ndarray]:
    """Return the vectors of numbers in a MATLAB file by name; ``run.load`` is a field of a struct.

    Scalars, matrices, text, cells and objects such as timetables are left out.

    Raises
    ------
    BadInput
        If the file is missing or cannot be read.
    """
    return {name: leaf for name, leaf in read_mat(path).items() if isinstance(leaf, np.ndarray) and leaf.ndim == 1}


def read_mat(path: Path) -> dict[str, np.ndarray | str]:
    """Return the arrays of real numbers in a MATLAB file, without dimensions of one element, and its text, by name.

    Fields of structs are ``run.load``, those of an array of structs ``run(1).load``.

    Raises
    ------
    BadInput
        If the file is missing or cannot be read.
    """
    if not path.is_file():
        raise BadInput(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; check the path")
    try:
        if h5py.is_hdf5(path):
            with h5py.File(path, "r") as file:
                return {name: leaf for name, leaf in _of_group(file, "", path) if leaf is not None}
        with warnings.catch_warnings(), path.open("rb") as opened:
            warnings.simplefilter("ignore")  # on variables of one name, and on objects
            content = scipy.io.loadmat(opened, simplify_cells=True)
        variables = {name: value for name, value in content.items() if not name.startswith("__")}
        return {name: leaf for name, leaf in _of_struct(variables, "") if leaf is not None}
    except (BadInput, MemoryError):
        raise
    except Exception as error:  # the libraries raise many kinds of error
        raise BadInput(f"{path}: cannot be read as a MATLAB file: {reason(error)}; save it again") from error


type _Leaves = Iterator[tuple[str, np.ndarray | str | None]]


def _of_struct(value: object, name: str) -> _Leaves:
    """Yield name and content of all that scipy made of a variable."""
    if isinstance(value, dict):
        for field, content in value.items():
            yield from _of_struct(content, f"{name}.{field}" if name else str(field))
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        for i, content in enumerate(np.ravel(np.asarray(value, dtype=object)), start=1):
            if isinstance(content, dict):
                yield from _of_struct(content, f"{name}({i})")
    elif isinstance(value, str):
        yield name, value
    else:
        yield name, _numbers(value)


def _of_group(group: h5py.Group, name: str, path: Path, depth: int = 0) -> _Leaves:
    """Yield name and content of the datasets in an HDF5 group, which is a struct; links to other places are left."""
    for field in group:
        link, inner = group.get(field, getlink=True), f"{name}.{field}" if name else field
        if field.startswith("#") or not isinstance(link, h5py.HardLink):
            continue
        item = group[field]
        if isinstance(item, h5py.Group) and depth < _DEEPEST and "MATLAB_sparse" not in item.attrs:
            yield from _of_group(item, inner, path, depth + 1)
        elif isinstance(item, h5py.Dataset) and not {"MATLAB_empty", "MATLAB_object_decode"} & set(item.attrs):
            if item.nbytes > _MOST_BYTES:
                raise BadInput(f"{path}: variable {inner}: {item.nbytes} bytes are no recording; save it again")
            is_text = item.attrs.get("MATLAB_class") == b"char" and item.dtype == np.uint16
            yield inner, item[()].ravel("F").tobytes().decode("utf-16-le") if is_text else _numbers(item[()])


def _numbers(value: object) -> np.ndarray | None:
    array = np.squeeze(np.asarray(value))
    return array if array.dtype.kind in "buif" else None
