"""Posteriors on disk: what is no netCDF is told in one line, and a full disk ends in an error, not in a crash."""

import errno
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.netcdf import read_tree, write_tree


@pytest.fixture
def tree() -> xr.DataTree:
    draws = np.random.default_rng(5).normal(size=(2, 50, 4))
    labels = ["=cmd()", "a\nb", "⌀ \U0001f69a", "x" * 10_000]
    posterior = xr.Dataset({"k": (("chain", "draw", "record"), draws)}, coords={"record": labels})
    return xr.DataTree.from_dict({"posterior": posterior})


def test_a_tree_comes_back_as_it_was(tree, tmp_path):
    path = write_tree(tree, tmp_path / "posterior.nc")
    xr.testing.assert_identical(read_tree(path)["posterior"].to_dataset(), tree["posterior"].to_dataset())
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda whole: b"",
        lambda whole: bytes(range(256)) * 30,
        lambda whole: whole[: len(whole) // 2],
        lambda whole: whole[:-100],
        lambda whole: whole[:2000] + bytes(len(whole) - 2000),
        lambda whole: b"record,displacement_mm\nr,1\n",
    ],
    ids=["empty", "binary", "half", "cut short", "zeros", "text"],
)
def test_a_spoilt_file_is_refused_in_one_line(spoil, tree, tmp_path):
    path = write_tree(tree, tmp_path / "posterior.nc")
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(BadInput) as caught:
        read_tree(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: cannot be read as netCDF: ")
    assert message.endswith("; run fit again")
    assert message.isprintable()


def test_free_space_without_length_on_which_hdf5_never_ends_is_refused(tree, tmp_path):
    path = write_tree(tree, tmp_path / "posterior.nc")
    whole = path.read_bytes()
    at = whole.index(b"GCOL") + 16
    while number := int.from_bytes(whole[at : at + 2], "little"):
        length = int.from_bytes(whole[at + 8 : at + 16], "little")
        at += 16 + length + -length % 8
    assert number == 0
    path.write_bytes(whole[: at + 8] + bytes(8) + whole[at + 16 :])
    with pytest.raises(BadInput, match=rf"posterior\.nc: .* free space at byte {at} has no length: .*; run fit again"):
        read_tree(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(BadInput, match="no such file; name a folder that fit wrote"):
        read_tree(tmp_path / "posterior.nc")
    with pytest.raises(BadInput, match="is a folder, not a netCDF file"):
        read_tree(tmp_path)


@pytest.mark.parametrize("room", [1_000, 100_000])
def test_a_full_disk_is_an_error_that_names_the_file_and_not_the_end_of_the_process(room, tmp_path):
    script = """
import resource, sys
from pathlib import Path
import numpy as np
import xarray as xr
from bayes_tyre.formats.netcdf import write_tree
tree = xr.DataTree.from_dict({"posterior": xr.Dataset({"k": (("draw", "record"), np.ones((1000, 100)))})})
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
try:
    write_tree(tree, Path(sys.argv[1]))
except OSError as error:
    print(error.errno, error.filename)
"""
    path = tmp_path / "posterior.nc"
    command = [sys.executable, "-c", script, path, str(room)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{errno.EFBIG} {path}\n"
    assert list(Path(tmp_path).iterdir()) == []
