"""`process`: records, rejected files with reasons, pictures, the same whatever the number of processes."""

import shutil

import numpy as np
import pandas as pd
import pytest
from command_line import assert_refused, here, start, tree_of
from dying_work import DEADLY, work

from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.parallel import in_parallel
from bayes_tyre.workflow.simulate import write_simulated

GOOD = ("DynamicS(0)30-20(1).lvm", "DynamicS(0)20-30(2).lvm", "DynamicD(0)30-40(3).lvm")
WORDS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN", "repeat"]


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """Return a folder of three simulated recordings, one without a step and one that is no recording."""
    folder = tmp_path_factory.mktemp("raw")
    plan = [
        record._replace(duration_s=2.5, step_between_s=(1.0, 1.1))
        for record in thesis_plan(5000.0)
        if record.file in GOOD
    ]
    write_simulated(plan, 0, folder, lambda done: None)
    text = (folder / GOOD[0]).read_text().splitlines(keepends=True)
    still = [*text[:-12500], *[line for line in text[-12500:] if float(line.split("\t")[0]) < 0.9]]
    (folder / "DynamicS(0)30-20(2).lvm").write_text("".join(still))
    (folder / "DynamicS(0)30-20(3).lvm").write_text("no recording at all")
    shutil.copy(folder / GOOD[0], folder / "run7.lvm")
    return folder


@pytest.fixture(scope="module")
def done(raw, tmp_path_factory):
    """Return where the command wrote, and what it printed."""
    out = tmp_path_factory.mktemp("processed")
    options = ["--out", out / "records.csv", "--figures", out / "pictures", "--workers", 1]
    done = here("process", raw, "--method", "inertia", *options)
    assert done.exit_code == 0, done.stderr
    return out, done.stdout, done.stderr


def test_every_file_is_a_record_or_a_reason(done):
    out, stdout, _ = done
    records, rejected = pd.read_csv(out / "records.csv"), pd.read_csv(out / "rejected.csv")
    assert stdout.splitlines()[-1] == "3 records, 3 rejected"
    assert set(records["record"]) == {"S(0)30-20(1)", "S(0)20-30(2)", "D(0)30-40(3)"}
    assert set(records["origin"]) == {"simulated"}
    assert {*WORDS, "time_s", "displacement_sd_mm", "force_sd_kN", "mass_kg", "load_clarity"} <= set(records)
    reasons = rejected.assign(file=[name.split("/")[-1] for name in rejected["file"]]).set_index("file")["reason"]
    assert "a step needs 5" in reasons["DynamicS(0)30-20(2).lvm"]
    assert "--cases" in reasons["run7.lvm"]
    assert len(reasons["DynamicS(0)30-20(3).lvm"]) > 10
    assert {path.name for path in (out / "pictures").iterdir()} == {f"{name}.png" for name in set(records["record"])}


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(done, raw, tmp_path):
    out, _, _ = done
    command = start("process", raw, "--out", tmp_path / "records.csv", "--workers", 2, cwd=tmp_path)
    _, stderr = command.communicate(timeout=300)
    assert command.returncode == 0, stderr
    for name in ("records.csv", "rejected.csv"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


def test_inertia_brings_k_back_and_the_source_does_not(raw, done, tmp_path):
    """k of three records within 5 %: each has a standard error of some 1 % from noise, and of 1 % from the mass."""
    out, _, _ = done
    truth = pd.read_csv(raw / "truth.csv").set_index("file")["k_kN_per_mm"]
    errors = {}
    assert here("process", raw, "--method", "thesis", "--out", tmp_path / "t.parquet", "--workers", 1).exit_code == 0
    for method, table in (("inertia", out / "records.csv"), ("thesis", tmp_path / "t.parquet")):
        fitted = here("lsq", table, "--out", tmp_path / method, "--bounds", "beta=:1")
        assert fitted.exit_code == 0, fitted.stderr
        fits = pd.read_csv(tmp_path / method / "least_squares.csv").set_index("record")["k_kN_per_mm"]
        errors[method] = [fits[name] / truth[f"Dynamic{name}.lvm"] - 1 for name in fits.index]
    assert np.abs(errors["inertia"]).max() < 0.05
    assert np.abs(errors["thesis"]).min() > 0.1


def test_cases_name_what_names_do_not(raw, tmp_path):
    row = {"file": "run7.lvm", "configuration": "wide", "speed_km_h": 0, "initial_load_kN": 30, "step_kN": -10}
    pd.DataFrame([{**row, "repeat": 2}]).to_csv(tmp_path / "cases.csv", index=False)
    options = ["--cases", tmp_path / "cases.csv", "--rig", "single", "--out", tmp_path / "r.csv"]
    assert here("process", raw / "run7.lvm", *options).exit_code == 0
    records = pd.read_csv(tmp_path / "r.csv")
    assert set(records["record"]) == {"run7"}
    assert records[WORDS].drop_duplicates().to_numpy().tolist() == [["wide", "unloading", 0.0, 30.0, -10.0, 2]]
    assert set(records["origin"]) == {"simulated"}
    alone = here("process", raw / "run7.lvm", *options[:2], *options[4:])
    assert_refused(alone.exit_code, alone.stderr, "--rig", "'wide'")


def test_a_recording_that_nothing_calls_simulated_is_measured(raw, tmp_path):
    text = (raw / GOOD[0]).read_text()
    silent = "".join(line for line in text.splitlines(keepends=True) if "simulated" not in line)
    assert silent != text
    (tmp_path / GOOD[0]).write_text(silent)
    assert here("process", tmp_path / GOOD[0], "--out", tmp_path / "r.csv").exit_code == 0
    assert set(pd.read_csv(tmp_path / "r.csv")["origin"]) == {"measured"}


def test_files_of_one_name_are_records_of_their_own(raw, tmp_path):
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
        shutil.copy(raw / GOOD[0], tmp_path / folder)
    done = here("process", tmp_path / "monday", tmp_path / "tuesday", "--out", tmp_path / "r.csv", "--workers", 1)
    assert done.exit_code == 0
    assert set(pd.read_csv(tmp_path / "r.csv")["record"]) == {"monday/S(0)30-20(1)", "tuesday/S(0)30-20(1)"}


def test_with_no_usable_file_there_are_reasons_alone(raw, tmp_path):
    out = tmp_path / "out"
    done = here("process", raw / "DynamicS(0)30-20(3).lvm", "--out", out / "records.csv")
    assert_refused(done.exit_code, done.stderr, "rejected.csv", "none of 1 files")
    assert set(tree_of(out)) == {"rejected.csv"}
    assert len(pd.read_csv(out / "rejected.csv")) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "records.txt"], "--out"),
        (["--rig", "none.toml"], "no such rig"),
        (["--cases", "no.csv"], "no such file"),
    ],
)
def test_options_of_no_use_are_refused_before_the_work(raw, tmp_path, options, said):
    given = [*([] if "--out" in options else ["--out", tmp_path / "r.csv"]), *options]
    done = here("process", raw / GOOD[0], *given)
    assert_refused(done.exit_code, done.stderr, said)
    assert tree_of(tmp_path) == {}


@pytest.mark.slow
def test_a_process_that_dies_loses_nothing_but_its_own_task():
    progress = []
    outcomes = in_parallel(work, range(8), 2, progress.append)
    assert [outcome for i, outcome in enumerate(outcomes) if i != DEADLY] == [str(i) for i in range(8) if i != DEADLY]
    assert "died twice" in str(outcomes[DEADLY])
    assert sum(progress) == 8
