"""Mutations of small files of every kind but `.lvm`: each reader must give a result or its one error.

As a program (`make fuzz`) it tries many more than the tests do: ``python -m helpers.fuzz_readers 20000``.
"""

import io
import json
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy.io
import xarray as xr
from helpers.fuzz_lvm import TOKENS as LVM_TOKENS
from helpers.fuzz_lvm import mutated
from helpers.fuzz_settings import examples
from hypothesis import given, seed

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.netcdf import read_tree, write_tree
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.formats.tables.column_map import read_column_map
from bayes_tyre.inference.sampling.checkpoint import Checkpoints
from bayes_tyre.inference.sampling.chunks import Chunk
from bayes_tyre.results.provenance import sha256
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.workflow.fit import planned_in, read_priors
from bayes_tyre.workflow.from_results.next import read_costs
from bayes_tyre.workflow.record_tables import read_given

TOKENS = [
    *LVM_TOKENS[:20],
    *(b"\x00\x00\x00\x00", b"\xff" * 8, b"{", b"[", b"]", b"}", b"null", b"true", b"1e400", b"[[a]]\n", b"a.b.c = 1\n"),
    *(b"<c/>", b"</row>", b'r="XFD1048576"', b"<v>1</v>", b"**MEASURDATA 3\n", b"inf", b"-0", b"2024-02-30"),
]
TABLE = pd.DataFrame(
    {
        "record": ["a"] * 6 + ["b"] * 6,
        "displacement_mm": np.tile(np.linspace(0, 1, 6), 2),
        "force_kN": np.linspace(20, 21, 12),
        "direction": ["loading"] * 12,
        "step_kN": [10.0] * 12,
    }
)
MAP = b"""skip_rows = 3
[columns]
record = "Versuch"
force_kN = { name = "Kraft", unit = "N" }
[constants]
configuration = "A"
[values.direction]
Belastung = "loading"
"""
RUN = {
    "command": "bayes-tyre fit records.csv --out out",
    "options": {"chains": 4, "warmup": 600, "draws": 1500, "interval": 0.95, "units_checked": False, "priors": {}},
    "seed": 0,
    "origin": "simulated",
    "versions": {"python": "3.13.0"},
    "wall_time_s": 1.0,
}
IDENTITY = {"inputs": {}, "options": {}}
FIRST_CHECKPOINT = "chunk-000000.npz"
PRIORS = b"sd_J = { scale = 0.1 }\nk_group = { median = 1.5 }\n"
COSTS = b"minutes_per_test = 5\nbudget_minutes = 60\n[setup_minutes]\nspeed_km_h = 3\n[rig]\nspeed_km_h = [0, 15]\n"


class Reader(NamedTuple):
    """A kind of file: its name, what reads it, and what makes the small files to begin with, as bytes."""

    name: str
    read: Callable[[Path], object]
    seeds: Callable[[Path], list[bytes]]


def _csv(folder: Path) -> list[bytes]:
    german = TABLE.rename(columns={"force_kN": "Kraft"}).to_csv(index=False, sep=";", decimal=",").encode("utf-16")
    return [TABLE.to_csv(index=False).encode(), german]


def _parquet(folder: Path) -> list[bytes]:
    TABLE.to_parquet(folder / "t.parquet")
    return [(folder / "t.parquet").read_bytes()]


def _xlsx(folder: Path) -> list[bytes]:
    written = io.BytesIO()
    TABLE.to_excel(written, index=False)
    return [written.getvalue()]


def _sheet(folder: Path) -> list[bytes]:
    with zipfile.ZipFile(io.BytesIO(_xlsx(folder)[0])) as archive:
        return [archive.read("xl/worksheets/sheet1.xml")]


def _read_sheet(path: Path) -> object:
    """Read a workbook whose one sheet is the XML in a file."""
    whole = path.with_suffix(".xlsx")
    with zipfile.ZipFile(io.BytesIO(_xlsx(path.parent)[0])) as old, zipfile.ZipFile(whole, "w") as new:
        for part in old.namelist():
            new.writestr(part, path.read_bytes() if part == "xl/worksheets/sheet1.xml" else old.read(part))
    return read_given([whole])


def _mat(folder: Path) -> list[bytes]:
    columns = {name: TABLE[name].to_numpy() for name in ("displacement_mm", "force_kN", "step_kN")} | {"record": 1.0}
    kinds = []
    for compressed in (False, True):
        written = io.BytesIO()
        scipy.io.savemat(written, {"t": columns}, do_compression=compressed)
        kinds.append(written.getvalue())
    return kinds


def _tree(folder: Path) -> list[bytes]:
    draws = xr.Dataset({"k": (("chain", "draw"), np.ones((2, 3)))}, attrs={"origin": "simulated"})
    return [write_tree(xr.DataTree.from_dict({"posterior": draws}), folder / "t.nc").read_bytes()]


def _run(folder: Path) -> list[bytes]:
    table = folder / "records.csv"
    TABLE.to_csv(table, index=False)
    return [json.dumps(RUN | {"inputs": {table.name: sha256(table)}}).encode()]


def _checkpoint(folder: Path) -> list[bytes]:
    kept = Checkpoints(folder, IDENTITY)
    kept.save(0, Chunk(np.ones(2), {"k": np.ones((2, 3))}, {"energy": np.ones((2, 3))}))  # pyright: ignore[reportArgumentType]
    return [(folder / FIRST_CHECKPOINT).read_bytes()]


def _read_checkpoint(path: Path) -> object:
    """Read a checkpoint as a run does that is to be resumed; raise what it passes over."""
    path.replace(path.with_name(FIRST_CHECKPOINT))
    passed_over: list[str] = []
    checkpoints = Checkpoints(path.parent, IDENTITY, passed_over.append)
    identity, chunks = checkpoints.identity_found(), checkpoints.load(np.ones(2), [3])
    if not chunks:
        raise BadInput(passed_over[0])
    return identity


def _arrays_of_checkpoint(folder: Path) -> list[bytes]:
    with zipfile.ZipFile(io.BytesIO(_checkpoint(folder)[0])) as archive:
        return [archive.read(name) for name in archive.namelist()]


def _read_array(path: Path) -> object:
    """Read checkpoints in which one array after the other is that of a file; return how many were read."""
    whole, read, refusal = path.with_suffix(".npz"), 0, BadInput("nothing was read")
    with zipfile.ZipFile(io.BytesIO(_checkpoint(path.parent)[0])) as old:
        for exchanged in old.namelist():
            with zipfile.ZipFile(whole, "w") as new:
                for part in old.namelist():
                    new.writestr(part, path.read_bytes() if part == exchanged else old.read(part))
            try:
                _read_checkpoint(whole)
            except BadInput as error:
                refusal = error
            else:
                read += 1
    if not read:
        raise refusal
    return read


def _of(*contents: bytes) -> Callable[[Path], list[bytes]]:
    return lambda _: [*contents]


def _tydex(folder: Path) -> list[bytes]:
    lines = ["**HEADER", "MEASID    vertical", "**MEASURCHANNELS"]
    lines += [f"{name:10}{name:30}{unit:10}" for name, unit in (("FZW", "N"), ("TYREDEFW", "mm"))]
    lines += ["**MEASURDATA 3", "1000      1", "2000      2", "3000      3", "**END"]
    return ["\n".join(lines).encode()]


READERS: Mapping[str, Reader] = {
    "table.csv": Reader("t.csv", lambda path: read_given([path]), _csv),
    "table.parquet": Reader("t.parquet", lambda path: read_given([path]), _parquet),
    "table.xlsx": Reader("t.xlsx", lambda path: read_given([path]), _xlsx),
    "a sheet": Reader("t.xml", _read_sheet, _sheet),
    "table.mat": Reader("t.mat", lambda path: read_given([path]), _mat),
    "table.tdx": Reader("t.tdx", lambda path: read_given([path]), _tydex),
    "recording.mat": Reader("r.mat", read_raw, _mat),
    "recording.csv": Reader("r.csv", read_raw, _csv),
    "recording.xlsx": Reader("r.xlsx", read_raw, _xlsx),
    "rig.toml": Reader("r.toml", load_rig, lambda _: [data_path("rigs/single.toml").read_bytes()]),
    "map.toml": Reader("m.toml", read_column_map, _of(MAP)),
    "priors.toml": Reader("p.toml", read_priors, _of(PRIORS)),
    "cost.toml": Reader("c.toml", read_costs, _of(COSTS)),
    "posterior.nc": Reader("p.nc", read_tree, _tree),
    "run.json": Reader("run.json", lambda path: planned_in(path, lambda _: None), _run),
    ".checkpoint": Reader("c.npz", _read_checkpoint, _checkpoint),
    "an array of .checkpoint": Reader("a.npy", _read_array, _arrays_of_checkpoint),
}


def outcome(reader: Reader, data: bytes, folder: Path) -> str:
    """Read the bytes as a file; assert that this gives a result or one line; return which."""
    path = folder / reader.name
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            reader.read(path)
        except BadInput as error:
            message = str(error)
            assert message.isprintable(), message
            assert 10 < len(message) < 2000, message
            return "refused"
    return "read"


def fuzz(reader: Reader, count: int, folder: Path, start: int = 0) -> Counter[str]:
    """Try so many mutated files of a kind; return how many were read and how many refused."""
    counts: Counter[str] = Counter()
    seeds = reader.seeds(folder)

    @seed(start)
    @examples(count)
    @given(mutated(seeds, TOKENS))
    def check(data: bytes) -> None:
        counts[outcome(reader, data, folder)] += 1

    check()
    return counts


def main() -> None:
    """Fuzz every reader as often as the command line says, and print what came out."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    for name in sys.argv[2:] or READERS:
        reader = READERS[name]
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            counts = fuzz(reader, count, Path(folder))
        seconds = time.monotonic() - began
        tried = f"{counts.total()} mutated files in {seconds:.0f} s"
        print(f"{name}: {tried}: {counts['read']} read, {counts['refused']} refused", flush=True)


if __name__ == "__main__":
    main()
