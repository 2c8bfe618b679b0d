"""Least squares on many records: how time and memory grow. Run: python benchmarks/least_squares_scale.py.

Each size runs in a process of its own, so that its peak memory is its own. Prints seconds, peaks and ratios.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

#: Records, points a record, format.
SIZES = (
    (1_000, 100, "parquet"),
    (10_000, 100, "parquet"),
    (10_000, 40, "parquet"),
    (100_000, 40, "parquet"),
    (100_000, 40, "csv"),
)
STAGES = ("import", "read", "check", "fit", "fit again", "write")


def simulated(records: int, points: int) -> pd.DataFrame:
    """Return records of Equation 2 with noise, kN and mm: a lab's table, words and a pressure included."""
    rng = np.random.default_rng(0)
    k, beta = 1.6 * np.exp(rng.normal(0, 0.1, (records, 1))), 0.05 * np.exp(rng.normal(0, 0.3, (records, 1)))
    u = 3.0 * (1 - np.cos(np.pi * np.linspace(0, 1, points))) / 2
    force = 14.0 + (0.4 + k * u) * -np.expm1(-u / beta) + rng.normal(0, 0.03, (records, points))
    number = np.repeat(np.arange(records), points)
    return pd.DataFrame(
        {
            "record": pd.Series(number).map("record {}".format),
            "displacement_mm": np.tile(10.0 + u, records),
            "force_kN": force.ravel(),
            "configuration": np.where(number % 2, "single", "dual"),
            "direction": "loading",
            "speed_km_h": 5.0 * (number % 8),
            "repeat": number % 3 + 1,
            "pressure_bar": 7.0 + number / records,
            "origin": "simulated",
        }
    )


def peak_mb() -> float:
    """Return the most memory that this process ever held, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e6


def measure(path: Path) -> dict[str, float]:
    """Return wall seconds of each stage of `lsq` on a file, its peak memory and the table's own, MB."""
    found: dict[str, float] = {}

    def timed[T](stage: str, work: Callable[[], T]) -> T:
        start = time.perf_counter()
        result = work()
        found[stage] = time.perf_counter() - start
        return result

    def imported() -> None:
        from bayes_tyre.runtime import prepare_jax

        prepare_jax()
        import bayes_tyre.workflow.least_squares  # noqa: F401

    timed("import", imported)
    from bayes_tyre.formats.tables.table_files import read_table, write_table
    from bayes_tyre.inference.least_squares.table import fit_records
    from bayes_tyre.record_table import check_record_table

    table = timed("read", lambda: read_table(path))
    table = timed("check", lambda: check_record_table(table))
    found["peak before fit"] = peak_mb()
    fits = timed("fit", lambda: fit_records(table))
    found["peak"] = peak_mb()
    timed("fit again", lambda: fit_records(table))
    timed("write", lambda: write_table(fits, path.with_name("least_squares.csv")))
    return found | {"table": float(table.memory_usage(deep=True).sum()) / 1e6}


def in_a_process_of_its_own(path: Path) -> dict[str, float]:
    """Return `measure` of a file, in a fresh interpreter."""
    command = [sys.executable, __file__, str(path)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Measure every size and print what grows by how much."""
    if len(sys.argv) == 2:
        print(json.dumps(measure(Path(sys.argv[1]))))
        return
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for records, points, suffix in SIZES:
            path, table = Path(folder) / f"records.{suffix}", simulated(records, points)
            if suffix == "csv":
                table.to_csv(path, index=False)
            else:
                table.to_parquet(path, index=False)
            del table
            found = in_a_process_of_its_own(path)
            rows[records, points, suffix] = found
            stages = ", ".join(f"{stage} {found[stage]:.2f}" for stage in STAGES)
            print(f"{records} records x {points} points, {suffix}: {stages} s")
            memory = ", ".join(f"{name} {found[name]:.0f}" for name in ("table", "peak before fit", "peak"))
            print(f"  MB: {memory}", flush=True)
    few, many = rows[1_000, 100, "parquet"], rows[10_000, 100, "parquet"]
    print(f"10 times the records, compiled: {many['fit again'] / few['fit again']:.1f} times as long")
    small, large = rows[10_000, 40, "parquet"], rows[100_000, 40, "parquet"]
    above = [found["peak"] - found["peak before fit"] for found in (small, large)]
    print(f"the fit's own memory: {above[0]:.0f} MB at 10 000 records, {above[1]:.0f} MB at 100 000")


if __name__ == "__main__":
    main()
