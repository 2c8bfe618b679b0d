"""`study calibration --around`: the fit it takes, and what it refuses; sampling is in `studies/test_quick_forms.py`."""

import json
import shutil
from hashlib import sha256
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import assert_refused, here, tree_of
from helpers.quick_fits import write_result

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.prepared_records import PreparedRecords
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.studies.calibration import Calibration
from bayes_tyre.studies.outlier_calibration import outlier_calibration
from bayes_tyre.studies.truths import Truths
from bayes_tyre.studies.uniformity import uniformity_table
from bayes_tyre.workflow.from_results import calibration_around as workflow

KEPT = 39


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> Path:
    """Return a folder that `fit` wrote, its table beside it."""
    return write_result(tmp_path_factory.mktemp("around") / "fit")


class NotCompiled:
    """What stands for the fit of the records together with new ones."""

    def __init__(self, records: PreparedRecords, model: ModelSettings) -> None:
        assert len(records.batch.records) == 6
        self.model = model


def truths_of_k(tree: xr.DataTree, records: PreparedRecords, model: ModelSettings, datasets: int) -> Truths:
    """Return as many draws of k; the made-up posterior has not all that new records are drawn from."""
    assert model.noise == "auto"
    return {"k": tree["posterior"]["k"].to_numpy().reshape(-1, len(records.batch.records))[:datasets]}


def calibration(truths: Truths, *_: object) -> Calibration:
    """Return a calibration of as many data sets as there are truths, the ranks of k wrong."""
    rng, datasets = np.random.default_rng(0), len(truths["k"])
    ranks = pd.DataFrame({"k": np.zeros(datasets, dtype=int), "k_new": rng.integers(0, KEPT + 1, datasets)})
    table = uniformity_table({str(name): ranks[name].to_numpy() for name in ranks}, KEPT)
    ranks.insert(0, "dataset", np.arange(datasets))
    none = outlier_calibration(np.zeros((datasets, 0)), np.zeros((datasets, 0), dtype=bool))
    return Calibration(table, ranks, pd.DataFrame({"dataset": np.arange(datasets), "sampling": "ok"}), KEPT, none)


def test_it_reads_a_fit_writes_what_a_calibration_writes_and_names_its_inputs(fitted, tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "posterior_truths", truths_of_k)
    monkeypatch.setattr(workflow, "AugmentedFit", NotCompiled)
    monkeypatch.setattr(workflow, "calibrate_around", calibration)
    done = here("study", "calibration", "--around", fitted, "--out", tmp_path / "made", "--seed", 4)
    assert done.exit_code == 4, done.stderr
    written = {"calibration.csv", "ranks.csv", "datasets.csv", "priors.csv", "run.json", "figures/"}
    assert set(tree_of(tmp_path / "made")) == written | {"figures/calibration.png"}
    assert "calibrated: 1 of 2 parameters" in done.stdout
    assert "bayes-tyre: k: ranks of truths are not uniform" in done.stderr
    assert len(pd.read_csv(tmp_path / "made" / "ranks.csv")) == 100
    assert set(pd.read_csv(tmp_path / "made" / "priors.csv")["site"]) == set(PRIORS)
    run = json.loads((tmp_path / "made" / "run.json").read_text())
    assert run["options"] == {"datasets": 100, "around": str(fitted), "seed": 4}
    files = [fitted / "posterior.nc", fitted.with_name("fit.csv")]
    assert run["inputs"] == {str(file): sha256(file.read_bytes()).hexdigest() for file in files}


def around(folder: Path, out: Path, *options: object) -> tuple[int, str]:
    done = here("study", "calibration", "--around", folder, "--out", out, *options)
    assert not out.exists() or out == folder
    return done.exit_code, done.stderr


def test_a_folder_that_no_fit_of_records_wrote_is_refused(fitted, tmp_path):
    assert_refused(*around(tmp_path, tmp_path / "made"), f"{tmp_path / 'run.json'}: no such file")
    for command in ("motion", "published", "study"):
        folder = tmp_path / command
        shutil.copytree(fitted, folder)
        run = json.loads((folder / "run.json").read_text())
        (folder / "run.json").write_text(json.dumps(run | {"command": f"bayes-tyre {command} x --out y"}))
        said = f"was written by {command!r}, not by fit; --around takes a folder that fit wrote from records"
        assert_refused(*around(folder, tmp_path / "made"), said)


def test_records_that_are_gone_or_others_are_refused(fitted, tmp_path):
    table, folder = tmp_path / "fit.csv", tmp_path / "fit"
    shutil.copytree(fitted, folder)
    run = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(run | {"inputs": {"fit.csv": next(iter(run["inputs"].values()))}}))
    assert_refused(*around(folder, tmp_path / "made"), "its input fit.csv is not there; run from the folder")
    table.write_text("record,displacement_mm,force_kN\n")
    assert_refused(*around(folder, tmp_path / "made"), f"{table}: is not the input of {folder / 'run.json'}")
    shutil.copy(fitted.with_name("fit.csv"), table)
    # Put there by hand, it lacks what a fit has: as a posterior of an earlier version may.
    assert_refused(*around(folder, tmp_path / "made"), f"{folder / 'posterior.nc'}: the posterior has no J_group")


def test_the_folder_of_the_fit_is_not_written_into(fitted, monkeypatch):
    monkeypatch.setattr(workflow, "posterior_truths", truths_of_k)
    before = (fitted / "run.json").read_bytes()
    assert_refused(*around(fitted, fitted), "is the folder of the fit, whose run.json would be lost; name another")
    assert (fitted / "run.json").read_bytes() == before
