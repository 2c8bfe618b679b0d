"""What a user waits for at `bayes-tyre fit` of the reconstructed campaign: to the printed answer, and to all files.

Run ``python benchmarks/fit_waiting.py [--quick]``; prints a Markdown table. Seconds from the start of the process, with
no compiled code and then with the code that the first run kept (--quick: these two alone; else three more of the
latter). CPU is user and system time of the command and of what it started: what else the machine does hardly shows in
it.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

RECORDS = Path(__file__).parents[1] / "data" / "campaign" / "records.csv"
#: What the line begins with that gives the verdict.
ANSWER = "answer after"
REPEATS = 3


class Waited(NamedTuple):
    """Seconds from the start of the process to its answer and to its end, and CPU seconds."""

    answer: float
    end: float
    cpu: float


def waited(cache: Path, out: Path) -> Waited:
    """Fit the campaign in a process of its own, and return how long a user waits; compiled code is kept in `cache`."""
    command = [sys.executable, "-m", "bayes_tyre", "fit", str(RECORDS), "--out", str(out)]
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(cache), "PYTHONUNBUFFERED": "1"}
    before, began, answer = _children_cpu(), time.perf_counter(), float("nan")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith(ANSWER):
                answer = time.perf_counter() - began
    end = time.perf_counter() - began
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with code {process.returncode}")
    return Waited(answer, end, _children_cpu() - before)


def _children_cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Fit with nothing compiled, then with what was, and print what was waited for."""
    warm_runs = 1 if "--quick" in sys.argv[1:] else REPEATS
    with tempfile.TemporaryDirectory() as folder:
        runs = [waited(Path(folder) / "cache", Path(folder) / f"fit{i}") for i in range(1 + warm_runs)]
    print("\n| compiled code | to the printed answer, s | to all files, s | CPU, s |")
    print("|---|---|---|---|")
    for name, each in (("none", runs[:1]), ("kept", runs[1:])):
        cells = [_range([run[i] for run in each]) for i in range(len(Waited._fields))]
        print(f"| {name} | {' | '.join(cells)} |")


def _range(values: list[float]) -> str:
    """Return the median, and the range of several values."""
    middle = sorted(values)[len(values) // 2]
    return f"{middle:.1f}" if len(values) == 1 else f"{middle:.1f} ({min(values):.1f} to {max(values):.1f})"


if __name__ == "__main__":
    main()
