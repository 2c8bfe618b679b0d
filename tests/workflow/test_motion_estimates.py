"""What is said of records whose estimate failed its check, or that have none."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from helpers.hand_made_posteriors import grid

from bayes_tyre.embedded import data_path
from bayes_tyre.inference.diagnostics.verdict import Diagnostics
from bayes_tyre.inference.motion.hierarchy.model import Motions
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.workflow.execution.batch import Machines
from bayes_tyre.workflow.raw import motion
from bayes_tyre.workflow.raw.motion import Estimated, MotionPlan, estimate_files, fit_estimates, with_estimates

FACTORS = grid(repeats=2, speeds=(0.0,))
SOUND = Diagnostics("pass", (), 1.0, 500.0, 500.0, 0, 0.9, 100, 4, np.nan, ("said before",))


def estimated(bad: int, rejected: int) -> Estimated:
    status = ["Pareto k 1.1"] * bad + ["ok"] * (len(FACTORS) - bad)
    nothing = np.zeros((len(FACTORS), 5))
    motions = Motions(FACTORS, np.zeros((len(FACTORS), 5, 5)), nothing, nothing, nothing)
    rows = pd.DataFrame({"file": ["f"] * rejected, "reason": ["r"] * rejected})
    table = FACTORS.assign(status=status, second_mode_Hz=np.nan)
    return Estimated(table, motions, rows, [], [])


def test_nothing_is_said_where_all_is_well():
    assert with_estimates(SOUND, estimated(0, 0)) == SOUND


@pytest.mark.parametrize(("bad", "named"), [(1, "single 0 loading 1"), (3, "unloading 1"), (4, "and 1 more")])
def test_estimates_that_failed_their_check_are_named_and_half_of_them_fail_the_verdict(bad, named):
    found = with_estimates(SOUND, estimated(bad, 0))
    said = found.reasons if bad >= len(FACTORS) / 2 else found.limitations
    assert found.verdict == ("fail" if bad >= len(FACTORS) / 2 else "pass")
    assert named in said[-1]
    assert "3 times as wide" in said[-1]
    assert found.limitations[0] == "said before"
    assert [row["kind"] for row in found.checks if not row["passed"]] == ["data"] * (found.verdict == "fail")


def test_a_second_mode_that_the_sensors_show_is_said():
    made = estimated(0, 0)
    made.table.loc[:1, "second_mode_Hz"] = 59.0, 61.0
    found = with_estimates(SOUND, made)
    assert found.verdict == "pass"
    first, second = made.table["record"][:2]
    assert found.limitations[-1].startswith(f"{first}, {second}: the sensors show a second mode of the rig, at 60 Hz")


def test_files_without_an_estimate_are_counted():
    found = with_estimates(SOUND, estimated(0, 2))
    assert found.verdict == "pass"
    assert found.limitations[-1].startswith("2 files have no estimate")


def test_rig_files_of_the_cases_are_inputs_and_say_how_accurate_they_are(monkeypatch, tmp_path):
    files = [tmp_path / f"{name}.lvm" for name in "abc"]
    accuracy = "\n[accuracy]\nload_relative_sd = 0.01\n"
    (tmp_path / "mine.toml").write_text(data_path("rigs/single.toml").read_text() + accuracy)
    cases = pd.DataFrame({"file": [file.name for file in files], "rig": ["mine.toml", "dual", "mine.toml"]})
    factors = {"configuration": "wide", "speed_km_h": 0, "initial_load_kN": 20, "step_kN": 10, "repeat": 1}
    cases.assign(**factors).to_csv(tmp_path / "cases.csv", index=False)
    made = estimated(0, 0)
    table = made.table.iloc[:3].assign(displacement_mm=5.0)
    monkeypatch.setattr(motion, "run_batch", lambda estimate, tasks, *_: [task.file for task in tasks])
    monkeypatch.setattr(motion, "read_estimates", lambda parts, law: (table, made.motions))
    monkeypatch.setattr(motion, "shown_motions", lambda parts: None)
    plan = MotionPlan(SamplerSettings(), cases=tmp_path / "cases.csv")
    found = estimate_files(files, plan, Machines(1, None, False), tmp_path / "out", lambda done: None)
    assert found.rig_files == (tmp_path / "mine.toml",)
    inputs, known = [], {}

    def begun(call, options, seed, files, origin):
        inputs.extend(files)
        known.update(options)
        raise InterruptedError

    monkeypatch.setattr(motion, "begin_run", begun)
    with pytest.raises(InterruptedError):
        fit_estimates(found, plan, tmp_path / "out", [])
    assert inputs == [*files, tmp_path / "mine.toml", tmp_path / "cases.csv"]
    assert known["force_scale_sd"] == 0.01  # of the least accurate rig
    with pytest.raises(InterruptedError):
        fit_estimates(found, replace(plan, force_scale_sd=0.02), tmp_path / "out", [])
    assert known["force_scale_sd"] == 0.02
