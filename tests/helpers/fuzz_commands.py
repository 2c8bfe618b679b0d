"""Random command lines: exit 0, 2, 3 or 4, one line on stderr for 3, no traceback, no file but below --out.

As a program (`make fuzz`) it tries many more than the tests do: ``python -m helpers.fuzz_commands 1000``. What computes
for minutes is put there: draws of `fit`, draws and estimates of `motion`; of `study` only refusals are tried.
"""

import shutil
from collections import Counter
from pathlib import Path
from random import Random
from typing import cast

import pytest
import typer
from helpers.command_line import here, small, tree_of, written
from helpers.fuzz_settings import fuzz_for_long
from helpers.quick_fits import put_draws_for_the_sampler, write_result
from helpers.quick_motions import put_draws_for_the_motions
from helpers.short_recordings import write_recordings
from typer.core import TyperGroup

from bayes_tyre.cli import app
from bayes_tyre.embedded import data_path
from bayes_tyre.report.figures import catalogue

_GROUP = cast(TyperGroup, typer.main.get_command(app))
COMMANDS = (
    *("lsq", "columns", "inspect", "calibrate", "show", "predict", "report", "export", "next", "compare", "modes"),
    *("load-deflection", "fit", "fit", "motion", "process", "process", "study"),
)
#: What a command cannot do without, or computes for long without.
NEEDS = {
    "export": ("--to", "tir"),
    "next": ("--goal", "k dual / single", "--precision", "2%"),
    "motion": ("--workers", "1"),
    "process": ("--workers", "1"),
}
#: What a command can read, of the good files.
READABLE = {
    **dict.fromkeys(("lsq", "fit", "columns", "load-deflection"), "records.csv"),
    **dict.fromkeys(("show", "predict", "report", "export", "next", "compare"), "fitted"),
    **dict.fromkeys(("motion", "process", "inspect"), "raw"),
    **{"calibrate": "step.lvm", "modes": "modes.csv"},
}
#: Each is refused before it simulates anything: by its options, or by a file in the place of its folder.
STUDIES = (
    *(("coverage", "--kinds", "none", "--out", "out"), ("coverage", "--sets", "0"), ("outliers", "--campaigns", "0")),
    *(("calibration", "--datasets", "1"), ("laws", "--law", "spring"), ("motion", "--stationary", "-1"), ("none",)),
    *((name, "--out", "records.csv") for name in ("coverage", "outliers", "calibration", "laws", "motion")),
)


def _options(texts: str) -> list[list[str]]:
    """Return options, each with its value if it has one, from a text in which semicolons separate them."""
    return [one.split(maxsplit=1) for one in texts.split(";")]


#: What some command takes; and what none does, or none with this value.
OPTIONS = _options("""
--seed 0; --quiet; --interval 0.5; --columns bad.toml; --columns none.toml; --columns map.toml; --rig bad.toml; --loops;
--rig single; --region thesis; --fix k=1; --bounds beta=:1; --xlsx; --resume; --from bad.json; --from fitted/run.json;
--priors bad.toml; --case single (0)30-20; --displacement 0:4:9; --of repeat; --goal ranking k; --cost bad.toml;
--cases bad.csv; --cases records.csv; --method thesis; --figures out/figures; --figures records.csv; --record-draws 1;
--repeats student; --limit k >= 1.8; --reference dual; --noise ar1; --no-refit; --steps records.csv; --kept-figures;
--units-checked; --to tydex; --quantiles 0.1,0.9; --law small_step_limit; --amplitude 2;
--radius 1e9; --truth records.csv; --limit beta < 0.1; --reference single; --displacement-sd 0.01
""")
WRONG = _options("""
--seed -1; --seed x; --interval nan; --fix k; --bounds k=2:1; -x; --beta; --limit k >= x; --case ; --displacement a;
--cluster ; --law spring; --out; --chains 0; --unloaded-radius-mm -1; --quantiles 0.1,x; --repeats none; --to x;
--draws 3; --displacement-sd -1; --target-accept 2; --amplitude 0; --goal k; --interval 1; --precision x; --workers 0
""")
BAD = ["bad.csv", "bad.toml", "bad.json", "bad.lvm", "bad.nc", "bad.xlsx", "none.csv", "folder", "result", "", "\udcff"]
GOOD = ["records.csv", "records.csv", "step.lvm", "modes.csv", "map.toml", "raw", "fitted"]


def pool(folder: Path) -> Path:
    """Write good files and bad ones into a folder, and a folder that looks like a result; return it."""
    folder.mkdir()
    written(small(), folder / "records.csv")
    (folder / "modes.csv").write_text("mode,frequency_Hz\n1,60\n2,88\n")
    (folder / "step.lvm").write_bytes(data_path("sample/appendix_b1.lvm").read_bytes())
    write_recordings(folder / "raw")
    write_result(folder / "fitted")
    (folder / "fitted.csv").unlink()
    (folder / "map.toml").write_text('[constants]\nconfiguration = "A"\n')
    for name in BAD:
        if name.startswith("bad."):
            (folder / name).write_bytes(b"PK\x03\x04\xff\x00[[ not, what; it\tsays\n1,\xe9\n")
    (folder / "folder").mkdir()
    (folder / "result").mkdir()
    (folder / "result" / "run.json").write_text('{"command": "bayes-tyre fit x --out y", "options": 3}')
    (folder / "result" / "posterior.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(99))
    return folder


def command_line(random: Random) -> list[str]:
    """Return a command, files for it and options: mostly what it takes, so that most get as far as their files."""
    command = random.choice(COMMANDS)
    if command == "study":
        return [command, *random.choice(STUDIES)]
    takes = {flag for option in _GROUP.commands[command].params for flag in option.opts}
    among = [each for each in OPTIONS if each[0] in takes] if random.random() < 0.9 else WRONG
    options = random.sample(among, min(len(among), random.randint(0, 2)))
    files = random.choices([*BAD, *GOOD], k=random.choices([0, 1, 2], [1, 7, 4])[0])
    files = [READABLE[command]] if random.random() < 0.4 else files
    out = random.choice(["out", "out", "out/deep.csv", "out/deep", "records.csv"])
    asked = ["--out", out] if "--out" in takes and random.random() < 0.9 else []
    return [command, *files, *NEEDS.get(command, ()), *asked, *(one for each in options for one in each)]


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
    # As their help says: without --out some write where the result or the table lies, and process beside its table.
    beside = {name for name in beside if line[0] != "process" or not name.startswith(("rejected.csv", ".records.csv."))}
    assert not beside or "--out" not in line, (line, beside)
    changed = {name for name in before if after.get(name) != before[name]}
    assert changed <= ({"records.csv"} if "records.csv" in line else set()), (line, changed)
    return done.exit_code


def fuzz(examples: int, folder: Path, start: int = 0) -> Counter[int]:
    """Try so many command lines in a folder; return how often each code came out."""
    random, counts = Random(start), Counter[int]()
    before, whole, place = Path.cwd(), pool(folder / "whole"), folder / "tried"
    with pytest.MonkeyPatch.context() as monkeypatch:
        put_draws_for_the_sampler(monkeypatch)
        put_draws_for_the_motions(monkeypatch)
        monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
        for _ in range(examples):
            shutil.rmtree(place, ignore_errors=True)
            shutil.copytree(whole, place)
            monkeypatch.chdir(place)
            counts[outcome(command_line(random), place)] += 1
            monkeypatch.chdir(before)
    return counts


if __name__ == "__main__":
    fuzz_for_long(fuzz, "command lines")
