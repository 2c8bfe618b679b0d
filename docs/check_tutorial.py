"""Run what pages of the documentation show, and compare what is printed with what they show.

`python docs/check_tutorial.py [PAGE...]`, by default the tutorial. In a folder of its own, with `data/` and the
installed command at hand, it runs every ``console`` block (lines after ``$``) and every ``pycon`` block of a page, in
the order of the page; blocks of other kinds, such as ``sh``, are not run.

Words and whole numbers must be the same. A number with a decimal point may differ by one unit of the last digit shown
or by 2 %: on one machine the same seed gives the same bytes, on another processor sums are rounded otherwise and chains
diverge. The number of differences and the largest are printed; ``--exact`` allows none. An ellipsis on a page matches
any text, and a run of spaces any other run of spaces.
"""

import argparse
import doctest
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
TUTORIAL = HERE / "tutorial.md"
LARGEST_DIFFERENCE = 0.02
_BLOCK = re.compile(r"^```(console|pycon)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_PART = re.compile(rf"(?P<any>\.\.\.|…)|(?P<number>{_NUMBER})|(?P<space>\s+)|(?P<rule>[─━]+)|(?P<text>.)", re.DOTALL)


class Difference(NamedTuple):
    """How an output differs from what a page shows.

    Attributes
    ----------
    words_differ:
        Whether its text differs, a whole number does, or another number by more than is allowed.
    numbers:
        Relative differences of the numbers with a decimal point that are not the same.
    """

    words_differ: bool
    numbers: tuple[float, ...] = ()


def compare(shown: str, printed: str) -> Difference:
    """Return how what was printed differs from what is shown."""
    patterns, numbers = [], []
    for part in _PART.finditer(shown.strip()):
        if part["number"] and re.fullmatch(r"[-+]?\d+", part["number"]):
            patterns.append(re.escape(part["number"]) + r"(?![\d.]*\d)")
        elif part["number"]:
            numbers.append(part["number"])
            patterns.append(f"({_NUMBER})")
        elif part["any"]:
            patterns.append(".*?")
        elif part["space"]:
            patterns.append(r"\s*\n\s*" if "\n" in part["space"] else r"[ \t]+")
        else:
            patterns.append("[─━]+" if part["rule"] else re.escape(part["text"]))
    match = re.fullmatch("".join(patterns), printed.strip(), re.DOTALL)
    if match is None:
        return Difference(words_differ=True)
    differences = []
    for one, other in zip(numbers, match.groups(), strict=True):
        last_digit = 10.0 ** -len(re.sub(r"e.*", "", one).partition(".")[2])
        distance = abs(float(one) - float(other))
        if distance > 0:
            differences.append(distance / max(abs(float(one)), last_digit))
        if distance > max(1.000001 * last_digit, LARGEST_DIFFERENCE * abs(float(one))):
            return Difference(words_differ=True, numbers=tuple(differences))
    return Difference(words_differ=False, numbers=tuple(differences))


class Checker(doctest.OutputChecker):
    """Doctest's checker with the comparison of this module; collects the relative differences of numbers."""

    def __init__(self) -> None:
        self.differences: list[float] = []

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        """Return whether the printed output agrees with the one shown, and collect the differences of its numbers."""
        del optionflags
        difference = compare(want.replace(doctest.BLANKLINE_MARKER, ""), got)
        self.differences += difference.numbers
        return not difference.words_differ


def commands(block: str) -> list[tuple[str, str]]:
    """Return the commands of a console block, each with the output shown; ``>`` continues a command."""
    examples: list[tuple[list[str], list[str]]] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            examples.append(([line[2:]], []))
        elif line.startswith("> ") and not examples[-1][1]:
            examples[-1][0].append(line[2:])
        else:
            examples[-1][1].append(line)
    return [("\n".join(command), "\n".join(shown)) for command, shown in examples]


def run_page(page: Path, folder: Path) -> tuple[int, list[float]]:
    """Run a page's blocks in a folder; print what differs; return how many outputs do, and the numbers' differences."""
    checker, names, failed = Checker(), {}, 0
    runner = doctest.DocTestRunner(checker, verbose=False)
    for kind, block in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "pycon":
            example = doctest.DocTestParser().get_doctest(block, names, page.name, str(page), 0)
            failed += runner.run(example, clear_globs=False).failed
            names = example.globs
            continue
        for command, shown in commands(block):
            done = subprocess.run(
                ["bash", "-c", command], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            )
            if not checker.check_output(shown, done.stdout, 0):
                failed += 1
                print(f"{page.name}: $ {command}\nshown:\n{shown}\nprinted:\n{done.stdout}")
    return failed, checker.differences


def check(page: Path, exact: bool) -> int:
    """Check one page in a folder of its own; return 1 where an output is not what it shows."""
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    os.environ["COLUMNS"] = "100"
    os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"  # on a busy machine XLA says that it compiles slowly: no output of ours
    with tempfile.TemporaryDirectory() as away:
        (Path(away) / "data").symlink_to(HERE.parent / "data")
        os.chdir(away)
        failed, differences = run_page(page, Path(away))
        os.chdir(HERE)
    most = f", by at most {100 * max(differences):.2g} %" if differences else ""
    print(f"{page.name}: {failed} outputs differ; {len(differences)} numbers differ within bounds{most}")
    return 1 if failed or (exact and differences) else 0


def main() -> int:
    """Check the pages named, each in a process of its own; return 1 where an output is not what they show."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", type=Path, default=[TUTORIAL])
    parser.add_argument("--exact", action="store_true", help="let no number differ")
    options = parser.parse_args()
    pages = [page.resolve() for page in options.pages]
    if len(pages) == 1:
        return check(pages[0], options.exact)
    # JAX fixes its devices when it starts, and with other devices sums are rounded otherwise.
    flags = ["--exact"] if options.exact else []
    codes = [subprocess.run([sys.executable, __file__, str(page), *flags]).returncode for page in pages]
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
