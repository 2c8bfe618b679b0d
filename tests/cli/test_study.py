"""`study`: what it writes and says, and what it returns where a parameter is not calibrated."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import environment, here, tree_of
from helpers.law_rankings import ranked
from helpers.motion_studies import motion_rows

from bayes_tyre.studies.calibration import Calibration
from bayes_tyre.studies.motion_study import MotionStudy, summarise
from bayes_tyre.studies.outliers import KINDS, POSTERIOR, SHARES, Outliers, compare
from bayes_tyre.studies.repeat_means import RULES
from bayes_tyre.studies.uniformity import uniformity_table
from bayes_tyre.workflow.studies import study as workflow

KEPT = 39


def calibration(datasets: int, seed: int, wrong: bool) -> Calibration:
    """Return a calibration whose ranks are put there instead of sampled."""
    rng = np.random.default_rng(seed)
    ranks = pd.DataFrame({name: rng.integers(0, KEPT + 1, datasets) for name in ("k", "sd_log_beta_step")})
    if wrong:
        ranks["k"] //= 2
    table = uniformity_table({str(name): ranks[name].to_numpy() for name in ranks}, KEPT)
    ranks.insert(0, "dataset", np.arange(datasets))
    judged = pd.DataFrame({"dataset": np.arange(datasets), "sampling": ["R-hat", *["ok"] * (datasets - 1)]})
    return Calibration(table, ranks, judged, KEPT)


def outliers(campaigns: int, seed: int) -> Outliers:
    rng = np.random.default_rng(seed)
    told = [
        pd.DataFrame({"campaign": np.arange(campaigns), "has_discordant": share > 0, "covered": True})
        .assign(error=rng.normal(0, 0.03, campaigns), half_width=0.1, share=share, kind=kind)
        .assign(parameter=parameter, method=method)
        for share in SHARES
        for kind in KINDS
        for parameter in ("k", "beta")
        for method in (*RULES, POSTERIOR)
    ]
    judged = pd.DataFrame({"dataset": np.arange(campaigns), "sampling": "ok"})
    return Outliers(compare(pd.concat(told, ignore_index=True)), judged)


@pytest.mark.parametrize("wrong", [False, True])
def test_calibration_is_written_and_code_4_where_it_fails(wrong, tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "calibrate", lambda datasets, seed, _: calibration(datasets, seed, wrong))
    done = here("study", "calibration", "--out", tmp_path / "made", "--datasets", 100, "--seed", 3)
    assert done.exit_code == (4 if wrong else 0), done.stderr
    names = {
        "calibration.csv",
        "ranks.csv",
        "datasets.csv",
        "priors.csv",
        "run.json",
        "figures/",
        "figures/calibration.png",
    }
    assert set(tree_of(tmp_path / "made")) == names
    assert "sampling failed in 1 of 100 data sets" in done.stdout
    assert ("bayes-tyre: k: ranks of truths are not uniform" in done.stderr) == wrong
    table = pd.read_csv(tmp_path / "made" / "calibration.csv")
    assert {"parameter", "coverage_95", "coverage_95_lower", "coverage_95_upper", "p_value", "calibrated"} <= set(table)
    assert table["calibrated"].tolist() == [not wrong, True]
    run = json.loads((tmp_path / "made" / "run.json").read_text())
    assert (run["seed"], run["options"]["datasets"], run["origin"]) == (3, 100, "simulated")


def test_outliers_are_written_and_said_in_words(tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "study_outliers", lambda campaigns, seed, _: outliers(campaigns, seed))
    done = here("study", "outliers", "--out", tmp_path / "made", "--campaigns", 10)
    assert done.exit_code == 0, done.stderr
    assert set(tree_of(tmp_path / "made")) == {
        *("outliers.csv", "datasets.csv", "run.json", "figures/", "figures/outliers.png")
    }
    assert done.stdout.count("relative error (coverage of 95 % intervals)") == 6
    again = here("study", "outliers", "--out", tmp_path / "made", "--campaigns", 10, "--quiet")
    assert (again.exit_code, again.stdout, again.stderr) == (0, "", "")


def test_motions_are_written_and_said_in_words(tmp_path, monkeypatch):
    def made_up(records, seed, _):
        assert (len(records), seed) == (2 + 3, 5)
        table = motion_rows(records)
        return MotionStudy(summarise(table), table)

    monkeypatch.setattr(workflow, "study_motion", made_up)
    options = ["--stationary", 2, "--rolling", 3, "--seed", 5]
    done = here("study", "motion", "--out", tmp_path / "made", *options)
    assert done.exit_code == 0, done.stderr
    assert set(tree_of(tmp_path / "made")) == {"motion_study.csv", "motion_records.csv", "run.json"}
    assert "stationary, mismatch none, 2 records, 0 doubted: rms error k 1 % (bias +1, coverage 100%)" in done.stdout
    assert json.loads((tmp_path / "made" / "run.json").read_text())["options"]["rolling"] == 3


def test_a_study_of_no_motion_is_a_usage_error(tmp_path):
    done = here("study", "motion", "--out", tmp_path / "made", "--stationary", 0, "--rolling", 0)
    assert done.exit_code == 2
    assert "no record is asked for" in done.stderr
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(("first", "code"), [(None, 0), ("maxwell_slip", 4)])
def test_laws_are_ranked_and_a_wrong_order_is_a_code(tmp_path, monkeypatch, first, code):
    monkeypatch.setattr(workflow, "rank_laws", lambda true_laws, **_: ranked(true_laws, first))
    options = ["--law", "fancher", "--law", "rigid_ring", "--records", 3, "--seed", 5]
    done = here("study", "laws", "--out", tmp_path / "made", *options)
    assert done.exit_code == code, done.stderr
    assert set(tree_of(tmp_path / "made")) == {"law_ranking.csv", "law_ranking_records.csv", "run.json"}
    assert f"records of fancher: {first or 'fancher'} first" in done.stdout
    told = json.loads((tmp_path / "made" / "run.json").read_text())["options"]
    assert told == {"laws": ["fancher", "rigid_ring"], "records": 3, "seed": 5}


def test_help_names_units_and_an_example_and_waits_for_no_library(tmp_path):
    script = """
import sys
from bayes_tyre.cli import app
for words in ([], ["calibration"], ["outliers"], ["motion"], ["laws"]):
    try:
        app(["study", *words, "--help"], prog_name="bayes-tyre")
    except SystemExit:
        pass
print([name for name in ("jax", "pandas", "scipy", "numpyro") if name in sys.modules])
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")
    for name in ("calibration", "outliers", "motion", "laws"):
        assert f"Example: bayes-tyre study {name} --out" in done.stdout
    assert "kN/mm" in done.stdout
