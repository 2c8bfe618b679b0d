"""Variables of MATLAB files (`.mat`): version 5 by scipy, 7.3 by h5py; no object in them is built or run."""

import warnings
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import scipy.io

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.unpacked import check_hdf5, check_mat_5
from bayes_tyre.plain_text import reason

#: Attributes of what is stored as arrays and is none.
_NO_VECTORS = {"MATLAB_empty", "MATLAB_object_decode", "MATLAB_sparse"}
_REAL = "buif"


def read_mat(path: Path) -> dict[str, np.ndarray | str]:
    """Return the arrays of real numbers in a MATLAB file, without dimensions of one element, and its text, by name.

    Fields of structs are ``run.load``, those of an array of structs ``run(1).load``.

    Raises
    ------
    BadInput
        If the file cannot be read.
    """
    try:
        if h5py.is_hdf5(path):
            check_hdf5(path)
            return _of_hdf5(path)
        check_mat_5(path)
        with warnings.catch_warnings(), path.open("rb") as opened:
            warnings.simplefilter("ignore")  # on variables of one name, and on objects
            content = scipy.io.loadmat(opened, simplify_cells=True)
        variables = {name: value for name, value in content.items() if not name.startswith("__")}
        return dict(_leaves(variables, ""))
    except (BadInput, MemoryError):
        raise
    except Exception as error:  # the libraries raise many kinds of error
        raise BadInput(f"{path}: cannot be read as a MATLAB file: {reason(error)}; save it again") from error


def _leaves(value: object, name: str) -> Iterator[tuple[str, np.ndarray | str]]:
    """Yield name and content of the numbers and texts that scipy made of a variable."""
    if isinstance(value, dict):
        for field, content in value.items():
            yield from _leaves(content, f"{name}.{field}" if name else str(field))
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        for i, content in enumerate(np.ravel(np.asarray(value, dtype=object)), start=1):
            if isinstance(content, dict):
                yield from _leaves(content, f"{name}({i})")
    elif isinstance(value, str):
        yield name, value
    elif (array := np.squeeze(np.asarray(value))).dtype.kind in _REAL:
        yield name, array


def _of_hdf5(path: Path) -> dict[str, np.ndarray | str]:
    """Return what `read_mat` does of a file of version 7.3; links to other places and files are not followed."""
    variables: dict[str, np.ndarray | str] = {}

    def take(name: str, item: h5py.Group | h5py.Dataset) -> None:
        kinds = {*item.attrs, *item.parent.attrs}
        if isinstance(item, h5py.Group) or name.startswith("#") or kinds & _NO_VECTORS:
            return
        name = name.replace("/", ".")
        if item.attrs.get("MATLAB_class") == b"char" and item.dtype == np.uint16:
            variables[name] = item[()].ravel("F").tobytes().decode("utf-16-le")
        elif item.dtype.kind in _REAL:
            variables[name] = np.squeeze(item[()])

    with h5py.File(path, "r") as file:
        file.visititems(take)
    return variables
