"""`motion --law` with another law, from raw files to tables; `compare` of laws on the same files."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import TABLES, assert_refused, here, tree_of
from helpers.quick_motions import put_draws_for_the_motions

from bayes_tyre.rig.axle import load_rig
from bayes_tyre.simulate.plan import thesis_plan
from bayes_tyre.workflow.raw.simulate import write_simulated

# Fits the motions of two files by two laws, and samples: over 10 s.
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("fully_compiled", "without_figures")]

GOOD = ("DynamicS(0)20-30(1).lvm", "DynamicS(0)30-20(1).lvm")
#: Too few draws for a verdict of `pass`, which asks for 100 effective ones a chain.
FEW = ["--chains", 2, "--warmup", 150, "--draws", 100, "--workers", 1, "--target-accept", 0.8]
LAWS = ("fancher", "maxwell_slip")
PARAMETERS = ["k", "settled", "beta", "m", "c", "energy_per_cycle"]


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """Return a folder of two recordings simulated with Fancher's law."""
    folder = tmp_path_factory.mktemp("raw")
    plan = [r._replace(duration_s=2.5, step_between_s=(1.0, 1.1)) for r in thesis_plan(4000.0) if r.file in GOOD]
    write_simulated(plan, {"single": load_rig("single")}, 0, folder, lambda done: None)
    return folder


@pytest.fixture(scope="module")
def results(raw, tmp_path_factory):
    """Return the folder of each law's result."""
    out = tmp_path_factory.mktemp("results")
    for law in LAWS:
        done = here("motion", raw, "--out", out / law, "--law", law, *FEW)
        assert done.exit_code == 4, done.stderr
    return {law: out / law for law in LAWS}


def test_the_tables_hold_the_laws_own_parameters(results):
    out = results["maxwell_slip"]
    assert {"posterior.nc", *TABLES, "estimates.csv", "run.json"} <= set(tree_of(out))
    cases, estimates = pd.read_csv(out / "cases.csv"), pd.read_csv(out / "estimates.csv")
    assert list(dict.fromkeys(cases["parameter"])) == PARAMETERS
    assert {"settled_kN", "settled_kN_se", "beta_mm", "log_evidence"} <= set(estimates)
    assert "x_kN" not in estimates
    assert json.loads((out / "run.json").read_text())["options"]["law"] == "maxwell_slip"
    assert xr.open_datatree(out / "posterior.nc").attrs["law"] == "maxwell_slip"
    # The law is not the records': its own check has to say so.
    assert (estimates["status"] != "ok").all()


def test_spring_and_damper_come_with_their_classic_estimate_from_the_free_vibration(raw, tmp_path):
    done = here("motion", raw / GOOD[1], "--out", tmp_path, "--law", "kelvin_voigt", *FEW)
    assert done.exit_code == 4, done.stderr
    row = pd.read_csv(tmp_path / "estimates.csv").iloc[0]
    # On the steep beginnings of the records' branches small swings meet a stiffer spring than the fit's.
    assert 1.0 < row["decay_k_kN_per_mm"] / row["k_kN_per_mm"] < 4.0
    assert 1.0 < row["decay_c_kN_s_per_mm"] / row["c_kN_s_per_mm"] < 10.0


def test_laws_are_ranked_and_that_of_the_simulation_is_first(results, tmp_path):
    done = here("compare", *results.values(), "--out", tmp_path, "--no-refit")
    assert done.exit_code == 4, done.stderr
    table = pd.read_csv(tmp_path / "comparison.csv")
    assert list(table["model"]) == ["fancher", "maxwell_slip"]
    worse = table.iloc[1]
    assert worse["elpd_difference"] < -2 * worse["difference_se"]
    assert "fancher predicts a record left out better than maxwell_slip" in done.stdout
    by_record = pd.read_csv(tmp_path / "comparison_records.csv")
    evidence = {law: pd.read_csv(out / "estimates.csv")["log_evidence"].to_numpy() for law, out in results.items()}
    differences = by_record[by_record["model"] == "fancher"]["elpd"].to_numpy() - (
        by_record[by_record["model"] == "maxwell_slip"]["elpd"].to_numpy()
    )
    # What other records tell of a record's few parameters is worth tens at most; its readings decide by more.
    np.testing.assert_allclose(differences, evidence["fancher"] - evidence["maxwell_slip"], rtol=0, atol=60.0)


def test_motions_of_other_files_and_fits_are_not_compared(results, raw, tmp_path, monkeypatch):
    put_draws_for_the_motions(monkeypatch)
    changed = shutil.copytree(raw, tmp_path / "raw")
    with (changed / GOOD[0]).open("a") as file:
        file.write("\n")
    for other, said in ((raw / GOOD[0], "do not both have"), (changed, "run motion on one set by each law")):
        made = here("motion", other, "--out", tmp_path / "made", *FEW)
        assert made.exit_code == 0, made.stderr
        done = here("compare", results["fancher"], tmp_path / "made", "--out", tmp_path / "out")
        assert_refused(done.exit_code, done.stderr, "not of the same raw files", said)
        assert not (tmp_path / "out").exists()
