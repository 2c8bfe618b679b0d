"""`show` of folders without a posterior: what the command printed, from the table that it wrote."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import here

from bayes_tyre.errors import BadInput
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.workflow.from_results.answers import answer
from bayes_tyre.workflow.from_results.predict import answers

NEXT = (
    "rank,kind,configuration,direction,speed_km_h,initial_load_kN,step_kN,tests,minutes,width_now,width_expected,"
    "origin,verdict\n"
    "1,repeat,single,loading,0,20,10,3,25,0.2,0.151,simulated,pass\n"
    "2,case,dual,,,20,10,1,,0.2,0.18,simulated,pass\n"
)
PLAN = "width_expected,minutes\n0.18,5\n0.151,10\n"
PREDICTION = (
    "configuration,direction,speed_km_h,initial_load_kN,step_kN,displacement_mm,median,lower,upper,origin,verdict\n"
    "a  b,loading,0,20,10,0,20,19.9,20.1,measured,fail\n"
    "a  b,loading,0,20,10,3,26,25.5,26.6,measured,fail\n"
    "a  b,unloading,0,20,-10,-3,14.5,14,15,measured,fail\n"
)
MODES = (
    "parameter,median,lower,upper,unit,status,origin,verdict\n"
    "k_w,12.344,11,13,1/s^2,ok,measured,pass\nsigma,0.1,0,1,,not identified; more modes,measured,pass\n"
)


def folder_of(path: Path, **files: str) -> Path:
    for name, content in files.items():
        (path / f"{name}.csv").write_text(content)
    return path


def test_the_tests_to_run_next_are_listed_with_their_plan(tmp_path):
    assert answer(folder_of(tmp_path, next=NEXT, plan=PLAN)) == [
        "tests to run next (data: simulated, verdict pass)",
        "1  3 more repeats of single (0)20-30: interval 20 % to 15.1 %, 25 min",
        "2  1 test of the new case dual 20-30: interval 20 % to 18 %",
        "plan: 2 tests, 20 % to 15.1 %, 10 min",
    ]


def test_a_ring_and_a_calibration_say_what_is_not_identified_or_not_calibrated(tmp_path):
    ring, calibration = tmp_path / "ring", tmp_path / "calibration"
    for folder in (ring, calibration):
        folder.mkdir()
    assert answer(folder_of(ring, modes=MODES)) == [
        "flexible ring (data: measured): verdict pass",
        "k_w 12.34 [11, 13] 1/s^2",
        "sigma 0.1 [0, 1] : not identified",
    ]
    lines = answer(folder_of(calibration, calibration="parameter,calibrated\nk,True\nbeta,False\n"))
    assert lines[1:] == ["calibrated: 1 of 2 parameters", "not calibrated: beta"]


def test_a_comparison_is_shown_as_it_was_printed_but_not_beside_a_posterior(tmp_path):
    columns = "rank,model,elpd,se,elpd_difference,difference_se,weight,records,verdict\n"
    folder = folder_of(tmp_path, comparison=f"{columns}1,one,10,1,0,0,0.9,24,pass\n2,two,2,1.5,-8,2,0.1,24,fail\n")
    assert answer(folder) == [
        "models compared by leave-one-out",
        "records left out, one at a time:",
        "1  one  elpd 10.0 ± 1.0  difference 0.0 ± 0.0  weight 0.90  pass",
        "2  two  elpd 2.0 ± 1.5  difference -8.0 ± 2.0  weight 0.10  fail",
        "one predicts a record left out better than two (-8.0 ± 2.0), by more than chance.",
    ]
    (folder / "comparison_cases.csv").write_text(
        f"{columns.replace('records', 'cases')}1,two,10,1,0,0,0.9,8,pass\n2,one,9,1.5,-1,2,0.1,8,pass\n"
    )
    assert "cases left out, one at a time:" in answer(folder)
    assert answer(folder)[-1].startswith("two predicts a case left out best, but these 8 cases cannot tell it from one")
    (folder / "posterior.nc").touch()
    assert answer(folder) == []


def test_a_prediction_gives_the_force_at_the_end_of_each_curve_and_keeps_two_spaces_in_a_label(tmp_path):
    folder = folder_of(tmp_path, prediction=PREDICTION)
    lines = [
        "predicted curves (data: measured, verdict fail)",
        "a  b (0)20-30 loading, 3 mm from the start of the step: 26 kN [25.5, 26.6]",
        "a  b (0)20-10 unloading, -3 mm from the start of the step: 14.5 kN [14, 15]",
    ]
    assert answer(folder) == lines
    assert here("show", folder).stdout.splitlines()[1:-1] == lines


def test_a_curve_is_named_by_what_there_is_of_its_case_and_given_at_its_far_end():
    curve = {"displacement_mm": [0.0, -4.0, -2.0], "median": [1.0, 2.0, 3.0], "lower": 0.5, "upper": 4.0}
    given = {"configuration": "", "direction": "unloading", "speed_km_h": 0.0, "initial_load_kN": 20.0}

    def said(**factors: object) -> list[str]:
        return answers(pd.DataFrame({**curve, **given, "step_kN": np.nan, **factors}))

    force = "-4 mm from the start of the step: 2 kN [0.5, 4]"
    assert said() == [f"unloading (0) load 20 kN, {force}"]
    assert said(direction="", step_kN=-10.0) == [f"(0)20-10, {force}"]
    long = "a configuration of forty letters or more"
    assert said(configuration=long, step_kN=-10.0) == [f"{long} (0)20-10 unloading, {force}"]


def test_curves_that_are_not_printed_are_counted():
    curves = pd.DataFrame({**dict.fromkeys(CASE_FACTORS, 1.0), "speed_km_h": range(6), "displacement_mm": 4.0})
    lines = answers(curves.assign(median=1.0, lower=0.5, upper=2.0))
    assert len(lines) == 5
    assert lines[-1] == "2 more curves"
    assert len(answers(curves.assign(median=1.0, lower=0.5, upper=2.0), 6)) == 6


def test_the_published_numbers_are_counted_by_kind(tmp_path):
    folder = folder_of(tmp_path, published_check="kind,agrees\nrecomputed,True\nrecomputed,False\nerratum,True\n")
    assert answer(folder)[1:] == ["recomputed: 1 of 2 agree", "erratum: 1 of 1 agree"]


def test_show_prints_it_and_refuses_another_program_s_table(tmp_path):
    shown = here("show", folder_of(tmp_path, modes=MODES))
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert shown.stdout.splitlines()[-1] == f"files: {tmp_path}"
    assert "k_w 12.34 [11, 13] 1/s^2" in shown.stdout
    assert answer(tmp_path / "elsewhere") == []
    with pytest.raises(BadInput, match=r"modes\.csv: is not what its command writes; run it again"):
        answer(folder_of(tmp_path, modes="a,b\n1,2\n"))
