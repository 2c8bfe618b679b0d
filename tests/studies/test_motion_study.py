"""The study of motions: its records, its figures and the mismatches it plants; `cli/test_study` runs one."""

from collections import Counter

import numpy as np
import pytest
from helpers.motion_studies import motion_rows

from bayes_tyre.inference.motion.record.law_average import NOT_CONVERGED
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.studies.motion_machine import Machine, load_of
from bayes_tyre.studies.motion_mismatch import MISMATCHES
from bayes_tyre.studies.motion_study import ROLLING, STATIONARY, sentences, study_records, summarise

pytestmark = pytest.mark.usefixtures("fully_compiled")

RIG = load_rig("single")


def test_speeds_directions_and_axles_come_equally_often():
    records = study_records(12, 12, seed=3)
    rolling = [record.plan.case for record in records if record.kind == ROLLING]
    assert Counter((case.configuration, case.direction, case.speed_km_h) for case in rolling).most_common(1)[0][1] == 1
    assert {case.speed_km_h for case in rolling} == {15.0, 25.0, 35.0}
    still = Counter((r.plan.case.configuration, r.plan.case.direction) for r in records if r.kind == STATIONARY)
    assert set(still.values()) == {3}
    assert records == study_records(12, 12, seed=3)
    assert records != study_records(12, 12, seed=4)
    more = study_records(80, 0, seed=3)  # 72 cases of the plan stand
    assert [record.number for record in more] == list(range(80))
    assert more[:12] == records[:12]
    assert more[72].plan == more[0].plan


def test_mismatches_are_tried_on_the_kinds_that_can_have_them():
    names = Counter((record.mismatch, record.kind) for record in study_records(1, 0, seed=0, mismatched=2))
    expected = {(name, ROLLING): 2 for name in MISMATCHES if name != "none"}
    expected |= {(name, STATIONARY): 2 for name, of in MISMATCHES.items() if name != "none" and not of.rolling_only}
    assert names == expected | {("none", STATIONARY): 1}
    standing = study_records(0, 0, seed=0, mismatched=1, standing_only=True)
    assert {record.kind for record in standing} == {STATIONARY}


def test_every_mismatch_is_one():
    truth = draw_truth(next(r.plan for r in study_records(0, 12, 0) if r.plan.case.configuration == "single"), RIG, 5)
    for name, of in MISMATCHES.items():
        assert (of.change(truth, RIG) == truth and of.machine == Machine()) == (name == "none"), name


def test_a_ringing_load_overshoots_by_its_share():
    truth = draw_truth(next(r.plan for r in study_records(1, 0, 0)), RIG, 5)
    time_s = truth.step_start_s + np.linspace(-0.1, 1.0, 5001)
    share = (load_of(Machine(overshoot=0.06), truth, time_s) - truth.load_before_kN) / (
        truth.load_after_kN - truth.load_before_kN
    )
    assert share.max() == pytest.approx(1.06, abs=0.002)
    assert (share[0], share[-1]) == pytest.approx((0.0, 1.0), abs=1e-4)


def test_figures_are_those_of_the_errors():
    rows = motion_rows(study_records(4, 0, seed=0))
    k = rows["parameter"] == "k"
    rows.loc[k, "error_percent"] = [1.0, -1.0, 2.0, 0.0]
    rows.loc[k, "inside"] = [True, True, False, True]
    rows.loc[k & (rows["error_percent"] == 2.0), "status"] = "odd"
    found = next(row for row in summarise(rows).to_dict("records") if row["parameter"] == "k")
    assert found["rms_error_percent"] == pytest.approx(np.sqrt(1.5))
    assert found["bias_percent"] == 0.5
    assert found["bias_se_percent"] == pytest.approx(np.std([1, -1, 2, 0], ddof=1) / 2)
    assert (found["coverage_95"], found["records"], found["doubted"]) == (0.75, 4, 1)
    # Clopper and Pearson's interval of 3 in 4.
    assert (found["coverage_95_lower"], found["coverage_95_upper"]) == pytest.approx((0.1941, 0.9937), abs=1e-4)


def test_a_record_without_an_estimate_is_declined():
    rows = motion_rows(study_records(2, 0, seed=0))
    rows.loc[rows["record"] == rows["record"][0], "estimate"] = np.nan
    found = summarise(rows)
    assert (found["records"] == 2).all()
    assert (found["declined"] == 1).all()


def test_a_fit_that_did_not_converge_is_no_estimate_and_is_counted_apart():
    rows = motion_rows(study_records(3, 0, seed=0))
    lost = rows["record"] == rows["record"][0]
    rows.loc[lost, "estimate"], rows.loc[lost, "status"] = np.nan, f"{NOT_CONVERGED}; look"
    table = summarise(rows)
    assert (table["declined"] == 1).all()
    assert (table["not_converged"] == 1).all()
    assert (table["doubted"] == 0).all()
    assert "2 with an estimate, 1 did not converge, " in sentences(table)[0]


def test_a_study_without_any_estimate_says_so():
    rows = motion_rows(study_records(2, 0, seed=0)).assign(estimate=np.nan)
    table = summarise(rows)
    assert table["rms_error_percent"].isna().all()
    assert sentences(table) == ["stationary, mismatch none: none of 2 records has an estimate"]
