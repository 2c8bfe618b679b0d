"""What the quick commands print and write: help, lsq, campaign, published."""

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import (
    COMMANDS,
    WORDS,
    assert_refused,
    environment,
    finish,
    here,
    installed,
    small,
    start,
    tree_of,
    written,
)
from simulated_records import Plan, simulate

from bayes_tyre.embedded import data_path

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


def test_help_names_units_and_an_example_and_waits_for_no_library(tmp_path):
    asked = [["--help"], *([command, "--help"] for command in COMMANDS)]
    script = f"""
import contextlib, io, json, sys
from bayes_tyre.cli import app
said = []
for arguments in {asked!r}:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            app(arguments, prog_name="bayes-tyre")
        except SystemExit as end:
            assert not end.code
    said.append(out.getvalue())
print(json.dumps([said, [name for name in ("jax", "numpyro", "pandas", "matplotlib") if name in sys.modules]]))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True
    )
    said, imported = json.loads(done.stdout)
    assert imported == []
    for command in COMMANDS:
        assert f"\n  {command} " in said[0]
    for command, text in zip(COMMANDS, said[1:], strict=True):
        assert f"Example: bayes-tyre {command} " in text
        assert any(unit in " ".join(text.split()) for unit in ("kN/mm", "(mm, kN)", "(kN, mm)"))


def test_the_installed_command_helps(tmp_path):
    running = {one: start(one, cwd=tmp_path) for one in ("--help", "--version")}
    done = {one: finish(process) for one, process in running.items()}
    assert all(one.returncode == 0 and one.stderr == "" for one in done.values())
    assert "Usage: bayes-tyre" in done["--help"].stdout
    assert done["--version"].stdout == f"{version('bayes-tyre')}\n"


def test_lsq_needs_only_the_required_columns_and_one_bad_record_stops_no_other(tmp_path):
    table, truth = simulate(
        Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=200), 2
    )
    required = table[["record", "displacement_mm", "force_kN"]]
    names = truth["record"].tolist()
    few = required[required["record"] == names[0]].head(3).assign(record="short")
    still = required[required["record"] == names[0]].assign(record="still", displacement_mm=5.0)
    written(pd.concat([few, required, still]), tmp_path / "records.csv")
    done = installed("lsq", "records.csv", "--out", "made/here", "--free", "F_i", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.splitlines()[-1] == "5 records, 2 not ok"
    assert str(Path("made/here/least_squares.csv")) in done.stdout
    assert {name for name in tree_of(tmp_path / "made") if not name.endswith("/")} == {"here/least_squares.csv"}
    fits = pd.read_csv(tmp_path / "made/here/least_squares.csv", keep_default_na=False, dtype=str)
    parameters = ("k_kN_per_mm", "C_kN", "beta_mm", "d_i_mm", "F_i_kN")
    numbers = [name for parameter in parameters for name in (parameter, f"{parameter}_se")]
    assert list(fits.columns) == ["record", *WORDS, *numbers, "rmse_kN", "points", "status", "origin"]
    assert (fits[WORDS] == "").all(axis=None)
    assert fits["record"].tolist() == ["short", *names, "still"]
    status = dict(zip(fits["record"], fits["status"], strict=True))
    assert "too few points" in status["short"]
    assert "no travel" in status["still"]
    assert fits.set_index("record").loc[["short", "still"], numbers].isin([""]).all(axis=None)
    good = fits[fits["record"].isin(names)]
    assert (good["status"] == "ok").all()
    assert (good["d_i_mm_se"] == "").all()
    assert (good["points"] == "200").all()
    distance = good["k_kN_per_mm"].astype(float).to_numpy() - truth["k"].to_numpy()
    assert (np.abs(distance) < 5 * good["k_kN_per_mm_se"].astype(float).to_numpy()).all()


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [("force_kN", 1000.0, "divide by 1000"), ("displacement_mm", 0.001, "multiply by 1000")],
)
def test_lsq_warns_of_newtons_and_metres_and_goes_on_while_fit_refuses(column, factor, said, tmp_path):
    table = small()
    table[column] *= factor
    path = written(table, tmp_path / "records.csv")
    before = tree_of(tmp_path)
    refused = here("fit", path, "--out", tmp_path / "fit")
    assert_refused(refused.exit_code, refused.stderr, str(path), column, said, "--units-checked")
    assert tree_of(tmp_path) == before
    warned = here("lsq", path, "--out", tmp_path / "lsq")
    assert warned.exit_code == 0
    assert warned.stderr.startswith("bayes-tyre: warning: ")
    assert warned.stderr.count("\n") == 1
    assert column in warned.stderr
    assert said in warned.stderr
    assert (tmp_path / "lsq" / "least_squares.csv").is_file()
    quiet = here("lsq", path, "--out", tmp_path / "lsq", "--quiet")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (0, "", warned.stderr)


@pytest.mark.slow
def test_a_certified_data_set_comes_back_to_eight_digits(tmp_path):
    """NIST StRD Misra1a, b1 (1 - exp(-b2 x)): Equation 2 without stiffness; from NIST's far start."""
    x = (77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0)
    y = (10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78)
    b1, b1_sd, b2, b2_sd, rest = 2.3894212918e02, 2.7070075241e00, 5.5015643181e-04, 7.2668688436e-06, 1.0187876330e-01
    written(pd.DataFrame({"record": "Misra1a", "displacement_mm": x, "force_kN": y}), tmp_path / "misra1a.csv")
    fixed = [text for name in ("k", "F_i", "d_i") for text in ("--fix", f"{name}=0")]
    far = ["--start", "C=500", "--start", "beta=10000"]
    done = installed("lsq", "misra1a.csv", "--out", ".", *fixed, *far, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "1 records, 0 not ok"
    row = pd.read_csv(tmp_path / "least_squares.csv").iloc[0]
    assert row["C_kN"] == pytest.approx(b1, rel=1e-8)
    assert row["beta_mm"] == pytest.approx(1 / b2, rel=1e-8)
    assert row["C_kN_se"] == pytest.approx(b1_sd, rel=1e-8)
    assert row["beta_mm_se"] == pytest.approx(b2_sd / b2**2, rel=1e-8)
    assert row["rmse_kN"] == pytest.approx(rest * np.sqrt(12 / 14), rel=1e-8)
    assert row[["k_kN_per_mm_se", "d_i_mm_se", "F_i_kN_se"]].isna().all()


def test_the_campaign_is_the_same_file_each_time_and_the_one_that_ships(tmp_path):
    done = installed("campaign", "--out", "one/records.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("reconstructed, not measured") == 2
    assert here("campaign", "--out", tmp_path / "two" / "records.csv").exit_code == 0
    for name in ("records.csv", "records_truth.csv"):
        one, two = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two"))
        assert one == two == data_path(f"campaign/{name}").read_bytes()
    assert len(tree_of(tmp_path)) == 6


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
