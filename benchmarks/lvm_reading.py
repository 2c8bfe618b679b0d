"""How fast a LabVIEW file of 150,000 x 8 numbers is read, against the PyPI package `lvm_read`, and in what memory.

Run ``python benchmarks/lvm_reading.py``; with ``--peer PYTHON`` the package is looked for in another interpreter, such
as that of a throw-away environment. Times are the least of several runs: of the clock, and of all cores together (on a
busy machine only those mean something); only their ratios do anyway. Memory is the peak (Linux) above what the process
held before the first large file.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bayes_tyre.formats.lvm.write import write_lvm
from bayes_tyre.record import Channel, RawSignals

ROWS, CHANNELS, RUNS = 150_000, 7, 15
#: What the reader must keep: times the speed of the package, and times the file in memory.
LEAST_RATIO, MOST_MEMORY = 10, 10
_TIMED = """
import sys, time
{imports}

def peak():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmHWM"))

small, path, runs = sys.argv[1], sys.argv[2], int(sys.argv[3])
read(small)
before, wall, cpu = peak(), [], []
for _ in range(runs):
    began, used = time.perf_counter(), time.process_time()
    read(path)
    wall.append(time.perf_counter() - began)
    cpu.append(time.process_time() - used)
print(min(wall), min(cpu), peak() - before)
"""
_OURS = """from pathlib import Path
from bayes_tyre.formats.lvm.reader import read_lvm
read = lambda name: read_lvm(Path(name))"""
_PEER = "import lvm_read\nread = lambda name: lvm_read.read(name, read_from_pickle=False, dump_file=False)"


def recording(rows: int) -> RawSignals:
    """Return seven channels of noise at 10 kHz."""
    rng = np.random.default_rng(0)
    times = np.arange(rows) * 1e-4
    return RawSignals((tuple(Channel(f"channel {i}", "V", times, rng.normal(size=rows)) for i in range(CHANNELS)),))


def dialects(folder: Path) -> dict[str, Path]:
    """Write the same numbers in several ways; return the files."""
    plain = write_lvm(recording(ROWS), folder / "plain.lvm")
    content = plain.read_bytes()
    rows = content.index(b"\tComment\n") + len(b"\tComment\n")
    head, body = content[:rows], content[rows:]
    first, rest = body.split(b"\n", 1)
    variants = {
        "a comment in the first row": head + first + b"\t06:04:45\n" + rest,
        "line ends of Windows": content.replace(b"\n", b"\r\n"),
        "decimal commas": content.replace(b".", b","),
        "rows of unequal length": head + body.replace(b"1\n", b"1\tcomment\n"),
    }
    files = {"as LabVIEW writes it": plain}
    for name, text in variants.items():
        files[name] = folder / f"{name}.lvm"
        files[name].write_bytes(text)
    return files


class Cost(NamedTuple):
    """What reading takes: seconds of the clock, seconds of all cores, bytes."""

    wall: float
    cpu: float
    peak: float


def timed(python: str, imports: str, small: Path, path: Path, runs: int) -> Cost | None:
    """Return what reading takes in a process of its own; None if the package is not there."""
    script = [python, "-c", _TIMED.format(imports=imports), str(small), str(path), str(runs)]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    if done.returncode:
        if "ModuleNotFoundError" in done.stderr:
            return None
        raise RuntimeError(done.stderr)
    return Cost(*map(float, done.stdout.split()))


def told(name: str, size: int, ours: Cost, theirs: Cost | None) -> str:
    """Return a line on one file."""
    line = f"{name}: {size / 1e6:.1f} MB, {1e3 * ours.wall:.0f} ms, memory {ours.peak / size:.1f} x the file"
    if theirs is None:
        return line
    beside = f"lvm_read {1e3 * theirs.wall:.0f} ms, {theirs.peak / size:.1f} x"
    return f"{line}; {beside}; ratio {theirs.wall / ours.wall:.1f} (all cores {theirs.cpu / ours.cpu:.1f})"


def main() -> None:
    """Print time, ratio and memory for each way of writing the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", default=sys.executable, metavar="PYTHON", help="interpreter that has lvm_read")
    peer = parser.parse_args().peer
    with tempfile.TemporaryDirectory() as folder:
        small = write_lvm(recording(100), Path(folder) / "small.lvm")
        theirs = None
        for name, path in dialects(Path(folder)).items():
            ours = timed(sys.executable, _OURS, small, path, RUNS)
            theirs = timed(peer, _PEER, small, path, max(RUNS // 3, 1))
            if ours is None:
                raise SystemExit("bayes_tyre is not installed here")
            print(told(name, path.stat().st_size, ours, theirs), flush=True)
        if theirs is None:
            print(f"no lvm_read in {peer}: python -m venv /tmp/peer && /tmp/peer/bin/pip install lvm_read, then --peer")
        print(f"wanted: ratio {LEAST_RATIO} at least, memory below {MOST_MEMORY} x the file")


if __name__ == "__main__":
    main()
