"""Motions of files: rigs that their table names, and the columns of a law."""

import re
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from helpers.documented import documented_columns
from helpers.hand_made_posteriors import grid
from helpers.map_estimates import map_estimate

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.inference.motion.hierarchy.model import Motions
from bayes_tyre.inference.motion.laws import FANCHER, MOTION_LAWS
from bayes_tyre.inference.motion.record.model.parameters import parameter_names
from bayes_tyre.inference.motion.record.model.window import Window
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.workflow.execution.batch import Machines
from bayes_tyre.workflow.execution.resume import Callbacks
from bayes_tyre.workflow.raw import motion, motion_estimates
from bayes_tyre.workflow.raw.estimate_columns import columns
from bayes_tyre.workflow.raw.motion import Estimated, estimate_files, fit_estimates
from bayes_tyre.workflow.raw.motion_plan import MotionPlan

FACTORS = grid(repeats=2, speeds=(0.0,))


def estimated() -> Estimated:
    nothing = np.zeros((len(FACTORS), 5))
    motions = Motions(FACTORS, np.zeros((len(FACTORS), 5, 5)), nothing, nothing, nothing)
    table = FACTORS.assign(status="ok")
    return Estimated(table, motions, pd.DataFrame({"file": [], "reason": []}), [], [])


def test_rig_files_of_the_cases_are_inputs_and_say_how_accurate_they_are(monkeypatch, tmp_path):
    files = [tmp_path / f"{name}.lvm" for name in "abc"]
    accuracy = "\n[accuracy]\nload_relative_sd = 0.01\ndisplacement_relative_sd = 0.005\n"
    (tmp_path / "mine.toml").write_text(data_path("rigs/single.toml").read_text() + accuracy)
    cases = pd.DataFrame({"file": [file.name for file in files], "rig": ["mine.toml", "dual", "mine.toml"]})
    factors = {"configuration": "wide", "speed_km_h": 0, "initial_load_kN": 20, "step_kN": 10, "repeat": 1}
    cases.assign(**factors).to_csv(tmp_path / "cases.csv", index=False)
    made = estimated()
    table = made.table.iloc[:3].assign(displacement_mm=5.0)
    monkeypatch.setattr(motion, "run_batch", lambda estimate, tasks, *_: [task.file for task in tasks])
    monkeypatch.setattr(motion, "read_parts", lambda parts: table)
    monkeypatch.setattr(motion, "estimates_of", lambda table, law: (table, made.motions))
    monkeypatch.setattr(motion, "shown_motions", lambda parts: None)
    plan = MotionPlan(SamplerSettings(), cases=tmp_path / "cases.csv")
    found = estimate_files(files, plan, Machines(1, None, False), tmp_path / "out", lambda done: None)
    assert found.rig_files == (tmp_path / "mine.toml",)
    inputs, known = [], {}

    def begun(call, options, seed, files, origin, began):
        inputs.extend(files)
        known.update(options)
        raise InterruptedError

    monkeypatch.setattr(motion, "begin_run", begun)
    with pytest.raises(InterruptedError):
        fit_estimates(found, plan, tmp_path / "out", [])
    assert inputs == [*files, tmp_path / "mine.toml", tmp_path / "cases.csv"]
    assert known["rig_files"] == [str(tmp_path / "mine.toml")]
    assert (known["force_scale_sd"], known["displacement_scale_sd"]) == (0.01, 0.005)  # of the least accurate rig
    with pytest.raises(InterruptedError):
        fit_estimates(found, replace(plan, force_scale_sd=0.02), tmp_path / "out", [])
    assert (known["force_scale_sd"], known["displacement_scale_sd"]) == (0.02, 0.005)


def test_the_time_of_a_run_is_counted_from_when_the_command_began(monkeypatch, tmp_path):
    runs = []

    def opened(out, run, *_, **__):
        runs.append(run)
        raise InterruptedError

    monkeypatch.setattr(motion, "open_checkpoints", opened)
    with pytest.raises(InterruptedError):
        fit_estimates(estimated(), MotionPlan(SamplerSettings()), tmp_path, [], Callbacks(began=1.5))
    assert runs[0].began == 1.5


@pytest.mark.parametrize("name", ["force_scale_sd", "displacement_scale_sd"])
@pytest.mark.parametrize("sd", [-0.01, np.inf, np.nan])
def test_a_factor_that_cannot_be_known_so_is_refused(name, sd):
    with pytest.raises(BadInput, match=rf"{name} is {sd:g}; give 0 or more"):
        MotionPlan(SamplerSettings(), **{name: sd})


def test_columns_are_those_of_the_law():
    assert {"relaxing_share", "relaxation_s_se"} <= set(columns(MOTION_LAWS["relaxing"]))
    auto = MOTION_LAWS["auto"]
    assert [name for name in columns(auto) if name not in columns(FANCHER)] == [
        f"{prefix}{law}" for prefix in ("weight_", "log_evidence_") for law in auto.averaged
    ]


@pytest.mark.parametrize("law", MOTION_LAWS.values(), ids=MOTION_LAWS)
def test_columns_are_in_the_reference(law):
    assert {re.sub(r"_se(_without_force)?$", "", name) for name in columns(law)} <= documented_columns()


def test_an_extension_is_reported_at_the_peak_with_its_standard_error():
    law = MOTION_LAWS["relaxing"]
    names = parameter_names(law)
    prior = np.stack([np.zeros(len(names)), np.ones(len(names))])
    prior[:, names.index("relaxation_s")] = np.log(0.01), 0.5
    standard, covariance = np.zeros(len(names)), np.eye(len(names))
    standard[names.index("relaxation_s")] = 0.4
    covariance[names.index("relaxation_s"), names.index("relaxation_s")] = 0.09
    none = jnp.zeros((3, 4))
    window = Window(jnp.array(1e-3), none, none, jnp.ones(3) / 3, jnp.asarray(prior), law=law)
    found = motion_estimates._extensions(window, map_estimate(standard, covariance))
    tau = 0.01 * np.exp(0.5 * 0.4)
    assert found == pytest.approx(
        {"relaxing_share": 0.0, "relaxing_share_se": 1.0, "relaxation_s": tau, "relaxation_s_se": tau * 0.5 * 0.3}
    )
