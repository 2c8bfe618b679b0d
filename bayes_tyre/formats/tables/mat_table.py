"""Tables in MATLAB files (`.mat`): version 5 by SciPy, version 7.3, which is HDF5, by h5py."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
from scipy.io import loadmat

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.unpacked import check_hdf5, check_mat_5
from bayes_tyre.plain_text import listed, quoted

_WHAT = "save one struct of vectors, or vectors alone, of equal length"


def read_mat_table(path: Path) -> pd.DataFrame:
    """Return the table in a `.mat` file: a column a vector, of one struct or of the file; single values are repeated.

    Whole numbers become integers, so that the record ``1`` is not called ``1.0``.

    Raises
    ------
    BadInput
        If the file holds several structs, no vector, vectors of different length, or what is neither number nor text.
    """
    variables = _read_hdf5(path) if h5py.is_hdf5(path) else _read_version_5(path)
    structs = [name for name, value in variables.items() if isinstance(value, Mapping)]
    if len(structs) > 1 or (structs and len(variables) > 1):
        raise BadInput(f"{path}: holds {listed([*variables], 4, quoted)}: which is the table is not clear; {_WHAT}")
    fields = variables[structs[0]] if structs else variables
    columns = {name: _column(path, name, value) for name, value in fields.items() if np.size(value)}  # or '' of a note
    rows = max(map(len, columns.values()), default=0)
    for name, column in columns.items():
        if len(column) not in (1, rows):
            raise BadInput(f"{path}: {quoted(name)} has {len(column)} values where others have {rows}; {_WHAT}")
    if not rows:
        raise BadInput(f"{path}: holds no vector; {_WHAT}")
    return pd.DataFrame({name: np.repeat(one, rows) if len(one) < rows else one for name, one in columns.items()})


def _column(path: Path, name: str, value: Any) -> np.ndarray:
    """Return a variable as a vector of numbers or of text; whole numbers as integers."""
    array = np.atleast_1d(np.asarray(value))
    scalars = array.ndim == 1 and all(isinstance(one, str | float | int) for one in array.tolist())
    if not scalars:
        raise BadInput(f"{path}: {quoted(name)} is no vector of numbers or of text; {_WHAT}")
    if array.dtype.kind == "f" and (np.abs(array) < 2**53).all() and (array == np.round(array)).all():
        return array.astype(np.int64)
    return np.char.rstrip(array) if array.dtype.kind == "U" else array


def _read_version_5(path: Path) -> dict[str, Any]:
    check_mat_5(path)
    loaded = loadmat(path, simplify_cells=True)
    return {name: value for name, value in loaded.items() if not name.startswith("__")}


def _read_hdf5(path: Path) -> dict[str, Any]:
    check_hdf5(path)
    with h5py.File(path) as file:
        return {name: _hdf5_value(file, item) for name, item in file.items() if not name.startswith("#")}


def _hdf5_value(file: h5py.File, item: Any) -> Any:
    """Return a struct as a mapping, text as strings, anything else as an array without its axes of one."""
    if isinstance(item, h5py.Group):
        return {name: _hdf5_value(file, field) for name, field in item.items()}
    if h5py.check_string_dtype(item.dtype) is not None:
        return np.squeeze(item.asstr()[()])
    values = np.squeeze(item[()])
    if item.dtype == h5py.ref_dtype:  # a cell array
        return np.array([str(_hdf5_value(file, file[one])) for one in np.atleast_1d(values)])
    if item.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, np.atleast_1d(values)))
    return values
