"""MATLAB files of version 5 and 7.3: variables and structs by name, as channels with times and units."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from helpers.flipped_bytes import assert_read_or_refused

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.recordings.mat_signals import read_mat_signals
from bayes_tyre.formats.recordings.mat_variables import read_mat
from bayes_tyre.formats.recordings.raw import read_raw

TIMES, ACC, LOAD = [0.0, 0.001, 0.002], [1.0, 1.125, 1.25], [-2.5, -2.25, -2.0]


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "step.mat"


def version_5(path: Path, content: dict) -> Path:
    scipy.io.savemat(path, content, oned_as="column", do_compression=True)
    return path


def version_7(path: Path, content: dict) -> Path:
    """Write as MATLAB does: structs are groups, text 16-bit characters, a user block before all."""

    def put(group: h5py.Group, fields: dict) -> None:
        for name, value in fields.items():
            if isinstance(value, dict):
                put(group.create_group(name), value)
            elif isinstance(value, str):
                codes = np.frombuffer(value.encode("utf-16-le"), dtype=np.uint16)
                group.create_dataset(name, data=codes.reshape(-1, 1)).attrs["MATLAB_class"] = np.bytes_(b"char")
            else:
                data = group.create_dataset(name, data=np.atleast_2d(np.asarray(value)))
                data.attrs["MATLAB_class"] = np.bytes_(b"double")

    with h5py.File(path, "w", userblock_size=512) as file:
        put(file, content)
    return path


def vectors(path: Path) -> dict[str, np.ndarray]:
    return {name: leaf for name, leaf in read_mat(path).items() if isinstance(leaf, np.ndarray) and leaf.ndim == 1}


both = pytest.mark.parametrize("written", [version_5, version_7])
VARIABLES = {"time": TIMES, "acc": ACC, "load": LOAD, "load_unit": "kN", "units": {"acc": "m/s²"}, "rate": 1000.0}
STRUCT = {"run": {"t_ms": [0.0, 1.0, 2.0], "acc": ACC, "load": LOAD, "unit": {"acc": "m/s²", "load": "kN"}}}
CHANNELS = {
    "out": {
        "time": TIMES,
        "acc": {"values": ACC, "unit": "m/s²"},
        "second": {"data": LOAD, "unit": "kN", "name": "load"},
    }
}


@both
@pytest.mark.parametrize("content", [VARIABLES, STRUCT, CHANNELS], ids=["variables", "struct", "struct a channel"])
def test_channels_have_names_units_and_times(path, written, content):
    raw = read_raw(written(path, content))
    (channels,) = raw.segments
    assert [(one.name, one.unit) for one in channels] == [("acc", "m/s²"), ("load", "kN")]
    for one, values in zip(channels, (ACC, LOAD), strict=True):
        assert one.values.tolist() == values
        np.testing.assert_allclose(one.time_s, TIMES)
    assert raw.warnings == ()


@both
def test_x_is_a_channel_beside_a_vector_named_for_time(path, written):
    (channels,) = read_mat_signals(written(path, {"x": LOAD, "t": TIMES, "acc": ACC, "acc_unit": "g"})).segments
    assert {one.name: (one.unit, one.values.tolist()) for one in channels} == {"x": ("", LOAD), "acc": ("g", ACC)}
    (channels,) = read_mat_signals(written(path, {"x": TIMES, "x_unit": "ms", "acc": ACC})).segments
    assert [one.name for one in channels] == ["acc"]
    np.testing.assert_allclose(channels[0].time_s, np.array(TIMES) / 1000)


@both
def test_vectors_by_name(path, written):
    variables = vectors(written(path, {**STRUCT, "n": 5.0, "note": "warm", "matrix": np.ones((2, 3))}))
    assert set(variables) == {"run.t_ms", "run.acc", "run.load"}
    assert variables["run.load"].tolist() == LOAD
    assert read_mat(path)["note"] == "warm"
    assert np.shape(read_mat(path)["matrix"]) in ((2, 3), (3, 2))


def test_an_array_of_structs_is_a_recording_each(path):
    runs = np.array(
        [(np.array(TIMES), np.array(LOAD)), (np.array(TIMES), np.array(ACC))], dtype=[("t", "O"), ("load", "O")]
    )
    raw = read_mat_signals(version_5(path, {"run": runs}))
    assert [[one.name for one in channels] for channels in raw.segments] == [["load"], ["load"]]
    assert raw.segments[1][0].values.tolist() == ACC
    assert raw.segments[1][0].time_s.tolist() == TIMES


@both
def test_what_has_no_times_or_is_no_vector_is_said(path, written):
    raw = read_mat_signals(written(path, {"time": TIMES, "acc": ACC, "long": [1.0, 2.0, 3.0, 4.0], "data": np.eye(2)}))
    by_name = {one.name: one for one in raw.segments[0]}
    assert by_name["long"].time_s.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert by_name["acc"].time_s.tolist() == TIMES
    assert set(raw.warnings) == {
        "'long': no vector of times has its length: its time counts samples, not seconds",
        "'data': is a matrix: left out; save a vector a channel",
    }


def test_objects_cells_and_links_are_left_out(path):
    with h5py.File(version_7(path, VARIABLES), "a") as file:
        file["elsewhere"] = h5py.ExternalLink("other.h5", "/x")
        file["again"] = h5py.SoftLink("/acc")
        file["loop"] = file["/"]
        file.create_dataset("object", data=np.arange(6, dtype=np.uint32)).attrs["MATLAB_object_decode"] = 3
        file.create_dataset("cells", data=[file["acc"].ref], dtype=h5py.ref_dtype)
    names = {name for name in vectors(path) if "loop" not in name}
    assert names == {"time", "acc", "load"}
    version_5(path, {"time": TIMES, "acc": ACC, "cells": np.array([1.0, "a"], dtype=object)})
    assert set(vectors(path)) == {"time", "acc"}


def test_what_is_no_recording_is_refused(path):
    for content in (b"", b"MATLAB 5.0 MAT-file", bytes(range(256)) * 4, b"\x89HDF\r\n\x1a\n" + bytes(100)):
        path.write_bytes(content)
        with pytest.raises(BadInput, match=r"step\.mat: .*; ") as caught:
            read_mat_signals(path)
        assert str(caught.value).isprintable()
    with pytest.raises(BadInput, match="holds no vector of numbers"):
        read_mat_signals(version_5(path, {"time": TIMES, "note": "warm"}))
    with h5py.File(path, "w") as file:
        file.create_dataset("acc", shape=(1 << 40,), dtype=float, chunks=(1 << 20,))
    with pytest.raises(BadInput, match="unpacks to 8,796,093 MB"):
        read_mat(path)


@both
def test_flipped_bytes_give_vectors_or_the_one_error(path, written):
    assert_read_or_refused(written(path, {**VARIABLES, **STRUCT}), read_mat_signals, times=200)
