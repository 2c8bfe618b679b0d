"""`audit`: what it writes and prints, and one small audit from simulation to conclusion."""

import json

import pandas as pd
import pytest
from helpers.audit_made_up import audited, blind
from helpers.command_line import here, tree_of

from bayes_tyre.report.figures import audit as audit_figures
from bayes_tyre.studies.audit.grid import PLANS, Plan
from bayes_tyre.studies.audit.study import COLUMNS
from bayes_tyre.workflow import studies as workflow

FILES = {
    *("audit.csv", "audit_records.csv", "conclusion.txt", "run.json", "figures/"),
    *(f"figures/{name}.png" for name in ("beta_returned", "k_bias", "coverage", "beta_window")),
}


def test_tables_conclusion_and_figures_are_written_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "study_audit", lambda plan, replicates, seed, _: audited(blind, replicates))
    done = here("audit", "--out", tmp_path / "made", "--replicates", 2, "--seed", 3)
    assert done.exit_code == 0, done.stderr
    assert set(tree_of(tmp_path / "made")) == FILES
    conclusion = (tmp_path / "made" / "conclusion.txt").read_text()
    assert conclusion.strip() in done.stdout
    assert "in simulation it says little about the tyre" in conclusion
    assert "bias, median (range) %" in done.stdout
    table = pd.read_csv(tmp_path / "made" / "audit.csv")
    assert tuple(table.columns) == COLUMNS
    assert set(table["origin"]) == {"simulated"}
    run = json.loads((tmp_path / "made" / "run.json").read_text())
    assert (run["seed"], run["options"], run["origin"]) == (
        3,
        {"plan": "quick", "replicates": 2, "seed": 3},
        "simulated",
    )
    monkeypatch.setattr(audit_figures, "draw", lambda *_: iter(()))
    again = here("audit", "--out", tmp_path / "made", "--quiet")
    assert (again.exit_code, again.stdout, again.stderr) == (0, "", "")


@pytest.mark.slow
def test_two_points_from_simulation_to_conclusion(tmp_path, monkeypatch):
    two = Plan({}, {"beta_mm": (0.04, 0.08), "rise_s": (0.036,)}, (1, 801))
    monkeypatch.setitem(PLANS, "quick", two)
    done = here("audit", "--out", tmp_path / "made", "--replicates", 1)
    assert done.exit_code == 0, done.stderr
    table = pd.read_csv(tmp_path / "made" / "audit.csv")
    assert (table["returned"] == 1).all()
    # Of eight errors one beyond 4.5 standard deviations in 0.006 % of seeds; those are 0.3 % at most.
    assert table.loc[table["method"] == "motion", "bias_percent"].abs().max() < 1.5
    # Without the inertia force k is right to a few per cent; with it left in and smoothed it is not.
    of_k = table[table["parameter"] == "k"]
    assert of_k.loc[of_k["method"] == "inertia", "bias_percent"].abs().max() < 6
    assert of_k.loc[of_k["window_samples"] == 801, "bias_percent"].min() > 20
    # And a beta of twice the size does not come back larger by even a third of that.
    of_beta = table[(table["parameter"] == "beta") & (table["window_samples"] == 801)].sort_values("beta_mm")
    assert len(of_beta) == 2
    assert of_beta["median"].iloc[1] / of_beta["median"].iloc[0] < 2 ** (1 / 3)
