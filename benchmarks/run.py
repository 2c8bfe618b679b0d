"""Every benchmark against its peers in one go. Run: python benchmarks/run.py [--quick]; writes benchmarks/results.md.

Each benchmark runs in a process of its own, one after another, under the same interpreter. A benchmark that fails
says so in its place, and the exit code is 1; the others still run.
"""

import os
import platform
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parent
#: Script, title.
BENCHMARKS = (
    ("least_squares_peers.py", "Least squares, record by record"),
    ("posterior_peers.py", "The hierarchical posterior of the reconstructed campaign"),
    ("posterior_growth.py", "The hierarchical posterior of many records"),
    ("fit_waiting.py", "What a user waits for at `fit`"),
    ("lvm_peers.py", "Reading LabVIEW files"),
)
PACKAGES = (
    *("bayes-tyre", "jax", "numpyro", "optimistix", "numpy", "scipy", "pandas"),
    *("lmfit", "pymc", "pytensor", "nutpie", "numba", "arviz", "lvm_read"),
)


def processor() -> str:
    """Return the name of the processor, where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def load() -> str:
    """Return how busy the machine is: processes that want a core, a minute's mean; empty where not told."""
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""


def measured(script: str, title: str, quick: bool) -> tuple[str, bool]:
    """Return a section of the report, and whether the benchmark ran."""
    command = [sys.executable, str(HERE / script), *(["--quick"] if quick else [])]
    print(f"{title} ...", file=sys.stderr, flush=True)
    before, began = load(), time.perf_counter()
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    seconds = time.perf_counter() - began
    shown = f"python benchmarks/{script}{' --quick' if quick else ''}"
    text = f"## {title}\n\n`{shown}`, {seconds:.0f} s, load before it {before}.\n{done.stdout}"
    return (text if done.returncode == 0 else f"{text}\nFailed with code {done.returncode}.\n"), done.returncode == 0


def main() -> None:
    """Run all, write the report whole, and print it."""
    quick = "--quick" in sys.argv[1:]
    sections, fine = zip(*(measured(script, title, quick) for script, title in BENCHMARKS), strict=True)
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    head = (
        "# Results\n\n"
        f"`python benchmarks/run.py{' --quick' if quick else ''}` on {os.cpu_count()} cores of {processor()}, "
        f"{platform.system()}, Python {platform.python_version()}. Times depend on the machine and on what else it "
        f"does (the load says how much): read the ratios.\n\n{versions}.\n"
    )
    report = "\n".join([head, *sections])
    beside = HERE / "results.md.part"
    beside.write_text(report)
    beside.replace(HERE / "results.md")
    print(report)
    sys.exit(0 if all(fine) else 1)


if __name__ == "__main__":
    main()
