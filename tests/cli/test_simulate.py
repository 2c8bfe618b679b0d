"""`simulate`: files named and laid out as the source's, truth beside them, the same each time, and what is refused."""

from collections import namedtuple

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, printed_and_imported, tree_of
from helpers.documented import documented_columns
from helpers.readme_rigs import readme_texts

from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.raw import simulate as workflow

RIGS = {name: load_rig(name) for name in ("single", "dual")}
NAMES = {
    f"Dynamic{letter}(0){loads}({repeat}).lvm"
    for letter in "SD"
    for loads in ("20-30", "20-10", "30-40", "30-20")
    for repeat in (1, 2, 3)
}


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Return the folder of a quick plan at 1 kHz, and what the command printed."""
    out = tmp_path_factory.mktemp("simulated") / "quick"
    done = here("simulate", "--out", out, "--rate", 1000, "--seed", 4)
    assert done.exit_code == 0, done.stderr
    return out, done


def test_the_quick_plan_is_24_files_and_their_truth(quick):
    out, done = quick
    assert set(tree_of(out)) == NAMES | {"truth.csv"}
    assert done.stderr == ""
    assert "24 .lvm files (simulated, not measured)" in done.stdout
    assert str(out / "truth.csv") in done.stdout
    truth = pd.read_csv(out / "truth.csv")
    assert set(truth["file"]) == NAMES
    assert set(truth["origin"]) == {"simulated"}
    assert truth.notna().all(axis=None)
    factors = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN", "repeat"]
    parameters = ["k_kN_per_mm", "C_kN", "x_kN", "beta_mm", "m_kg", "c_kN_s_per_mm", "rise_time_s", "step_start_s"]
    states = ["start_displacement_mm", "start_friction_kN", "d_i_mm", "F_i_kN"]
    assert {"record", *factors, *parameters, *states, "noise_load_kN", "load_shape"} <= set(truth)


def test_a_file_reads_back_as_appendix_b1_has_it(quick):
    out, _ = quick
    path = out / "DynamicS(0)30-20(2).lvm"
    text = path.read_text()
    assert "simulated by bayes-tyre, not measured" in text.splitlines()[13]
    (segment,) = read_raw(path).segments
    found = {channel.name: channel for channel in segment}
    readings = ["Raw Acc Voltage", "Acc m/s^2", "Raw Disp Voltage", "Disp mm", "Raw Load Voltage", "Load kN"]
    assert list(found) == [*readings, "Time Elapsed"]
    assert all(len(found[name].values) == 4500 for name in readings)
    assert found["Disp mm"].dt_s == pytest.approx(1e-3)
    truth = pd.read_csv(out / "truth.csv").set_index("file").loc[path.name]
    load = found["Load kN"].values
    assert load[:2000].mean() == pytest.approx(truth["load_before_kN"], abs=0.06)
    assert load[-2000:].mean() == pytest.approx(truth["load_after_kN"], abs=0.06)
    steps = found["Raw Load Voltage"].values / 0.0001525
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=0.004)  # six decimals


def test_the_same_seed_gives_the_same_files_and_another_gives_others(quick, tmp_path):
    out, _ = quick
    again = here("simulate", "--out", tmp_path / "again", "--rate", 1000, "--seed", 4, "--quiet")
    assert (again.exit_code, again.stdout, again.stderr) == (0, "", "")
    assert tree_of(tmp_path / "again") == tree_of(out)
    # Over the first: other numbers under the same names.
    assert here("simulate", "--out", tmp_path / "again", "--rate", 1000, "--seed", 5).exit_code == 0
    first, second = tree_of(out), tree_of(tmp_path / "again")
    assert first.keys() == second.keys()
    assert all(first[name] != second[name] for name in first)


def test_a_file_does_not_depend_on_its_plan_or_its_place_in_it(tmp_path):
    plan = [record._replace(duration_s=1.0, step_between_s=(0.4, 0.5)) for record in thesis_plan(1000.0)[40:46]]
    workflow.write_simulated(plan, RIGS, 4, tmp_path / "six", lambda done: None)
    workflow.write_simulated(plan[::-2], RIGS, 4, tmp_path / "three", lambda done: None)
    six, three = tree_of(tmp_path / "six"), tree_of(tmp_path / "three")
    assert len(three) == 4
    assert all(six[name] == three[name] for name in three if name.endswith(".lvm"))
    rows = pd.read_csv(tmp_path / "six" / "truth.csv", dtype=str).set_index("file")
    pd.testing.assert_frame_equal(
        pd.read_csv(tmp_path / "three" / "truth.csv", dtype=str).set_index("file"), rows[::-2]
    )


def test_standing_and_rolling_records_share_the_columns_of_truth(tmp_path):
    plan = [record._replace(duration_s=1.0, step_between_s=(0.4, 0.5)) for record in thesis_plan(1000.0)]
    workflow.write_simulated([plan[0], plan[40]], RIGS, 0, tmp_path, lambda done: None)
    truth = pd.read_csv(tmp_path / "truth.csv")
    harmonics = truth[[name for name in truth.columns if "_runout_" in str(name)]]
    assert len(harmonics.columns) == 10
    assert harmonics.iloc[0].isna().all()
    assert harmonics.iloc[1].notna().all()
    assert truth.columns[-1] == "origin"
    first_harmonics = truth.columns.str.replace(r"_runout_\d_", "_runout_1_", regex=True)
    assert {*first_harmonics} <= documented_columns()


def test_a_rig_file_stands_for_both_configurations(tmp_path):
    """The machine's channels, and its mass in the truth: drawn within two standard deviations of what the file says."""
    (tmp_path / "mine.toml").write_text(readme_texts()["direct_acting"])
    done = here("simulate", "--out", tmp_path / "raw", "--rate", 1000, "--rig", tmp_path / "mine.toml")
    assert done.exit_code == 0, done.stderr
    rig = load_rig(tmp_path / "mine.toml")
    truth = pd.read_csv(tmp_path / "raw" / "truth.csv")
    mass, relative = rig.axle.effective_mass_kg, rig.axle.effective_mass_relative_sd
    assert truth["m_kg"].between(mass * (1 - 2.01 * relative), mass * (1 + 2.01 * relative)).all()
    names = {channel.name for channel in read_raw(tmp_path / "raw" / truth["file"][0]).segments[0]}
    assert {rig.channels.acceleration, rig.channels.displacement, rig.channels.load} <= names


def test_the_folder_of_another_plan_is_refused_and_left_alone(tmp_path):
    (tmp_path / "DynamicS(15)30-20(1).lvm").write_text("mine")
    before = tree_of(tmp_path)
    done = here("simulate", "--out", tmp_path)
    assert_refused(done.exit_code, done.stderr, "DynamicS(15)30-20(1).lvm", "not of this plan")
    assert tree_of(tmp_path) == before


def test_a_disk_that_is_too_small_is_refused(tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(workflow.shutil, "disk_usage", lambda path: usage(2e9, 1e9, 1e9))
    done = here("simulate", "--out", tmp_path / "full", "--plan", "thesis")
    assert_refused(done.exit_code, done.stderr, "2.9 GB", "1.0 GB are free", "--plan quick")
    assert not (tmp_path / "full").exists()


def test_truth_is_written_last(tmp_path, monkeypatch):
    """Cut short, a folder holds whole recordings and no truth, not the truth of an earlier seed."""
    plan = [record._replace(duration_s=1.0, step_between_s=(0.4, 0.5)) for record in thesis_plan(1000.0)[:3]]
    workflow.write_simulated(plan, RIGS, 0, tmp_path, lambda done: None)

    def cut(done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        workflow.write_simulated(plan, RIGS, 1, tmp_path, cut)
    assert set(tree_of(tmp_path)) == {record.file for record in plan}


@pytest.mark.parametrize("options", [["--plan", "all"], ["--rate", "10"], ["--seed", "-1"], []])
def test_what_is_no_option_is_a_usage_error(options, tmp_path):
    done = here("simulate", *(["--out", tmp_path] if options else []), *options)
    assert done.exit_code == 2
    assert tree_of(tmp_path) == {}


def test_help_names_units_and_an_example_and_waits_for_no_library(tmp_path):
    (said,), imported = printed_and_imported([["simulate", "--help"]], ("jax", "pandas", "scipy", "equinox"), tmp_path)
    assert imported == []
    assert "Example: bayes-tyre simulate --out" in said
    assert "kN/mm" in said
