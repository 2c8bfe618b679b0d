"""Posteriors on disk: an xarray DataTree as netCDF, written whole, read with one kind of error."""

from pathlib import Path

import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.constant_data import put_together, set_apart
from bayes_tyre.formats.files import whole_file
from bayes_tyre.formats.unpacked import check_hdf5
from bayes_tyre.plain_text import reason

ENGINE = "h5netcdf"


def write_tree(tree: xr.DataTree, path: Path) -> Path:
    """Write a DataTree as netCDF, whole or not at all, the same tree as the same bytes; return the path.

    The bytes are made in memory first: where a disk refuses what HDF5 itself writes, HDF5 ends the process. The time
    at which ArviZ made a group is left out. Factors are in the group `constant_data` (`formats.constant_data`).
    """
    timeless = set_apart(tree).copy()
    for group in timeless.subtree:
        group.attrs.pop("created_at", None)
    with whole_file(path) as beside, beside.open("wb") as file:
        file.write(timeless.to_netcdf(engine=ENGINE))
    return path


def read_tree(path: Path) -> xr.DataTree:
    """Return the DataTree in a netCDF file, loaded and closed.

    Raises
    ------
    BadInput
        If the file is missing, a folder, no netCDF that can be read, or one that unpacks to too much.
    """
    if path.is_dir():
        raise BadInput(f"{path}: is a folder, not a netCDF file; name a folder that fit wrote")
    if not path.is_file():
        raise BadInput(f"{path}: no such file; name a folder that fit wrote")
    try:
        check_hdf5(path)
        with xr.open_datatree(path, engine=ENGINE) as tree:
            return put_together(tree.load())
    except (BadInput, MemoryError):
        raise
    except Exception as error:  # HDF5 raises several kinds of error
        # A damaged file that asks for too much, or a whole one where there is little.
        memory = "give it more memory, or " if "memory allocation failed" in str(error) else ""
        raise BadInput(f"{path}: cannot be read as netCDF: {reason(error)}; {memory}run fit again") from error
