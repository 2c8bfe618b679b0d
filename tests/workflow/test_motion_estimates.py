"""Motions of files whose table names their rigs."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from helpers.hand_made_posteriors import grid

from bayes_tyre.embedded import data_path
from bayes_tyre.inference.motion.hierarchy.model import Motions
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.workflow.execution.batch import Machines
from bayes_tyre.workflow.raw import motion
from bayes_tyre.workflow.raw.motion import Estimated, MotionPlan, estimate_files, fit_estimates

FACTORS = grid(repeats=2, speeds=(0.0,))


def estimated() -> Estimated:
    nothing = np.zeros((len(FACTORS), 5))
    motions = Motions(FACTORS, np.zeros((len(FACTORS), 5, 5)), nothing, nothing, nothing)
    table = FACTORS.assign(status="ok")
    return Estimated(table, motions, pd.DataFrame({"file": [], "reason": []}), [], [])


def test_rig_files_of_the_cases_are_inputs_and_say_how_accurate_they_are(monkeypatch, tmp_path):
    files = [tmp_path / f"{name}.lvm" for name in "abc"]
    accuracy = "\n[accuracy]\nload_relative_sd = 0.01\n"
    (tmp_path / "mine.toml").write_text(data_path("rigs/single.toml").read_text() + accuracy)
    cases = pd.DataFrame({"file": [file.name for file in files], "rig": ["mine.toml", "dual", "mine.toml"]})
    factors = {"configuration": "wide", "speed_km_h": 0, "initial_load_kN": 20, "step_kN": 10, "repeat": 1}
    cases.assign(**factors).to_csv(tmp_path / "cases.csv", index=False)
    made = estimated()
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
