"""Files that claim or unpack to more than any memory: refused in one line, at once, and without reading them.

Each is read in a process of its own, of little memory; what is asserted is CPU time, because other tests run beside.
"""

import io
import json
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.formats.tables.workbook import MOST_BYTES

#: s of CPU, and bytes more than before the file was read.
MOST_CPU, MOST_MEMORY = 1.0, 500_000_000
HEADER = "record,displacement_mm,force_kN\n"
TOO_MUCH = MOST_BYTES + (1 << 20)
READ = """
import json, resource, sys, time
from pathlib import Path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.formats.tables.column_map import read_column_map
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.rig.axle import load_rig
readers = {"tree": read_tree, "raw": read_raw, "map": read_column_map, "table": read_table, "rig": load_rig}
for line in sys.stdin:
    reader, path = line.split()
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    try:
        readers[reader](Path(path))
        said = "read"
    except BadInput as error:
        said = str(error)
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    print(json.dumps([said, time.process_time() - began, grown]), flush=True)
"""


def zeros_in_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:  # no chunk is written: all is fill value
        file.create_dataset("force_kN", (TOO_MUCH,), "f8", chunks=(1 << 16,))


def zeros_in_mat(path: Path) -> None:
    header = io.BytesIO()
    scipy.io.savemat(header, {"force_kN": np.zeros(3)})
    pack = zlib.compressobj()
    packed = b"".join(pack.compress(bytes(1 << 20)) for _ in range(1 + (TOO_MUCH >> 20))) + pack.flush()
    path.write_bytes(header.getvalue()[:128] + np.array([15, len(packed)], "<u4").tobytes() + packed)


def numbers_in_mat_4(path: Path) -> None:
    path.write_bytes(np.array([0, 1 << 30, 1 << 30, 0, 2], "<i4").tobytes() + b"k\0" + bytes(99))


def zeros_in_workbook(path: Path) -> None:
    openpyxl.Workbook().save(path)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive, archive.open("xl/extra.xml", "w") as part:
        for _ in range(1 + (TOO_MUCH >> 20)):
            part.write(bytes(1 << 20))


def numbers_in_parquet(path: Path) -> None:
    table = pa.table({name: pa.array(np.zeros(1 << 20)) for name in HEADER.strip().split(",")})
    with pq.ParquetWriter(path, table.schema, compression="zstd") as file:
        for _ in range(30):
            file.write_table(table)


def texts_in_parquet(path: Path, text: pa.DataType) -> None:
    labels = pa.DictionaryArray.from_arrays(pa.array(np.zeros(1 << 20, "i4")), pa.array(["x" * 1000]))
    pq.write_table(pa.table({"record": labels.cast(text)}), path)


def text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content)


BOMBS: dict[str, tuple[str, str, Callable[[Path], object]]] = {
    "netCDF": ("tree", "posterior.nc", zeros_in_hdf5),
    "MATLAB 7.3, a table": ("table", "t.mat", zeros_in_hdf5),
    "MATLAB 7.3, a recording": ("raw", "r.mat", zeros_in_hdf5),
    "MATLAB 5, a table": ("table", "t.mat", zeros_in_mat),
    "MATLAB 5, a recording": ("raw", "r.mat", zeros_in_mat),
    "MATLAB 4, a table": ("table", "t.mat", numbers_in_mat_4),
    "MATLAB 4, a recording": ("raw", "r.mat", numbers_in_mat_4),
    "workbook": ("table", "t.xlsx", zeros_in_workbook),
    "Parquet of numbers": ("table", "t.parquet", numbers_in_parquet),
    "Parquet of texts": ("table", "t.parquet", partial(texts_in_parquet, text=pa.string())),
    "Parquet of texts as pandas writes them": (
        *("table", "t.parquet"),
        partial(texts_in_parquet, text=pa.large_string()),
    ),
    "a million columns": ("table", "t.csv", text(",".join(f"c{i}" for i in range(1_000_000)) + "\n1\n")),
    "a million columns without names": ("table", "t.csv", text("a" + "," * 400_000 + "\n1\n")),
    "a million columns of a recording": ("raw", "r.csv", text(",".join(f"c{i}" for i in range(1_000_000)) + "\n1\n")),
    "a label of a megabyte": ("table", "t.csv", text(f"{HEADER}{'x' * 100_000},1,2\n" * 10)),
    "a name of a megabyte": ("table", "t.csv", text("x" * 1_000_000 + "," + HEADER + "1,a,1,2\n")),
    "nested lists": ("rig", "r.toml", text("a = " + "[" * 1000 + "]" * 1000)),
    "nested tables": ("map", "m.toml", text("a" + ".a" * 400 + " = 1")),
    "nested keys": ("map", "m.toml", text("a" + ".a" * 100_000 + " = 1")),
    "a long TOML": ("rig", "r.toml", text("a = 1 #" + "x" * 2_000_000)),
    "a key of a megabyte": ("map", "m.toml", text('[columns]\nrecord = "' + "x" * 1_000_000 + '"')),
}


@pytest.fixture(scope="module")
def reader():
    command = [sys.executable, "-c", READ]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_at_once_in_one_line(name, reader, tmp_path):
    kind, file, make = BOMBS[name]
    path = tmp_path / file
    make(path)
    print(kind, path, file=reader.stdin, flush=True)
    said, cpu, grown = json.loads(reader.stdout.readline())
    assert said.removeprefix("--columns ").startswith(f"{path}: "), said[:300]
    assert said.isprintable()
    assert len(said) < 600 + len(str(path))
    assert cpu < MOST_CPU, (cpu, said)
    assert grown < MOST_MEMORY, (grown, said)
    if "unpacks to" in said and file.endswith(("nc", "mat", "parquet")):
        assert "over 134 MB and 100 times its own size" in said


def test_a_compressed_file_of_usual_size_is_read(tmp_path):

    rows = {"record": ["a"] * 3000, "displacement_mm": np.zeros(3000), "force_kN": np.zeros(3000)}
    pq.write_table(pa.table(rows), tmp_path / "t.parquet")
    scipy.io.savemat(tmp_path / "t.mat", {"t": {**rows, "record": 1.0}}, do_compression=True)
    assert len(read_table(tmp_path / "t.parquet")) == len(read_table(tmp_path / "t.mat")) == 3000
