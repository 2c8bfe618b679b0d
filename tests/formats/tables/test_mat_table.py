"""MATLAB files: structs and plain variables of version 5 and 7.3; what is no table is refused in one line."""

import io
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.table_files import read_table

WEG, KRAFT, NAMES = np.array([[0.5], [1.25], [2.0]]), np.array([[1.0], [2.5], [4.0]]), ["a", "a", "bä"]
TABLE = {"Versuch": NAMES, "Weg": [0.5, 1.25, 2.0], "Kraft": [1.0, 2.5, 4.0], "Stufe": [10, 10, 10]}


def version_5(path: Path, structured: bool) -> Path:
    content = {"Versuch": np.array(NAMES, dtype=object), "Weg": WEG, "Kraft": KRAFT.T, "Stufe": 10.0}
    savemat(path, {"daten": content} if structured else content)
    return path


def as_text(file: h5py.File, where: h5py.Group, name: str, text: str) -> h5py.Dataset:
    """Write text as MATLAB does: a column of UTF-16 units."""
    data = where.create_dataset(name, data=np.array([[ord(letter)] for letter in text], dtype=np.uint16))
    data.attrs["MATLAB_class"] = np.bytes_("char")
    return data


def version_7_3(path: Path, structured: bool) -> Path:
    """Write what MATLAB writes: a user block with its mark, arrays transposed, cells as references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        where = file.create_group("daten") if structured else file
        references = file.create_group("#refs#")
        cells = [as_text(file, references, f"r{i}", name).ref for i, name in enumerate(NAMES)]
        names = where.create_dataset("Versuch", data=np.array([cells], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        names.attrs["MATLAB_class"] = np.bytes_("cell")
        for name, values in (("Weg", WEG.T), ("Kraft", KRAFT), ("Stufe", np.array([[10.0]]))):
            where.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


@pytest.mark.parametrize("structured", [True, False])
@pytest.mark.parametrize("written", [version_5, version_7_3])
def test_a_struct_and_plain_variables_are_columns(written, structured, tmp_path):
    table = read_table(written(tmp_path / "a.mat", structured))
    assert {name: table[name].to_list() for name in TABLE} == TABLE
    assert len(table.columns) == 4


def test_whole_numbers_are_integers_so_that_a_record_keeps_its_name(tmp_path):
    savemat(tmp_path / "a.mat", {"record": np.array([1.0, 2.0]), "x": np.array([1.0, np.nan])})
    table = read_table(tmp_path / "a.mat")
    assert table["record"].astype(str).to_list() == ["1", "2"]
    assert np.isnan(table["x"].iloc[1])


def test_an_empty_text_is_no_column(tmp_path):
    savemat(tmp_path / "a.mat", {"record": "a", "note": "", "x": np.array([1.5, 2.5])})
    assert read_table(tmp_path / "a.mat").to_dict("list") == {"record": ["a", "a"], "x": [1.5, 2.5]}


def test_plain_hdf5_with_text_is_read(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file["Versuch"], file["Weg"] = ["a", "b"], [0.5, 1.5]
    assert read_table(tmp_path / "a.mat").to_dict("list") == {"Versuch": ["a", "b"], "Weg": [0.5, 1.5]}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"a": np.arange(3.0), "b": np.arange(2.0)}, "'b' has 2 values where others have 3"),
        ({"a": np.ones((3, 2))}, "'a' is no vector of numbers or of text"),
        ({"a": np.array([1 + 2j, 3])}, "'a' is no vector of numbers or of text"),
        ({"s": {"a": [1.0, 2.0]}, "t": {"a": [1.0, 2.0]}}, "holds 's', 't': which is the table is not clear"),
        ({}, "holds no vector"),
    ],
)
def test_what_is_no_table_is_refused(content, said, tmp_path):
    savemat(tmp_path / "a.mat", content)
    with pytest.raises(BadInput) as caught:
        read_table(tmp_path / "a.mat")
    assert said in str(caught.value)
    assert str(caught.value).endswith("; save one struct of vectors, or vectors alone, of equal length")


@pytest.mark.parametrize("compressed", [False, True])
def test_data_of_an_unknown_type_are_refused_because_scipy_would_end_the_process(compressed, tmp_path):
    path, written = tmp_path / "t.mat", io.BytesIO()
    savemat(written, {"force_kN": np.arange(9) / 7})
    header, element = written.getvalue()[:128], written.getvalue()[128:]
    type_9 = element.index(b"\x09\0\0\0\x48\0\0\0")
    element = element[:type_9] + b"," + element[type_9 + 1 :]
    packed = zlib.compress(element)
    path.write_bytes(header + (np.array([15, len(packed)], "<u4").tobytes() + packed if compressed else element))
    with pytest.raises(BadInput, match=r"t\.mat: holds data of type 44, .* damaged; save it again"):
        read_table(path)
