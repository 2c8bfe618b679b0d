"""`study`: what it writes and says, and what it returns where a parameter is not calibrated."""

import json
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import here, printed_and_imported, tree_of
from helpers.coverage_studies import estimated
from helpers.law_rankings import ranked
from helpers.motion_studies import motion_rows

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.studies import motion_study
from bayes_tyre.studies.calibration import Calibration
from bayes_tyre.studies.coverage import CoverageFit
from bayes_tyre.studies.motion_study import STATIONARY, MotionFit, StudyRecord, study_records
from bayes_tyre.studies.outlier_calibration import outlier_calibration
from bayes_tyre.studies.outliers import KINDS, POSTERIOR, SHARES, Outliers, compare
from bayes_tyre.studies.repeat_means import RULES
from bayes_tyre.studies.truths import COARSE
from bayes_tyre.studies.uniformity import uniformity_table
from bayes_tyre.workflow import studies as workflow

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
    predicted = rng.uniform(0.0, 0.5, (datasets, 3))
    return Calibration(
        table, ranks, judged, KEPT, outlier_calibration(predicted, rng.random((datasets, 3)) < predicted)
    )


class NoFit:
    """What stands for a fit that is not asked for anything."""

    hierarchy = sampling = None

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named

    def simulated(self, *_: Any) -> Any:
        raise AssertionError


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
    monkeypatch.setattr(workflow, "DesignFit", NoFit)
    monkeypatch.setattr(workflow, "calibrate", lambda datasets, seed, _, fit: calibration(datasets, seed, wrong))
    done = here("study", "calibration", "--out", tmp_path / "made", "--datasets", 100, "--seed", 3)
    assert done.exit_code == (4 if wrong else 0), done.stderr
    names = {
        "outlier_calibration.csv",
        "figures/outlier_calibration.png",
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
    assert (run["seed"], run["origin"]) == (3, "simulated")
    of_records = {"model": "records", "noise": "iid", "repeats": 3, "weak": False}
    assert run["options"] == {"datasets": 100, "seed": 3, **of_records}
    assert "outlier_probability: as many discordant records as predicted in " in done.stdout


@pytest.mark.parametrize(
    ("options", "name", "sigma_typical"),
    [
        (("--model", "published"), "PublishedFit", PRIORS["sigma_typical"]),
        (("--model", "motion", "--repeats", 5), "MotionsFit", PRIORS["sigma_typical"]),
        (("--noise", "student", "--weak", "--repeats", 1), "DesignFit", COARSE),
    ],
)
def test_what_is_calibrated_can_be_chosen(options, name, sigma_typical, tmp_path, monkeypatch):
    made = []

    def calibrated(datasets, seed, _, fit):
        made.append(fit)
        return calibration(datasets, seed, False)

    monkeypatch.setattr(workflow, name, NoFit)
    monkeypatch.setattr(workflow, "calibrate", calibrated)
    done = here("study", "calibration", "--out", tmp_path / "made", "--datasets", 20, *options)
    assert done.exit_code == 0, done.stderr
    (fit,) = made
    for design in fit.given:
        repeats, points = design.factor_table["repeat"].nunique(), design.u.shape[1]
        assert (repeats, points) == (options[-1], 10 if "--weak" in options else 40)
    assert fit.named.get("noise", "student") == "student"
    of_noise = pd.read_csv(tmp_path / "made" / "priors.csv").set_index("site").loc["sigma_typical"]
    assert of_noise["reason"] == sigma_typical.reason


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--around", ".", "--noise", "ar1"), "contradicts --around, whose fit says it"),
        (("--around", ".", "--model", "motion"), "contradicts --around, whose fit says it"),
        (("--model", "published", "--repeats", 2), "is of records, not of --model published"),
        (("--model", "motion", "--weak"), "is of records, not of --model motion"),
    ],
)
def test_options_that_what_is_calibrated_does_not_have_are_refused(options, said, tmp_path):
    done = here("study", "calibration", "--out", tmp_path / "made", *options)
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.replace("│", " ").split())
    assert not (tmp_path / "made").exists()


def test_outliers_are_written_and_said_in_words(tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "study_outliers", lambda campaigns, seed, _: outliers(campaigns, seed))
    done = here("study", "outliers", "--out", tmp_path / "made", "--campaigns", 10)
    assert done.exit_code == 0, done.stderr
    assert set(tree_of(tmp_path / "made")) == {
        *("outliers.csv", "datasets.csv", "run.json", "figures/", "figures/outliers.png")
    }
    methods = pd.read_csv(tmp_path / "made" / "outliers.csv")["method"].nunique()
    assert done.stdout.count("relative error (coverage of 95 % intervals)") == 2
    assert done.stdout.count(" % (") == 6 * methods  # of two parameters and three shares
    again = here("study", "outliers", "--out", tmp_path / "made", "--campaigns", 10, "--quiet")
    assert (again.exit_code, again.stdout, again.stderr) == (0, "", "")


def test_motions_are_written_and_said_in_words(tmp_path, monkeypatch):
    fitted = []

    def made_up(fit: MotionFit, record: StudyRecord) -> pd.DataFrame:
        assert fit == (5, "auto")
        fitted.append(record)
        return motion_rows([record])

    monkeypatch.setattr(MotionFit, "rows", made_up)
    options = ["--stationary", 2, "--rolling", 3, "--seed", 5, "--law", "auto", "--workers", 1]
    done = here("study", "motion", "--out", tmp_path / "made", *options)
    assert done.exit_code == 0, done.stderr
    files = {path for path in tree_of(tmp_path / "made") if not path.startswith(".motion_study.csv.parts/")}
    assert files == {"motion_study.csv", "motion_records.csv", "run.json"}
    assert len(fitted) == 5
    assert "stationary, mismatch none, 2 records, 0 doubted: rms error k 1 % (bias +1, coverage 100%)" in done.stdout
    told = json.loads((tmp_path / "made" / "run.json").read_text())["options"]
    assert (told["rolling"], told["law"]) == (3, "auto")
    # Resumed with a mismatch beside them, that alone is fitted.
    further = [*options, "--mismatch", 1, "--standing-only", "--kinds", "mass 5 % off", "--resume"]
    done = here("study", "motion", "--out", tmp_path / "made", *further)
    assert done.exit_code == 0, done.stderr
    assert [record.mismatch for record in fitted[5:]] == ["mass 5 % off"]
    wrong = here("study", "motion", "--out", tmp_path / "made", "--mismatch", 1, "--kinds", "mass")
    assert wrong.exit_code == 2
    assert "'mass' is none of first-order lag" in " ".join(wrong.stderr.split())
    wrong = here("study", "motion", "--out", tmp_path / "made", "--rolling", 1, "--kinds", "mass 5 % off")
    assert wrong.exit_code == 2
    assert "--kinds: has no effect without --mismatch" in " ".join(wrong.stderr.split())
    none = ["--stationary", 0, "--rolling", 0, "--mismatch", 1, "--standing-only", "--kinds", "speed label 2 % off"]
    wrong = here("study", "motion", "--out", tmp_path / "made", *none)
    assert wrong.exit_code == 2
    assert "name mismatches of rolling records alone" in " ".join(wrong.stderr.split())


@pytest.mark.slow
@pytest.mark.usefixtures("fully_compiled")
def test_a_small_study_of_motions_from_simulation_to_tables(tmp_path, monkeypatch):
    def standing_on_one_rig(*of: Any) -> list[StudyRecord]:
        """Return two records as they are and one with each of some mismatches that a standing record can have."""
        tried = {"none", "mass 5 % off", "load in two stages", "stiffness grows 3 %/mm", "first-order lag"}
        records = [record for record in study_records(*of) if record.kind == STATIONARY and record.mismatch in tried]
        rig = records[0].plan.case.configuration
        return [record for record in records if record.plan.case.configuration == rig]

    # The rig that other tests compile for; a rolling record takes minutes.
    monkeypatch.setattr(motion_study, "study_records", standing_on_one_rig)
    options = ["--stationary", 4, "--rolling", 0, "--mismatch", 1, "--seed", 9, "--workers", 1]
    done = here("study", "motion", "--out", tmp_path, *options)
    assert done.exit_code == 0, done.stderr
    records = pd.read_csv(tmp_path / "motion_records.csv")
    assert (records["cpu_seconds"] > 0).all()
    right = records[records["mismatch"] == "none"]
    assert len(right) == 2 * 5
    # Ten normal numbers, five each correlated: one beyond 4 standard deviations in 0.06 % of seeds.
    off = np.log(right["estimate"] / right["truth"]) / (right["sd"] / right["estimate"])
    assert np.abs(off).max() < 4
    # Fewer than seven of ten 95 % intervals that hold the truth: 0.1 % of seeds, were the ten independent.
    assert right["inside"].sum() >= 7
    assert (right["status"] == "ok").all()
    # Of each mismatch what it must do. A mass off the rig's is among what the fit has unknown: right all the same.
    of = dict(iter(records[records["mismatch"] != "none"].groupby("mismatch")))
    mass = of.pop("mass 5 % off").set_index("parameter")
    rig = load_rig(mass["configuration"].iloc[0])
    assert mass.loc["m", "truth"] == pytest.approx(1.05 * rig.axle.effective_mass_kg)
    # Five normal numbers: one beyond 4 standard deviations in 0.03 % of seeds.
    assert (np.abs(np.log(mass["estimate"] / mass["truth"]) / (mass["sd"] / mass["estimate"])) < 4).all()
    # A load that rises twice is read from the load cell, and is right: one of five beyond 4 in 0.03 % of seeds again.
    stages = of.pop("load in two stages").set_index("parameter")
    assert (stages["load_departure_percent"] > 1).all()
    assert (np.abs(np.log(stages["estimate"] / stages["truth"]) / (stages["sd"] / stages["estimate"])) < 4).all()
    # A stiffness that grows is a force that the law leaves out: residuals are explained, and the status says by what.
    grows = of.pop("stiffness grows 3 %/mm").set_index("parameter")
    assert (grows["discrepancy_percent"] > 0.07).all()
    assert grows["status"].str.contains("leave out a force").all()
    assert grows["error_percent"].abs()["k"] < 1
    for wrong in (stages, grows):
        # Of 1100 residuals the mean square has a standard deviation of 0.04: beyond 5 of them in 0.0001 % of seeds.
        assert (np.abs(wrong["chi_squared_acceleration"] - 1) < 0.2).all()
    # A lag is in the family of shapes but for its corner: what it does stays within a few per cent, and is counted.
    (lag,) = of.values()
    assert set(lag["mismatch"]) == {"first-order lag"}
    assert lag["error_percent"].abs().max() < 5
    table = pd.read_csv(tmp_path / "motion_study.csv").set_index(["mismatch", "parameter"])
    assert table.loc[("stiffness grows 3 %/mm", "k"), "doubted"] == 1
    assert "stationary, mismatch stiffness grows 3 %/mm, 1 records, 1 doubted" in done.stdout


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


def test_coverage_is_written_shown_and_resumed(tmp_path, monkeypatch):
    fitted = []

    def counted(fit: CoverageFit, name: str, seed: int, number: int) -> pd.DataFrame:
        fitted.append((number, name))
        return estimated(fit, name, seed, number)

    monkeypatch.setattr(CoverageFit, "estimate", counted)
    options = ["--out", tmp_path / "made", "--kinds", "clean,one_repeat", "--seed", 3]
    done = here("study", "coverage", *options, "--sets", 2)
    assert done.exit_code == 0, done.stderr
    # Kinds take turns, so that an interrupted study has as many data sets of each.
    assert fitted == [(0, "clean"), (0, "one_repeat"), (1, "clean"), (1, "one_repeat")]
    written = {name for name in tree_of(tmp_path / "made") if not name.startswith(".")}
    tables = {"coverage.csv", "verdicts.csv", "coverage_estimates.csv"}
    assert written == {*tables, "run.json", "figures/", "figures/coverage.png"}
    assert all(word in done.stdout for word in ("one_repeat", "1 of 2", "coverage of 95 % intervals ± its"))
    estimates = pd.read_csv(tmp_path / "made" / "coverage_estimates.csv")
    assert len(estimates) == 2 * (2 * (24 + 8 + 1) + 2 * (24 + 24 + 1))
    assert set(pd.read_csv(tmp_path / "made" / "coverage.csv")["sets"]) == {2}
    assert pd.read_csv(tmp_path / "made" / "verdicts.csv")["law"].tolist() == [1, 1]
    again = here("study", "coverage", *options, "--sets", 3, "--resume", "--quiet")
    assert (again.exit_code, again.stdout, again.stderr) == (0, "", "")
    assert fitted[4:] == [(2, "clean"), (2, "one_repeat")]
    table = pd.read_csv(tmp_path / "made" / "coverage.csv")
    assert set(table["sets"]) == {3}
    run = json.loads((tmp_path / "made" / "run.json").read_text())["options"]
    assert (run["kinds"], run["sets"], run["seed"], run["chains"]) == (["clean", "one_repeat"], 3, 3, 4)


def test_an_unknown_kind_of_data_is_a_usage_error_that_lists_them(tmp_path):
    done = here("study", "coverage", "--out", tmp_path / "made", "--kinds", "clean,dirty")
    assert done.exit_code == 2
    assert all(word in done.stderr for word in ("'dirty'", "clean", "case_apart"))
    assert not (tmp_path / "made").exists()


def test_help_names_units_and_an_example_and_waits_for_no_library(tmp_path):
    studies = ("calibration", "outliers", "motion", "laws", "coverage")
    commands = [["study", "--help"], *(["study", name, "--help"] for name in studies)]
    said, imported = printed_and_imported(commands, ("jax", "pandas", "scipy", "numpyro"), tmp_path)
    assert imported == []
    for name, text in zip(studies, said[1:], strict=True):
        assert f"Example: bayes-tyre study {name} --out" in text
    assert "kN/mm" in "".join(said)
