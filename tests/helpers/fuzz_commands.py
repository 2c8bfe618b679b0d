"""Random command lines: exit 0, 2, 3 or 4, one line on stderr for 3, no traceback, no file but below --out.

As a program (`make fuzz`) it tries many more than the tests do: ``python -m helpers.fuzz_commands 1000``. Commands that
compute for minutes are given nothing that they could compute with: their refusals are tried.
"""

import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from helpers.command_line import here, small, tree_of, written
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from bayes_tyre.embedded import data_path

#: What is quick with any file, and what computes for long with a good one.
QUICK = ("lsq", "columns", "inspect", "calibrate", "show", "predict", "report", "export", "next", "compare", "modes")
SLOW = ("fit", "motion", "process", "load-deflection")
OPTIONS = [
    *(["--seed", "0"], ["--seed", "-1"], ["--seed", "x"], ["--quiet"], ["--interval", "0.5"], ["--interval", "nan"]),
    *(["--columns", "bad.toml"], ["--columns", "none.toml"], ["--columns", "map.toml"], ["--rig", "bad.toml"]),
    *(["--region", "thesis"], ["--fix", "k=1"], ["--fix", "k"], ["--bounds", "beta=:1"], ["--bounds", "k=2:1"]),
    *(["--loops"], ["--xlsx"], ["--resume"], ["--from", "bad.json"], ["--priors", "bad.toml"], ["--limit", "k >= x"]),
    *(["--case", "single (0)30-20"], ["--case", ""], ["--displacement", "0:4:9"], ["--displacement", "a"]),
    *(["--goal", "k dual / single"], ["--precision", "2%"], ["--to", "tir"], ["--cost", "bad.toml"], ["--beta", "inf"]),
    *(["--cluster", ""], ["--workers", "1"], ["--cases", "bad.csv"], ["--law", "spring"], ["--chains", "0"], ["-x"]),
    *(["--steps", "records.csv"], ["--unloaded-radius-mm", "-1"], ["--quantiles", "0.1,x"], ["--radius", "1e9"], []),
]
BAD = ["bad.csv", "bad.toml", "bad.json", "bad.lvm", "bad.nc", "bad.xlsx", "none.csv", "folder", "result", "", "\udcff"]
GOOD = ["records.csv", "step.lvm", "modes.csv", "map.toml"]


def pool(folder: Path) -> Path:
    """Write good files and bad ones into a folder, and a folder that looks like a result; return it."""
    folder.mkdir()
    written(small(), folder / "records.csv")
    (folder / "modes.csv").write_text("mode,frequency_Hz\n1,60\n2,88\n")
    (folder / "step.lvm").write_bytes(data_path("sample/appendix_b1.lvm").read_bytes())
    (folder / "map.toml").write_text('[constants]\nconfiguration = "A"\n')
    for name in BAD:
        if name.startswith("bad."):
            (folder / name).write_bytes(b"PK\x03\x04\xff\x00[[ not, what; it\tsays\n1,\xe9\n")
    (folder / "folder").mkdir()
    (folder / "result").mkdir()
    (folder / "result" / "run.json").write_text('{"command": "bayes-tyre fit x --out y", "options": 3}')
    (folder / "result" / "posterior.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(99))
    return folder


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """Draw a command, files for it and options, its own and others'."""
    command = draw(st.sampled_from((*QUICK, *SLOW)))
    files = draw(st.lists(st.sampled_from([*BAD, *GOOD] if command in QUICK else BAD), max_size=2))
    options = draw(st.lists(st.sampled_from(OPTIONS), max_size=1))
    # What most commands cannot do without, so that more of them get as far as their files.
    out = draw(st.sampled_from([["--out", "out"], ["--out", "out/deep.csv"], ["--out", "records.csv"], []]))
    needs = {"export": ["--to", "tir"], "next": ["--goal", "k dual / single", "--precision", "2%"]}.get(command, [])
    return [command, *files, *draw(st.sampled_from([needs, []])), *out, *(one for each in options for one in each)]


def outcome(line: list[str], folder: Path) -> int:
    """Run a command line in a folder; assert what every command promises; return its code."""
    before = tree_of(folder)
    done = here(*line)
    assert done.exit_code in (0, 2, 3, 4), (line, done.stderr)
    assert "Traceback" not in done.stderr, line
    lines = [one for one in done.stderr.splitlines() if not one.startswith("bayes-tyre: warning: ")]
    if done.exit_code == 3:
        assert len(lines) == 1, (line, done.stderr)
        assert lines[0].startswith("bayes-tyre: "), (line, done.stderr)
        assert lines[0].isprintable(), line
    after = tree_of(folder)
    beside = {name for name in after if name not in before and name.split("/")[0] != "out"}
    # Without --out these write where the result or the table lies, as their help says.
    assert not beside or "--out" not in line, (line, beside)
    changed = {name for name in before if after.get(name) != before[name]}
    assert changed <= ({"records.csv"} if "records.csv" in line else set()), (line, changed)
    return done.exit_code


def fuzz(examples: int, folder: Path, start: int = 0) -> Counter[int]:
    """Try so many command lines in a folder; return how often each code came out."""
    counts: Counter[int] = Counter()
    before = Path.cwd()

    @seed(start)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
    )
    @given(command_lines())
    def check(line: list[str]) -> None:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            os.chdir(pool(Path(place) / "pool"))
            counts[outcome(line, Path.cwd())] += 1
            os.chdir(folder)

    try:
        check()
    finally:
        os.chdir(before)
    return counts


def main() -> None:
    """Fuzz as often as the command line says, and print what came out."""
    examples = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        counts = fuzz(examples, Path(folder))
    seconds = time.monotonic() - began
    print(f"{counts.total()} command lines in {seconds:.0f} s, by exit code: {dict(sorted(counts.items()))}")


if __name__ == "__main__":
    main()
