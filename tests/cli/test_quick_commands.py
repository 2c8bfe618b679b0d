"""What the quick commands print and write: help, lsq, campaign, published."""

from importlib.metadata import version

import pandas as pd
import pytest
from helpers.command_line import COMMANDS, assert_refused, finish, here, installed, printed_and_imported, start, tree_of

from bayes_tyre.embedded import data_path

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


def test_help_names_units_and_an_example_and_waits_for_no_library(tmp_path):
    asked = [["--help"], *([command, "--help"] for command in COMMANDS)]
    said, imported = printed_and_imported(asked, ("jax", "numpyro", "pandas", "matplotlib"), tmp_path)
    assert imported == []
    for command in COMMANDS:
        assert f"\n  {command} " in said[0]
    for command, text in zip(COMMANDS, said[1:], strict=True):
        assert f"Example: bayes-tyre {command} " in text
        assert any(unit in " ".join(text.split()) for unit in ("kN/mm", "(mm, kN)", "(kN, mm)"))
        assert "--seed" in text
        assert "--quiet" in text


def test_the_installed_command_helps(tmp_path):
    running = {one: start(one, cwd=tmp_path) for one in ("--help", "--version")}
    done = {one: finish(process) for one, process in running.items()}
    assert all(one.returncode == 0 and one.stderr == "" for one in done.values())
    assert "Usage: bayes-tyre" in done["--help"].stdout
    assert done["--version"].stdout == f"{version('bayes-tyre')}\n"


def test_the_campaign_is_the_same_file_each_time_and_the_one_that_ships(tmp_path):
    done = installed("campaign", "--out", "one/records.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("reconstructed, not measured") == 2
    assert here("campaign", "--out", tmp_path / "two" / "records.csv").exit_code == 0
    for name in ("records.csv", "records_truth.csv"):
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert one == two == data_path(f"campaign/{name}").read_bytes()
    assert len(tree_of(tmp_path)) == 6


@pytest.mark.parametrize("out", ["file/records.csv", "folder.csv", "truth.csv"])
def test_a_campaign_that_cannot_be_written_is_refused_before_it_is_made(out, tmp_path, monkeypatch):
    monkeypatch.setattr("bayes_tyre.published.campaign.reconstruct", lambda *_: pytest.fail("made first"))
    (tmp_path / "file").touch()
    for folder in ("folder.csv", "truth_truth.csv"):
        (tmp_path / folder).mkdir()
    done = here("campaign", "--out", tmp_path / out)
    assert_refused(done.exit_code, done.stderr, f"--out {tmp_path}")


@pytest.mark.slow
def test_the_published_numbers_are_counted_apart_by_kind(tmp_path):
    done = installed("published", "--out", "checked", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    check = pd.read_csv(tmp_path / "checked" / "published_check.csv")
    assert list(check.columns) == ["quantity", "source", "kind", "published", "recomputed", "tolerance", "agrees"]
    counts = check["kind"].value_counts()
    assert set(counts.index) == {"recomputed", "round trip", "erratum"}
    for kind, count in counts.items():
        assert f"  {kind}: {count} of {count} agree\n" in done.stdout
    assert {"checked/", "checked/published_check.csv"} == set(tree_of(tmp_path))
