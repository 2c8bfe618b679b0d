"""The documentation: its examples are true, its tables are the program's, and its checkers find faults."""

import importlib.util
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from helpers.command_line import COMMANDS

from bayes_tyre.cli import shell
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.record import FACTORS, REQUIRED
from bayes_tyre.results import contrasts, summary

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def loaded(name: str) -> ModuleType:
    """Return a module of `docs/`, which is no package."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


tutorial, links, source = loaded("check_tutorial"), loaded("check_links"), loaded("from_source")


def text(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


def test_the_law_written_in_the_how_to_is_one(tmp_path):
    assert ">>> class Slider(StatefulLaw):" in text("howto/own_law.md")
    failed, off = tutorial.run_page(DOCS / "howto/own_law.md", tmp_path)
    assert (failed, off) == (0, [])


def test_own_priors_are_those_that_the_page_shows(tmp_path):
    page = text("howto/own_priors.md")
    cheap = page.split(">>> import bayes_tyre as bt")[0]
    part = tmp_path / "page.md"
    part.write_text(cheap.rstrip() + "\n```\n", encoding="utf-8")
    failed, _ = tutorial.run_page(part, tmp_path)
    assert failed == 0
    file = tomllib.loads(page.split("```toml")[1].split("```")[0])
    assert set(PRIORS.changed(file).changes_from(PRIORS)) == set(file)


SHOWN = "24 records, k 1.864 [1.81, 1.908]\n  file   DynamicS(0)30-20(1)\ndone in ... s"


@pytest.mark.parametrize(
    ("printed", "same"),
    [
        (SHOWN.replace("...", "17"), True),
        ("24 records, k 1.864 [1.81, 1.908]  \n\n  file DynamicS(0)30-20(1)\ndone in 3 s", True),
        ("24 records, k 1.88 [1.82, 1.9]\n  file   DynamicS(0)30-20(1)\ndone in 17 s", True),
        ("24 records, k 1.91 [1.81, 1.908]\n  file   DynamicS(0)30-20(1)\ndone in 17 s", False),
        ("25 records, k 1.864 [1.81, 1.908]\n  file   DynamicS(0)30-20(1)\ndone in 17 s", False),
        ("24 records, k 1.864 [1.81, 1.908]\n  file   DynamicS(0)30-20(2)\ndone in 17 s", False),
        ("24 records, beta 1.864 [1.81, 1.908]\n  file   DynamicS(0)30-20(1)\ndone in 17 s", False),
        ("24 records, k 1.864 [1.81, 1.908]\n  file   DynamicS(0)30-20(1)", False),
    ],
)
def test_an_output_is_compared_by_its_words_and_within_two_per_cent(printed, same):
    assert tutorial.compare(SHOWN, printed).words_differ is not same


def test_numbers_that_differ_are_told():
    assert tutorial.compare("k 2.00", "k 2.02").numbers == pytest.approx((0.01,))
    assert tutorial.compare("k 2.00", "k 2.00").numbers == ()
    assert not tutorial.compare("p 0.001", "p 0.002").words_differ  # a unit of the last digit shown
    assert tutorial.compare("p 0.001", "p 0.004").words_differ


def test_a_page_that_shows_what_is_not_printed_is_told(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text(
        "```console\n$ echo one; \\\n> echo two\none\ntwo\n$ echo three\nfour\n```\n"
        "```pycon\n>>> 1 + 1\n3\n```\n```sh\nexit 1\n```\n",
        encoding="utf-8",
    )
    failed, _ = tutorial.run_page(page, tmp_path)
    assert failed == 2
    assert "$ echo three\nshown:\nfour\nprinted:\nthree" in capsys.readouterr().out


def test_dead_links_and_what_a_network_would_serve_are_found(tmp_path):
    (tmp_path / "index.html").write_text(
        '<h1 id="top"></h1><a href="other.html#here">x</a><a href="#top">x</a><a href="https://example.org">x</a>'
        '<a href="gone.html">x</a><a href="other.html#there">x</a><script src="https://example.org/x.js"></script>'
        '<link rel="stylesheet" href="//example.org/x.css"><link rel="next" href="other.html">',
        encoding="utf-8",
    )
    (tmp_path / "other.html").write_text('<p id="here"></p>', encoding="utf-8")
    (tmp_path / "x.css").write_text("@font-face { src: url('https://example.org/font') }", encoding="utf-8")
    assert links.faults(tmp_path) == [
        "index.html: loads //example.org/x.css from a network",
        "index.html: gone.html leads nowhere",
        "index.html: loads https://example.org/x.js from a network",
        "index.html: other.html#there leads to a page that has no such place",
        "x.css: loads from a network",
    ]


def test_every_command_and_every_prior_has_its_place_in_the_reference():
    helps = dict(source.commands())
    assert {*COMMANDS, "study", "study calibration", "study outliers", ""} <= set(helps)
    assert all(shown.startswith("Usage: bayes-tyre") and "--help" in shown for shown in helps.values())
    rows = source.prior_rows()
    assert [row[0] for row in rows] == list(PRIORS)
    assert [row[-1] for row in rows] == [prior.reason for prior in PRIORS.values()]
    assert rows[0][:3] == ("k_group", "LogNormal(0, 1)", "1 (0.14 to 7.1) kN/mm")


def test_every_law_has_its_place_in_the_reference():
    modules = {path.stem for path in (ROOT / "bayes_tyre" / "laws").glob("*.py")} - {"__init__"}
    assert set(re.findall(r"automodule:: bayes_tyre\.laws\.(\w+)", text("reference/laws.md"))) == modules


def test_files_and_names_in_contributing_are_there():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rooms = ("bayes_tyre", "tests", "docs", "benchmarks", "notebooks", "data")
    files = [path for room in rooms for path in (ROOT / room).glob("**/*.*")]
    ends = "\n".join(f"{path.as_posix()}\n" for path in [*files, ROOT / "README.md"])
    named = {name for name in re.findall(r"`([\w/]+\.(?:py|md))`", page) if "NAME" not in name}
    assert {name for name in named if f"/{name}\n" not in ends} == set()
    code = "\n".join(path.read_text(encoding="utf-8") for path in files if path.suffix == ".py")
    constants = set(re.findall(r"`(_?[A-Z]+_?[A-Z_]+)`", page))
    assert {name for name in constants if not re.search(rf"^{name}\b", code, re.MULTILINE)} == set()


def test_every_check_of_a_result_is_in_the_table_of_checks():
    files = (ROOT / "bayes_tyre" / "inference" / "diagnostics").glob("*.py")
    code = "\n".join(path.read_text(encoding="utf-8") for path in files)
    names = set(re.findall(r'Check\(\s*"(\w+)", "(?:sampling|model|data)"', code))
    assert {"r_hat", "record_curves", "records"} <= names
    table = text("reference/files.md").split("| check | limit |")[1].split("\n\n")[0]
    assert names <= set(re.findall(r"`(\w+)`", table))


def test_columns_and_exit_codes_are_the_programs():
    page = text("reference/files.md")
    named = set(re.findall(r"`([A-Za-z_0-9]+)`", page))
    assert {*REQUIRED, *FACTORS, *summary.STATISTICS} <= named
    assert set(contrasts.COLUMNS) - set(FACTORS) <= named
    for code in (shell.BAD_INPUT, shell.NOT_TRUSTED):
        assert f"\n| {code} |" in page


def test_docstrings_are_made_ready_for_sphinx():
    said = ["Return |u|.", "", "Attributes", "----------", "low, high:", "    Bounds, mm, of `|u|`.", ""]
    end = ["Raises", "------", "BadInput", "    For |x|.", "", "Source: Eq. 2."]
    assert source.ready([*said, *end]) == [
        *(r"Return \|u\|.", "", "Fields", "----------", "``low``, ``high``", "    Bounds, mm, of `|u|`.", ""),
        *("Raises", "------", "bayes_tyre.errors.BadInput", r"    For \|x\|.", "", "Source", "------", "Eq. 2."),
    ]
    prose = ["Returns", "-------", "Force, kN,", "in shape (points,)."]
    assert source.ready(prose) == [*prose[:2], ":", "    Force, kN,", "    in shape (points,)."]
    typed = ["Returns", "-------", "pandas.DataFrame", "    The columns."]
    assert source.ready(typed) == typed


def test_the_glossary_is_in_alphabetical_order():
    body = text("glossary.md").split("```{glossary}\n")[1].split("```")[0]
    terms = [line for line in body.splitlines() if line and not line.startswith(" ")]
    assert {"k", "beta", "C", "J", "F_i", "sigma", "d_i", "x", "m", "c"} <= set(terms)
    assert [term.lower() for term in terms] == sorted(term.lower() for term in terms)


def test_the_version_to_cite_is_the_projects():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"\nversion: {project['version']}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_project_metadata_agree_with_each_other():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    heading = next(
        line for line in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines() if line[:3] == "## "
    )
    assert heading.split()[1] == project["version"]
    assert f"version: {project['version']}" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    least = project["requires-python"].removeprefix(">=")
    assert f"Programming Language :: Python :: {least}" in project["classifiers"]
