"""Folders of results whose files are mutated, cut short, swapped or missing: each command ends as it promises.

As a program (`make fuzz`) it tries many more than the tests do: ``python -m helpers.fuzz_folders 1000``.
"""

import os
import shutil
from collections import Counter
from pathlib import Path

from helpers.command_line import here, small, written
from helpers.fuzz_commands import outcome
from helpers.fuzz_lvm import mutated
from helpers.fuzz_readers import TOKENS
from helpers.fuzz_settings import examples, fuzz_for_long
from helpers.mutated_files import MEANING
from helpers.quick_fits import write_result
from helpers.reported_motions import write_motions
from hypothesis import given, seed
from hypothesis import strategies as st

#: A result of each kind; `again` is what `fit` is, so that they can be compared.
RESULTS = ("fit", "again", "motion", "lsq")
#: What reads a folder, without the folder.
READS = (
    *(("show",), ("show", "--limit", "k >= 1.8"), ("show", "--reference", "single"), ("show", "again")),
    *(("report", "--kept-figures"), ("report", "--kept-figures", "again"), ("compare", "again", "--no-refit")),
    *(("predict", "--case", "direction=unloading"), ("predict", "--case", "single (0)20-30", "--of", "repeat")),
    *(("export", "--to", "tir"), ("export", "--to", "tydex"), ("export", "--to", "csv-spline")),
    ("export", "--to", "modelica", "--quantiles", "0.1,0.9"),
    *(("next", "--goal", goal, "--precision", "2%") for goal in ("k single (0)20-30", "beta loading / unloading")),
    ("next", "--goal", "ranking k", "--precision", "2%"),
)


def results(folder: Path) -> Path:
    """Write a result of each kind, and the table that three of them are of; return the folder."""
    folder.mkdir()
    write_result(folder / "fit")
    (folder / "fit.csv").unlink()
    written(small(), folder / "records.csv")
    shutil.copytree(folder / "fit", folder / "again")
    write_motions(folder / "motion")
    done = here("lsq", folder / "records.csv", "--out", folder / "lsq", "--quiet")
    assert done.exit_code == 0, done.stderr
    return folder


@st.composite
def damaged(draw: st.DrawFn, whole: Path, into: Path) -> list[str]:
    """Copy the results, damage one of them in one to three places, and return a command line that reads it."""
    shutil.copytree(whole, into)
    name = draw(st.sampled_from(RESULTS))
    for _ in range(draw(st.integers(1, 3))):
        files = sorted(path for path in (into / name).rglob("*") if path.is_file())
        if files:
            _damage(draw, draw(st.sampled_from(files)), whole)
    command, *options = draw(st.sampled_from(READS))
    return [command, name, *options, *([] if command == "show" else ["--out", "out"])]


def _damage(draw: st.DrawFn, path: Path, whole: Path) -> None:
    way = draw(st.integers(0, 9))
    if way == 0:
        path.unlink()
    elif way == 1:
        path.unlink()
        path.mkdir()
    elif way == 2:
        other = draw(st.sampled_from(sorted(one for one in whole.rglob("*") if one.is_file())))
        shutil.copyfile(other, path)
    elif way == 3:
        data = path.read_bytes()
        path.write_bytes(data[: draw(st.integers(0, len(data)))])
    elif way in (4, 5) or path.suffix not in MEANING:
        path.write_bytes(draw(mutated([path.read_bytes()], TOKENS)))
    else:
        try:
            MEANING[path.suffix](draw, path)
        except Exception as error:  # damaged before, or not to be written so
            path.write_text(str(error))


def fuzz(count: int, folder: Path, start: int = 0) -> Counter[int]:
    """Try so many damaged results in a folder; return how often each code came out."""
    counts: Counter[int] = Counter()
    before, whole, place = Path.cwd(), results(folder / "whole"), folder / "damaged"

    @seed(start)
    @examples(count)
    @given(st.data())
    def check(data: st.DataObject) -> None:
        shutil.rmtree(place, ignore_errors=True)
        line = data.draw(damaged(whole, place))
        os.chdir(place)
        try:
            counts[outcome(line, place)] += 1
        finally:
            os.chdir(before)

    check()
    return counts


if __name__ == "__main__":
    fuzz_for_long(fuzz, "damaged results")
