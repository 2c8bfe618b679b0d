"""Reading LabVIEW files against `lvm_read`, as a table: `lvm_reading` measures. Prints Markdown."""

import sys
import tempfile
from pathlib import Path

import lvm_reading as reading


def main() -> None:
    """Print time, memory and ratio for each way of writing the file; --quick: the first alone, fewer runs."""
    quick = "--quick" in sys.argv[1:]
    runs = 3 if quick else reading.RUNS
    print("\n| file | MB | ms | memory over the file | lvm_read: ms | memory | ratio | ratio of processor time |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        small = reading.write_lvm(reading.recording(100), Path(folder) / "small.lvm")
        files = reading.dialects(Path(folder))
        for name, path in list(files.items())[: 1 if quick else None]:
            size = path.stat().st_size
            ours = reading.timed(sys.executable, reading._OURS, small, path, runs)
            theirs = reading.timed(sys.executable, reading._PEER, small, path, max(runs // 3, 1))
            if ours is None or theirs is None:
                raise SystemExit("bayes_tyre or lvm_read is not installed here: make bench builds .venv-bench")
            print(
                f"| {name} | {size / 1e6:.1f} | {1e3 * ours.wall:.0f} | {ours.peak / size:.1f} | "
                f"{1e3 * theirs.wall:.0f} | {theirs.peak / size:.1f} | {theirs.wall / ours.wall:.1f} | "
                f"{theirs.cpu / ours.cpu:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
