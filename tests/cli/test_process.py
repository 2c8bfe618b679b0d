"""`process`: records, rejected files with reasons, pictures, the same whatever the number of processes."""

import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest
from helpers import own_cluster
from helpers.command_line import assert_refused, environment, here, start, tree_of
from helpers.dying_work import DEADLY, work

from bayes_tyre.embedded import data_path
from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.signals.factors import factors_from_name
from bayes_tyre.signals.process import process
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.execution.batch import as_completed
from bayes_tyre.workflow.execution.executors import local_processes
from bayes_tyre.workflow.raw import process as workflow
from bayes_tyre.workflow.raw.simulate import write_simulated

GOOD = ("DynamicS(0)30-20(1).lvm", "DynamicS(0)20-30(2).lvm", "DynamicD(0)30-40(3).lvm")
RIGS = {name: load_rig(name) for name in ("single", "dual")}
FACTORS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN", "repeat"]


def record_into(folder, seed, *names) -> None:
    """Write short simulated recordings of these names."""
    plan = [
        record._replace(duration_s=2.5, step_between_s=(1.0, 1.1))
        for record in thesis_plan(5000.0)
        if record.file in names
    ]
    write_simulated(plan, RIGS, seed, folder, lambda done: None)


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """Return a folder of three simulated recordings, one without a step and one that is no recording."""
    folder = tmp_path_factory.mktemp("raw")
    record_into(folder, 0, *GOOD)
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
    out, stdout, stderr = done
    records, rejected = pd.read_csv(out / "records.csv"), pd.read_csv(out / "rejected.csv")
    assert stdout.splitlines()[-1] == "3 records, 3 rejected"
    assert set(records["record"]) == {"S(0)30-20(1)", "S(0)20-30(2)", "D(0)30-40(3)"}
    assert set(records["origin"]) == {"simulated"}
    assert {*FACTORS, "time_s", "displacement_sd_mm", "force_sd_kN", "mass_kg", "load_clarity"} <= set(records)
    assert stderr == "".join(f"bayes-tyre: warning: {file}: {why}\n" for file, why in rejected.to_numpy())
    reasons = rejected.assign(file=[name.split("/")[-1] for name in rejected["file"]]).set_index("file")["reason"]
    assert "a step needs 5" in reasons["DynamicS(0)30-20(2).lvm"]
    assert "--cases" in reasons["run7.lvm"]
    assert len(reasons["DynamicS(0)30-20(3).lvm"]) > 10
    assert {path.name for path in (out / "pictures").iterdir()} == {f"{name}.png" for name in set(records["record"])}


def test_records_of_a_rig_share_its_mass(done, raw):
    """Each has the force that it had with its own mass, less what the difference between the masses accelerates."""
    records = pd.read_csv(done[0] / "records.csv")
    masses = records.groupby("configuration")[["mass_kg", "mass_sd_kg"]].nunique()
    assert masses.to_numpy().tolist() == [[1, 1], [1, 1]]
    changes = []
    for name, rows in records.groupby("record"):
        file = raw / f"Dynamic{name}.lvm"
        alone = process(read_raw(file), RIGS[rows["configuration"].iloc[0]], factors_from_name(file.name), "inertia")
        change = rows["mass_kg"].iloc[0] - float(alone.extras["mass_kg"])
        changes.append(abs(change))
        expected = alone.force_kN + change * np.asarray(alone.force_per_kg_kN)
        np.testing.assert_allclose(rows["force_kN"], expected, atol=1e-6)
        assert rows["mass_sd_kg"].iloc[0] < 1.01 * float(alone.extras["mass_sd_kg"])
    assert max(changes) > 1.0


def test_configurations_on_one_rig_file_have_a_mass_each(raw, tmp_path):
    command = here("process", raw, "--rig", "single", "--out", tmp_path / "records.csv", "--quiet", "--workers", 1)
    assert command.exit_code == 0, command.stderr
    mass = pd.read_csv(tmp_path / "records.csv").groupby("configuration")["mass_kg"].unique()
    assert [len(each) for each in mass] == [1, 1]
    assert abs(mass["dual"][0] - mass["single"][0]) > 50.0  # simulated: 345 and 231 kg


def test_text_files_wait_for_no_library_that_they_do_not_need(raw, tmp_path):
    script = f"""
import sys
from bayes_tyre.cli import app
try:
    app(["process", {str(raw / GOOD[0])!r}, "--out", "records.csv"], prog_name="bayes-tyre")
finally:
    print([name for name in ("jax", "equinox", "scipy.io", "h5py", "openpyxl", "nptdms") if name in sys.modules])
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.endswith("1 records, 0 rejected\n[]\n")


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(done, raw, tmp_path):
    out, _, _ = done
    command = here("process", raw, "--out", tmp_path / "records.csv", "--workers", 2)
    assert command.exit_code == 0, command.stderr
    for name in ("records.csv", "rejected.csv"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()


@pytest.mark.slow
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
    assert records[FACTORS].drop_duplicates().to_numpy().tolist() == [["wide", "unloading", 0.0, 30.0, -10.0, 2]]
    assert set(records["origin"]) == {"simulated"}
    alone = here("process", raw / "run7.lvm", *options[:2], *options[4:])
    assert_refused(alone.exit_code, alone.stderr, "--rig", "'wide'")


def test_a_row_of_the_cases_names_a_rig_file(raw, tmp_path):
    folder = tmp_path / "campaign"
    (folder / "rigs").mkdir(parents=True)
    single = data_path("rigs/single.toml").read_text()
    assert "1300" in single
    (folder / "rigs" / "long.toml").write_text(single.replace("1300", "1301"))
    row = {"configuration": "wide", "speed_km_h": 0, "initial_load_kN": 30, "step_kN": -10, "repeat": 1}
    shutil.copy(raw / GOOD[0], tmp_path / "a.lvm")
    shutil.copy(raw / GOOD[0], tmp_path / "b.lvm")
    cases = folder / "cases.csv"

    def displacements(rig_of_a: str, *options: object) -> tuple[np.ndarray, np.ndarray]:
        table = pd.DataFrame([{"file": "a.lvm", **row, "rig": rig_of_a}, {"file": "b.lvm", **row, "rig": ""}])
        table.to_csv(cases, index=False)
        files = [tmp_path / "a.lvm", tmp_path / "b.lvm"]
        done = here("process", *files, "--cases", cases, "--out", tmp_path / "r.csv", "--workers", 1, *options)
        assert done.exit_code == 0, done.stderr
        records = pd.read_csv(tmp_path / "r.csv").groupby("record")["displacement_mm"]
        return tuple(records.get_group(name).to_numpy() for name in ("a", "b"))

    a, b = displacements("rigs/long.toml", "--rig", "single")
    np.testing.assert_array_equal(displacements("single", "--rig", folder / "rigs" / "long.toml")[1], a)
    assert not np.array_equal(a, b)
    (folder / "rigs" / "long.toml").write_text(single.replace("1300", "1302"))
    resumed, _ = displacements("rigs/long.toml", "--rig", "single", "--resume")
    assert not np.array_equal(resumed, a)
    pd.DataFrame([{"file": "a.lvm", **row, "rig": "none.toml"}]).to_csv(cases, index=False)
    before = tree_of(tmp_path)
    refused = here("process", tmp_path / "a.lvm", "--cases", cases, "--out", tmp_path / "s.csv")
    assert_refused(refused.exit_code, refused.stderr, "'a.lvm', column rig", "none.toml: no such rig file")
    assert tree_of(tmp_path) == before


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
    out.mkdir()
    (out / "records.csv").write_text("of an earlier run")
    done = here("process", raw / "DynamicS(0)30-20(3).lvm", "--out", out / "records.csv")
    (reason,) = pd.read_csv(out / "rejected.csv")["reason"]
    file = raw / "DynamicS(0)30-20(3).lvm"
    assert_refused(done.exit_code, done.stderr, f"{file}: {reason}; ", "none of 1 files", "rejected.csv")
    assert set(tree_of(out)) == {"rejected.csv"}


def test_a_fault_of_ours_in_one_file_is_a_row(raw, tmp_path, monkeypatch):
    def fail(read, rig, factors, method):
        if factors.record == "S(0)30-20(1)":
            raise ZeroDivisionError("by nothing")
        return process(read, rig, factors, method)

    monkeypatch.setattr(workflow, "process", fail)
    done = here("process", *(raw / name for name in GOOD[:2]), "--out", tmp_path / "r.csv", "--workers", 1)
    assert done.exit_code == 0, done.stderr
    assert set(pd.read_csv(tmp_path / "r.csv")["record"]) == {"S(0)20-30(2)"}
    (reason,) = pd.read_csv(tmp_path / "rejected.csv")["reason"]
    assert re.fullmatch(r"bayes-tyre itself failed .* ZeroDivisionError in \S+\.py, line \d+: by nothing", reason)


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
    outcomes = dict(as_completed(local_processes(2), work, range(6)))
    assert "every process that worked on it died" in str(outcomes.pop(DEADLY))
    assert outcomes == {i: str(i) for i in range(6) if i != DEADLY}


def kept_of(out) -> int:
    """Return of how many files the results are kept beside a table."""
    return sum(path.suffix in (".part", ".reason") for path in out.with_name(f".{out.name}.parts").glob("[!.]*"))


def assert_same(done, folder) -> None:
    """Assert that a folder holds what the undisturbed run wrote, to the byte."""
    for path in (path for path in done.rglob("*") if path.is_file()):
        assert (folder / path.relative_to(done)).read_bytes() == path.read_bytes(), path


@pytest.mark.slow
def test_resume_after_kill_gives_the_bytes_of_an_undisturbed_run(done, raw, tmp_path):
    options = ["--out", tmp_path / "records.csv", "--figures", tmp_path / "pictures", "--workers", 1]
    command = start("process", raw, *options, cwd=tmp_path)
    while command.poll() is None and kept_of(tmp_path / "records.csv") < 2:
        time.sleep(0.005)
    command.kill()
    command.communicate()
    assert not (tmp_path / "records.csv").exists()
    assert here("process", raw, *options, "--resume").exit_code == 0
    assert_same(done[0], tmp_path)


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes_and_what_it_did_outlives_its_scheduler(done, raw, tmp_path):
    lock = tmp_path / "lock"
    cluster = subprocess.Popen(
        [sys.executable, own_cluster.__file__, GOOD[0], lock], cwd=tmp_path, env=environment(), text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    with cluster:
        try:
            assert cluster.stdout is not None
            address = cluster.stdout.readline().strip()
            command = ["process", raw, "--cluster", address, "--figures"]
            whole = here(*command, tmp_path / "a" / "pictures", "--out", tmp_path / "a" / "records.csv")
            assert whole.stderr == done[2]
            assert whole.exit_code == 0
            assert_same(done[0], tmp_path / "a")
            lock.touch()
            out = ["--out", tmp_path / "b" / "records.csv"]
            cut = start(*command, tmp_path / "b" / "pictures", *out, cwd=raw)
            while cut.poll() is None and kept_of(out[1]) < 5:  # all but the one that waits
                time.sleep(0.01)
        finally:
            cluster.kill()
    try:
        stdout, stderr = cut.communicate(timeout=60)
    finally:
        cut.kill()
    assert_refused(cut.returncode, stderr, "the scheduler is lost", "--resume")
    assert stdout == ""
    assert not (tmp_path / "b" / "records.csv").exists()
    resumed = here("process", raw, *out, "--figures", tmp_path / "b" / "pictures", "--workers", 1, "--resume")
    assert resumed.exit_code == 0
    assert_same(done[0], tmp_path / "b")


def another_rig(file, rig) -> list[str]:
    text = rig.read_text()
    rig.write_text(text.replace("1300", "1301"))
    assert rig.read_text() != text
    return []


def another_method(file, rig) -> list[str]:
    return ["--method", "thesis"]


def another_file(file, rig) -> list[str]:
    record_into(file.parent, 1, file.name)
    return []


@pytest.mark.parametrize("change", [another_rig, another_method, another_file])
def test_resume_heeds_another_file_rig_and_method(change, raw, tmp_path):
    file, rig = tmp_path / GOOD[0], tmp_path / "rig.toml"
    shutil.copy(raw / GOOD[0], file)
    rig.write_text(data_path("rigs/single.toml").read_text())

    def run(name, *options) -> bytes:
        done = here("process", file, "--rig", rig, "--workers", 1, "--out", tmp_path / name, *options)
        assert done.exit_code == 0, done.stderr
        return (tmp_path / name).read_bytes()

    before = run("r.csv")
    options = change(file, rig)
    after = run("r.csv", "--resume", *options)
    assert after != before
    assert after == run("fresh.csv", *options)


@pytest.mark.parametrize("address", ["tcp://nowhere", "", "bogus://x:1"])
def test_a_cluster_that_is_none_is_refused_and_nothing_written(address, raw, tmp_path):
    refused = here("process", raw, "--out", tmp_path / "new" / "r.csv", "--cluster", address)
    assert_refused(refused.exit_code, refused.stderr, "--cluster", "tcp://host:8786")
    assert tree_of(tmp_path) == {}


def test_a_cluster_and_workers_are_one_too_many(raw, tmp_path):
    assert here("process", raw, "--out", tmp_path / "r.csv", "--cluster", "tcp://h:1", "--workers", 2).exit_code == 2
