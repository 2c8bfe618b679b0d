"""Labels are text wherever they go: never a path, never a formula, never markup, never cut or joined."""

import csv
from pathlib import Path

import pandas as pd
import pytest
from helpers.command_line import (
    COMMAND,
    FIT_FILES,
    OUTLIERS_PNG,
    TABLES,
    environment,
    files_of,
    finish,
    here,
    small,
    start,
    start_as,
    tree_of,
)
from helpers.quick_fits import put_draws_for_the_sampler

from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.formats.tables.table_files import read_table, write_table

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

LABELS = {
    "path": "../../x",
    "path of root": "/etc/passwd",
    "formula": "=cmd()",
    "formula by its sign": "-2+3",
    "formula after a tab": "\t@SUM(1)",
    "formula made harmless": "'=cmd()",
    "script": "<script>alert(1)</script>",
    "mathtext": "$x^$",
    "broken mathtext": r"\frac{$",
    "markup": "[red]x[/red]",
    "closing markup": "[/]",
    "emoji by name": ":smile:",
    "emoji": "\N{DELIVERY TRUCK}\N{VARIATION SELECTOR-16}",
    "unicode": "Reifen ⌀ ü",
    "right to left": "\u0625\u0637\u0627\u0631 \u202eabc",
    "two lines": "two\nlines",
    "carriage return": "two\rlines",
    "escape": "\x1b[31mred\x07",
    "separators": 'a,b;c\t"d"',
    "formats": "%s%n{}{0}",
    "long": "x" * 10_000,
    "a number": "1e5",
    "missing": "NA",
}
#: Fits with a figure of every configuration take long: one label of each kind goes through them.
FITTED = (
    "path",
    "formula",
    "script",
    "broken mathtext",
    "markup",
    "emoji",
    "right to left",
    "two lines",
    "escape",
    "long",
)
STARTS = ("=", "+", "-", "@", "\t", "\r")


def labelled(*labels: str) -> pd.DataFrame:
    """Return a record for each label, which is its name, its configuration and a note on it."""
    one = small()[lambda table: table["record"] == table["record"].iloc[0]]
    return pd.concat([one.assign(record=f"{x}", configuration=x, repeat=1, note=x) for x in labels], ignore_index=True)


def assert_no_formula(path: Path) -> None:
    csv.field_size_limit(1_000_000)
    with path.open(encoding="utf-8", newline="") as lines:
        for row in csv.reader(lines):
            for cell in row:
                assert not cell.startswith(STARTS) or pd.notna(pd.to_numeric(cell, errors="coerce")), cell


def outside(folder: Path, out: str) -> dict[str, bytes]:
    return {name: content for name, content in tree_of(folder).items() if not name.startswith(f"{out}/")}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_lsq_carries_every_label_as_text_and_writes_nowhere_else(suffix, tmp_path):
    labels = list(LABELS.values())
    path = write_table(labelled(*labels), tmp_path / "deep" / "down" / f"records{suffix}")
    before = outside(tmp_path, "deep/down/out")
    done = here("lsq", path, "--out", path.parent / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    assert outside(tmp_path, "deep/down/out") == before
    assert list(tree_of(path.parent / "out")) == ["least_squares.csv"]
    assert_no_formula(path.parent / "out" / "least_squares.csv")
    fits = read_table(path.parent / "out" / "least_squares.csv")
    assert fits["record"].to_list() == fits["configuration"].to_list() == labels
    assert (fits["status"] == "ok").all()


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> Path:
    """Return the folder that holds what `fit` wrote of records with hostile labels, in `deep/down/out`."""
    folder = tmp_path_factory.mktemp("labels")
    path = write_table(labelled(*(LABELS[name] for name in FITTED)), folder / "deep" / "down" / "records.csv")
    before = tree_of(folder)
    with pytest.MonkeyPatch.context() as monkeypatch:
        put_draws_for_the_sampler(monkeypatch)
        done = here("fit", path, "--out", path.parent / "out")
    assert done.exit_code == 4, done.stderr
    assert done.stderr.replace("\n", "").isprintable()
    assert (
        outside(folder, "deep/down/out") == before | {"deep/down/out/": b""}
        or outside(folder, "deep/down/out") == before
    )
    return folder


def test_fit_carries_labels_as_text_into_every_table_and_the_posterior(fitted):
    out = fitted / "deep/down/out"
    labels = {LABELS[name] for name in FITTED}
    # No case has repeats enough to judge one by.
    assert files_of(out) == FIT_FILES - {OUTLIERS_PNG}
    for name in TABLES:
        assert_no_formula(out / name)
    repeats, cases = read_table(out / "repeats.csv"), read_table(out / "cases.csv")
    assert set(repeats["record"]) == set(repeats["configuration"]) == set(cases["configuration"]) == labels
    posterior = read_tree(out / "posterior.nc")["posterior"]
    assert set(posterior["record"].to_numpy()) == set(posterior["case_configuration"].to_numpy()) == labels


def test_show_prints_labels_as_text_in_one_line_each(fitted):
    done = here("show", fitted / "deep/down/out")
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.replace("\n", "").isprintable()
    for shown in ("../../x", "=cmd()", "<script>alert(1)</script>", r"\frac{$", "[red]x[/red]", "two lines"):
        assert done.stdout.count(f"    {shown}") == 2
    assert max(map(len, done.stdout.splitlines()[:-2])) < 120
    assert "x" * 80 not in done.stdout.replace(str(fitted), "")  # of a sentence; a table cuts labels earlier


def test_the_installed_lsq_and_show_carry_labels_as_text(fitted, tmp_path):
    labels = [LABELS[name] for name in FITTED]
    path = write_table(labelled(*labels), tmp_path / "records.csv")
    running = [start("lsq", path, "--out", "out", cwd=tmp_path), start("show", fitted / "deep/down/out", cwd=tmp_path)]
    lsq, show = (finish(process) for process in running)
    assert (lsq.returncode, lsq.stderr) == (0, "")
    assert (show.returncode, show.stderr) == (0, "")
    assert set(tree_of(tmp_path)) == {"records.csv", "out/", "out/least_squares.csv"}
    assert read_table(tmp_path / "out" / "least_squares.csv")["record"].to_list() == labels
    assert "[red]x[/red]" in show.stdout
    assert "\x1b" not in show.stdout


@pytest.mark.parametrize("name", LABELS)
def test_a_fault_of_a_record_is_told_in_one_line_whatever_its_label(name, tmp_path):
    table = labelled(LABELS[name])
    table.loc[3, "displacement_mm"] = float("inf")
    path = write_table(table, tmp_path / "records.csv")
    done = here("lsq", path, "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert done.stderr.removesuffix("\n").isprintable()
    assert "row 4 (line 5)" in done.stderr
    assert len(done.stderr) < 500 + len(str(path))


def test_labels_and_paths_are_printed_where_the_terminal_knows_no_such_letters(tmp_path):
    path = write_table(labelled("Reifen ⌀ ü"), tmp_path / "Größe \N{DELIVERY TRUCK}.csv")
    command = [str(COMMAND), "lsq", str(path), "--out", str(tmp_path / "⌀")]
    done = finish(start_as(command, tmp_path, environment() | {"PYTHONIOENCODING": "ascii"}))
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 records, 0 not ok" in done.stdout
    assert (tmp_path / "⌀" / "least_squares.csv").is_file()
