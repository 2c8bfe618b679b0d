"""`--limit` of `fit`, `motion` and `show` as a user meets it: tables, terminal, report, run.json, refusals."""

import json
from dataclasses import replace

import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, small, written
from helpers.quick_fits import put_a_fit_without_checks_and_figures
from helpers.quick_motions import put_draws_for_the_motions

from bayes_tyre.inference.diagnostics.judge import undiagnosed
from bayes_tyre.report.figures import catalogue
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.plan import PLANS
from bayes_tyre.workflow import fit as workflow
from bayes_tyre.workflow.raw import motion
from bayes_tyre.workflow.raw.simulate import write_simulated


@pytest.fixture
def quick(monkeypatch):
    put_a_fit_without_checks_and_figures(monkeypatch)


def test_fit_writes_says_and_reports_it_and_show_asks_another(quick, tmp_path):
    path, out = written(small(), tmp_path / "records.csv"), tmp_path / "fit"
    done = here("fit", path, "--out", out, "--limit", "k>=1.5")
    assert done.exit_code == 4  # made-up draws
    cases = pd.read_csv(out / "cases.csv")
    of_k = cases[cases["parameter"] == "k"].sort_values("p_limit")
    assert list(cases.columns[-4:]) == ["limit", "p_limit", "origin", "verdict"]
    assert (of_k["limit"] == "k >= 1.5").all()
    assert of_k["p_limit"].between(0, 1, inclusive="neither").all()
    assert cases.loc[cases["parameter"] == "beta", "p_limit"].isna().all()
    said = [line for line in done.stdout.splitlines() if "is at least 1.5 kN/mm" in line]
    assert len(said) == len(of_k)
    assert said[0].startswith(f"k of single {of_k['direction'].iloc[0]} at 0 km/h from ")
    assert json.loads((out / "run.json").read_text())["options"]["limit"] == "k >= 1.5"
    here("report", out, "--kept-figures", "--quiet")
    assert said[0].replace(">", "&gt;").replace("<", "&lt;") in (out / "report.html").read_text()
    shown = here("show", out, "--limit", "beta <= 0.05")
    lines = [line for line in shown.stdout.splitlines() if "is at most 0.05 mm with probability" in line]
    assert (shown.exit_code, len(lines)) == (0, len(of_k))
    assert all(line.endswith("(verdict fail, not to be trusted)") for line in lines)
    refused = here("show", out, "--limit", "x >= 1")
    assert_refused(refused.exit_code, refused.stderr, "posterior.nc", "no case here has x", "k, beta")
    again = workflow.planned_in(out / "run.json", lambda _: None)  # of --from
    assert again.limit == "k >= 1.5"
    assert "limit" not in replace(again, limit=None).options  # run.json is as it was without one


def test_motion_has_limits_on_what_its_law_and_the_axle_have(monkeypatch, tmp_path):
    put_draws_for_the_motions(monkeypatch)
    monkeypatch.setattr(motion, "judge", lambda tree, *_: (tree, undiagnosed(tree)))
    monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
    write_simulated(PLANS["quick"](2000.0)[:1], {"single": load_rig("single")}, 0, tmp_path / "raw", lambda _: None)
    (tmp_path / "raw" / "truth.csv").unlink()
    refused = here("motion", tmp_path / "raw", "--out", tmp_path / "out", "--limit", "belt_frequency >= 50")
    assert refused.exit_code == 2
    assert "give a limit on k, x, beta, m, c," in " ".join(refused.stderr.replace("\u2502", " ").split())
    asked = ("--workers", 1, "--limit", "m<=285", "--amplitude", 2)
    done = here("motion", tmp_path / "raw", "--out", tmp_path / "out", *asked)
    assert done.exit_code == 4, done.stderr  # undiagnosed
    cases = pd.read_csv(tmp_path / "out" / "cases.csv")
    mine = cases["parameter"] == "m"
    # Draws of m are log-normal about 285 kg: half of the 1000 keep it, within five standard errors of a share, 0.08.
    assert cases.loc[mine, "p_limit"].tolist() == pytest.approx([0.5], abs=0.08)
    assert cases.loc[~mine, "p_limit"].isna().all()
    assert "is at most 285 kg with probability" in done.stdout
    assert "a cycle of 2 mm amplitude at the wheel centre loses " in done.stdout
    assert json.loads((tmp_path / "out" / "run.json").read_text())["options"]["limit"] == "m <= 285.0"


@pytest.mark.parametrize(("limit", "said"), [("k > 1.8", "is no limit"), ("x >= 1", "give a limit on k, beta")])
def test_what_is_no_limit_of_a_fit_is_a_usage_error_before_the_work(limit, said, monkeypatch, tmp_path):
    monkeypatch.setattr(workflow, "fit_hierarchical", lambda *_: pytest.fail("worked first"))
    done = here("fit", written(small(), tmp_path / "records.csv"), "--out", tmp_path / "fit", "--limit", limit)
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "fit").exists()


def test_a_limit_is_of_posteriors_not_of_truths(tmp_path):
    assert here("show", tmp_path, "--truth", tmp_path / "truth.csv", "--limit", "k >= 1").exit_code == 2
