"""`process`: records, and rejected files with reasons."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, printed_and_imported, tree_of
from helpers.documented import documented_columns
from helpers.process_recordings import FACTORS, GOOD, RIGS

from bayes_tyre.formats.recordings.raw import read_raw
from bayes_tyre.signals.factors import factors_from_name
from bayes_tyre.signals.process import process
from bayes_tyre.workflow.raw import process as workflow


def test_every_file_is_a_record_or_a_reason(processed):
    out, stdout, stderr = processed
    records, rejected = pd.read_csv(out / "records.csv"), pd.read_csv(out / "rejected.csv")
    assert stdout.splitlines()[-1] == "3 records, 3 rejected"
    assert set(records["record"]) == {"S(0)30-20(1)", "S(0)20-30(2)", "D(0)30-40(3)"}
    assert set(records["origin"]) == {"simulated"}
    assert {*FACTORS, "time_s", "displacement_sd_mm", "force_sd_kN", "mass_kg", "load_clarity"} <= set(records)
    assert set(records) <= documented_columns()
    assert stderr == "".join(f"bayes-tyre: warning: {file}: {why}\n" for file, why in rejected.to_numpy())
    reasons = rejected.assign(file=[name.split("/")[-1] for name in rejected["file"]]).set_index("file")["reason"]
    assert "a step needs 5" in reasons["DynamicS(0)30-20(2).lvm"]
    assert "--cases" in reasons["run7.lvm"]
    assert len(reasons["DynamicS(0)30-20(3).lvm"]) > 10
    assert {path.name for path in (out / "pictures").iterdir()} == {f"{name}.png" for name in set(records["record"])}


def test_records_of_a_rig_share_its_mass(processed, recordings):
    """Each has the force that it had with its own mass, less what the difference between the masses accelerates."""
    records = pd.read_csv(processed[0] / "records.csv")
    masses = records.groupby("configuration")[["mass_kg", "mass_sd_kg"]].nunique()
    assert masses.to_numpy().tolist() == [[1, 1], [1, 1]]
    changes = []
    for name, rows in records.groupby("record"):
        file = recordings / f"Dynamic{name}.lvm"
        alone = process(read_raw(file), RIGS[rows["configuration"].iloc[0]], factors_from_name(file.name), "inertia")
        change = rows["mass_kg"].iloc[0] - float(alone.extras["mass_kg"])
        changes.append(abs(change))
        expected = alone.force_kN + change * np.asarray(alone.force_per_kg_kN)
        np.testing.assert_allclose(rows["force_kN"], expected, atol=1e-6)
        assert rows["mass_sd_kg"].iloc[0] < 1.01 * float(alone.extras["mass_sd_kg"])
    assert max(changes) > 1.0


def test_configurations_on_one_rig_file_have_a_mass_each(recordings, tmp_path):
    command = here(
        "process", recordings, "--rig", "single", "--out", tmp_path / "records.csv", "--quiet", "--workers", 1
    )
    assert command.exit_code == 0, command.stderr
    mass = pd.read_csv(tmp_path / "records.csv").groupby("configuration")["mass_kg"].unique()
    assert [len(each) for each in mass] == [1, 1]
    assert abs(mass["dual"][0] - mass["single"][0]) > 50.0  # simulated: 345 and 231 kg


def test_text_files_wait_for_no_library_that_they_do_not_need(recordings, tmp_path):
    heavy = ("jax", "equinox", "scipy.io", "h5py", "openpyxl", "nptdms")
    command = ["process", str(recordings / GOOD[0]), "--out", "records.csv"]
    (said,), imported = printed_and_imported([command], heavy, tmp_path)
    assert said.endswith("1 records, 0 rejected\n")
    assert imported == []


@pytest.mark.slow
def test_inertia_brings_k_back_and_the_source_does_not(recordings, processed, tmp_path):
    """k of three records within 5 %: each has a standard error of some 1 % from noise, and of 1 % from the mass."""
    out, _, _ = processed
    truth = pd.read_csv(recordings / "truth.csv").set_index("file")["k_kN_per_mm"]
    errors = {}
    done = here("process", recordings, "--method", "thesis", "--out", tmp_path / "t.parquet", "--workers", 1)
    assert done.exit_code == 0, done.stderr
    assert set(pd.read_parquet(tmp_path / "t.parquet")) <= documented_columns()
    for method, table in (("inertia", out / "records.csv"), ("thesis", tmp_path / "t.parquet")):
        fitted = here("lsq", table, "--out", tmp_path / method, "--bounds", "beta=:1")
        assert fitted.exit_code == 0, fitted.stderr
        fits = pd.read_csv(tmp_path / method / "least_squares.csv").set_index("record")["k_kN_per_mm"]
        errors[method] = [fits[name] / truth[f"Dynamic{name}.lvm"] - 1 for name in fits.index]
    assert np.abs(errors["inertia"]).max() < 0.05
    assert np.abs(errors["thesis"]).min() > 0.1


def test_a_recording_that_nothing_calls_simulated_is_measured(recordings, tmp_path):
    text = (recordings / GOOD[0]).read_text()
    silent = "".join(line for line in text.splitlines(keepends=True) if "simulated" not in line)
    assert silent != text
    (tmp_path / GOOD[0]).write_text(silent)
    assert here("process", tmp_path / GOOD[0], "--out", tmp_path / "r.csv").exit_code == 0
    assert set(pd.read_csv(tmp_path / "r.csv")["origin"]) == {"measured"}


def test_files_of_one_name_are_records_of_their_own(recordings, tmp_path):
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
        shutil.copy(recordings / GOOD[0], tmp_path / folder)
    done = here("process", tmp_path / "monday", tmp_path / "tuesday", "--out", tmp_path / "r.csv", "--workers", 1)
    assert done.exit_code == 0
    assert set(pd.read_csv(tmp_path / "r.csv")["record"]) == {"monday/S(0)30-20(1)", "tuesday/S(0)30-20(1)"}


def test_with_no_usable_file_there_are_reasons_alone(recordings, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "records.csv").write_text("of an earlier run")
    done = here("process", recordings / "DynamicS(0)30-20(3).lvm", "--out", out / "records.csv")
    (reason,) = pd.read_csv(out / "rejected.csv")["reason"]
    file = recordings / "DynamicS(0)30-20(3).lvm"
    assert_refused(done.exit_code, done.stderr, f"{file}: {reason}; ", "none of 1 files", "rejected.csv")
    assert set(tree_of(out)) == {"rejected.csv"}


def test_a_fault_of_ours_in_one_file_is_a_row(recordings, tmp_path, monkeypatch):
    def fail(read, rig, factors, method):
        if factors.record == "S(0)30-20(1)":
            raise ZeroDivisionError("by nothing")
        return process(read, rig, factors, method)

    monkeypatch.setattr(workflow, "process", fail)
    done = here("process", *(recordings / name for name in GOOD[:2]), "--out", tmp_path / "r.csv", "--workers", 1)
    assert done.exit_code == 0, done.stderr
    assert set(pd.read_csv(tmp_path / "r.csv")["record"]) == {"S(0)20-30(2)"}
    (reason,) = pd.read_csv(tmp_path / "rejected.csv")["reason"]
    assert re.fullmatch(r"bayes-tyre itself failed .* ZeroDivisionError in \S+\.py, line \d+: by nothing", reason)


def test_a_file_for_which_there_is_no_memory_is_a_row_that_says_so(recordings, tmp_path, monkeypatch):
    def fail(read, rig, factors, method):
        raise RuntimeError(f"RESOURCE_EXHAUSTED: Out of memory allocating 92082568 bytes. {'x' * 10_000}")

    monkeypatch.setattr(workflow, "process", fail)
    done = here("process", recordings / GOOD[0], "--out", tmp_path / "r.csv", "--workers", 1)
    assert_refused(done.exit_code, done.stderr, f"{GOOD[0]}: not enough memory to work on it; give it more, or cut the")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "records.txt"], "--out"),
        (["--rig", "none.toml"], "no such rig"),
        (["--cases", "no.csv"], "no such file"),
    ],
)
def test_options_of_no_use_are_refused_before_the_work(recordings, tmp_path, options, said):
    given = [*([] if "--out" in options else ["--out", tmp_path / "r.csv"]), *options]
    done = here("process", recordings / GOOD[0], *given)
    assert_refused(done.exit_code, done.stderr, said)
    assert tree_of(tmp_path) == {}
