"""`--reference` of `fit`, `show` and `report` as a user meets it: table, sentence, run.json, refusals."""

import json

import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, written
from helpers.quick_fits import put_a_fit_without_checks_and_figures
from helpers.simulated_records import Plan, simulate

import bayes_tyre as bt
from bayes_tyre.workflow import fit as workflow


def test_fit_puts_the_reference_below_and_show_and_report_another(monkeypatch, tmp_path):
    put_a_fit_without_checks_and_figures(monkeypatch)
    table, _ = simulate(Plan(configurations=("dual", "single"), speeds=(0.0,), loads=(20.0,), points=30), 3)
    path, out = written(table, tmp_path / "records.csv"), tmp_path / "fit"
    done = here("fit", path, "--out", out, "--reference", "dual")
    assert done.exit_code == 4  # made-up draws
    contrasts = pd.read_csv(out / "contrasts.csv")
    assert set(contrasts["contrast"]) == {"single / dual", "loading / unloading"}
    assert json.loads((out / "run.json").read_text())["options"]["reference"] == "dual"
    assert workflow.planned_in(out / "run.json", lambda _: None).reference == "dual"
    from_python = bt.contrasts(bt.read_posterior(out))
    pd.testing.assert_frame_equal(from_python, contrasts, check_dtype=False, check_exact=False)
    text = " ".join(done.stdout.split())
    assert "onfiguration single is" in text or "which of single and dual is stiffer" in text
    turned = " ".join(here("show", out, "--reference", "single").stdout.split())
    assert "onfiguration dual is" in turned or "which of dual and single is stiffer" in turned
    here("report", out, "--kept-figures", "--quiet", "--reference", "single")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "dual / single" in page
    assert "single / dual" not in page
    assert "Ratios in the figures are as the fit drew them" in page
    refused = here("report", out, "--kept-figures", "--reference", "triple")
    assert_refused(refused.exit_code, refused.stderr, "--reference 'triple'", "'dual', 'single'")


def test_a_reference_that_no_record_has_is_refused_before_the_work(monkeypatch, tmp_path):
    monkeypatch.setattr(workflow, "fit_hierarchical", lambda *_: pytest.fail("worked first"))
    table, _ = simulate(Plan(configurations=("dual", "single"), speeds=(0.0,), loads=(20.0,), points=30), 3)
    done = here("fit", written(table, tmp_path / "records.csv"), "--out", tmp_path / "fit", "--reference", "x")
    assert_refused(done.exit_code, done.stderr, "--reference 'x'", "the data have 'dual', 'single'")
    assert not (tmp_path / "fit").exists()
