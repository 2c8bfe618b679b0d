"""What fit and show print and write: the verdict, every file, whole or not at all."""

import hashlib
import json
import re
import shutil
import subprocess
import sys
import time
from collections import Counter
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import (
    CONTRASTS_PNG,
    FEW,
    FIT_FILES,
    OUTLIERS_PNG,
    TABLES,
    assert_refused,
    files_of,
    here,
    installed,
    small,
    tree_of,
    written,
)
from helpers.hand_made_posteriors import posterior, scattered
from helpers.quick_fits import once
from helpers.simulated_records import Plan, simulate

import bayes_tyre as bt
from bayes_tyre.cli import shell
from bayes_tyre.inference.diagnostics import power_scaling
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.record_table import record_factors
from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.report.figures import catalogue
from bayes_tyre.workflow import fit as workflow
from bayes_tyre.workflow import result_folder

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


def put_draws_for_the_sampler(monkeypatch, columns: list[str] | None = None) -> pd.DataFrame:
    """Put well-mixed draws about the truth in place of the sampler, cases about their repeats; give the records."""
    table, truth = simulate(Plan(configurations=("dual", "single"), speeds=(0.0,), loads=(20.0,), points=60), 3)
    table = table[columns] if columns else table
    factors = record_factors(table)
    draws = scattered(factors, seed=4)
    for name in ("k", "beta", "J", "F_i", "sigma"):
        scatter = np.exp(0.001 * np.random.default_rng(5).normal(size=draws[name].shape))
        draws[name] = truth[name].to_numpy() * scatter
    members = np.eye(len(find_factors(factors).cases))[find_factors(factors).of_record]
    for name in ("k", "beta"):
        about_repeats = np.exp(np.log(draws[name]) @ members / members.sum(axis=0))
        draws[f"{name}_case"] = about_repeats * np.exp(0.03 * np.random.default_rng(6).normal(size=about_repeats.shape))
    monkeypatch.setattr(workflow, "fit_hierarchical", lambda *_: posterior(draws, factors))
    return table


@pytest.fixture
def sampled(monkeypatch) -> pd.DataFrame:
    return put_draws_for_the_sampler(monkeypatch)


def test_fit_ends_with_0_and_says_pass_everywhere_when_it_may_be_trusted(sampled, tmp_path):
    path = written(sampled, tmp_path / "records.csv")
    done = here("fit", path, "--out", tmp_path / "out", "--interval", "0.8")
    assert (done.exit_code, done.stderr) == (0, "")
    assert files_of(tmp_path / "out") == FIT_FILES
    for name in TABLES:
        table = pd.read_csv(tmp_path / "out" / name)
        assert set(table["verdict"]) == {"pass"}
        assert set(table["interval"]) == {0.8}
    diagnostics = json.loads((tmp_path / "out" / "diagnostics.json").read_text(encoding="utf-8"))
    assert (diagnostics["verdict"], diagnostics["reasons"]) == ("pass", [])
    assert "verdict pass\nsampling: passed; model: passed; data: passed\n" in done.stdout
    shown = here("show", tmp_path / "out")
    assert shown.exit_code == 0
    assert "80 % interval" in shown.stdout


def test_the_wall_time_counts_from_before_the_records_are_read(sampled, tmp_path, monkeypatch):
    monkeypatch.setattr(result_folder, "_write_figures", lambda *_: None)
    times, read, begin = [], shell.read_records, workflow.begin_run
    monkeypatch.setattr(shell, "read_records", lambda *of: times.append(time.monotonic()) or read(*of))
    monkeypatch.setattr(workflow, "begin_run", lambda *of: times.append(of[-1]) or begin(*of))
    path = written(sampled, tmp_path / "records.csv")
    called = time.monotonic()
    assert here("fit", path, "--out", tmp_path / "out").exit_code == 0
    reading, began = times
    assert called <= began <= reading


def test_a_fit_in_python_writes_what_the_command_does_and_is_repeated_by_it(sampled, tmp_path):
    posterior = bt.fit(sampled, draws=50, seed=3, out=tmp_path / "python")
    assert files_of(tmp_path / "python") == FIT_FILES | {"records.csv"}
    assert posterior.attrs["verdict"] == bt.diagnose(posterior).verdict == "pass"
    again = here("fit", "--from", tmp_path / "python" / "run.json", "--out", tmp_path / "command")
    assert (again.exit_code, again.stderr) == (0, "")
    by_python, by_command = tree_of(tmp_path / "python"), tree_of(tmp_path / "command")
    assert {name for name, content in by_command.items() if content != by_python[name]} == {"run.json"}
    shown = here("show", tmp_path / "python")
    assert (shown.exit_code, "Configuration dual" in shown.stdout) == (0, True)


def test_a_table_without_words_is_fitted_and_shown(tmp_path, monkeypatch):
    required = put_draws_for_the_sampler(monkeypatch, ["record", "displacement_mm", "force_kN"])
    path = written(required, tmp_path / "records.csv")
    done = here("fit", path, "--out", tmp_path / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    # No two cases match: there is nothing to contrast.
    assert files_of(tmp_path / "out") == FIT_FILES - {CONTRASTS_PNG}
    assert pd.read_csv(tmp_path / "out" / "contrasts.csv").empty
    assert len(pd.read_csv(tmp_path / "out" / "cases.csv")) == 2
    shown = here("show", tmp_path / "out")
    assert shown.exit_code == 0
    assert "k, kN/mm" in shown.stdout


def test_fit_that_fails_half_way_leaves_no_run_json_to_vouch_for_it(sampled, tmp_path, monkeypatch):
    path = written(sampled, tmp_path / "records.csv")
    monkeypatch.setattr(result_folder, "_write_figures", lambda *_: None)
    assert here("fit", path, "--out", tmp_path / "out").exit_code == 0
    assert (tmp_path / "out" / "run.json").is_file()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "figure.png")

    monkeypatch.setattr(result_folder, "_write_figures", full)
    done = here("fit", path, "--out", tmp_path / "out", "--quiet")
    assert_refused(done.exit_code, done.stderr, "figure.png", "No space left on device")
    assert not (tmp_path / "out" / "run.json").exists()
    assert not [name for name in tree_of(tmp_path / "out") if Path(name).name.startswith(".")]
    assert here("show", tmp_path / "out").exit_code == 3


def test_a_figure_or_table_that_fails_becomes_a_failed_check_and_the_rest_is_written(sampled, tmp_path, monkeypatch):
    path, out = written(sampled, tmp_path / "records.csv"), tmp_path / "out"
    (out / "figures").mkdir(parents=True)
    about_older = ("report.html", "report.pdf", "prediction.csv", "comparison_cases.csv", "motions_shown.csv")
    for earlier in ("figures/rank_plot.png", "repeats.csv", "estimates.csv", *about_older):
        (out / earlier).write_text("earlier")  # of another run: it must not stay

    def fails(*_: object) -> None:
        raise ZeroDivisionError("nothing to draw")

    figures = {"rank_plot": fails, "forest_of_cases": catalogue.ALWAYS["forest_of_cases"]}
    monkeypatch.setattr(catalogue, "ALWAYS", figures)
    monkeypatch.setattr(catalogue, "OF_RECORDS", {})
    monkeypatch.setattr(result_folder.summary, "repeats", fails)
    done = here("fit", path, "--out", out)
    assert done.exit_code == 4
    for name in ("rank_plot.png", "repeats.csv"):
        assert f"bayes-tyre: {name} failed: ZeroDivisionError: nothing to draw; " in done.stderr
    expected = {name for name in FIT_FILES if "/" not in name and name != "repeats.csv"}
    expected |= {"figures/forest_of_cases.png", OUTLIERS_PNG}
    assert files_of(out) == expected
    # What was written before something failed says so too.
    assert set(pd.read_csv(out / "summary.csv")["verdict"]) == {"fail"}
    diagnostics = json.loads((out / "diagnostics.json").read_text())
    assert (diagnostics["verdict"], len(diagnostics["reasons"])) == ("fail", 2)
    assert [check["name"] for check in diagnostics["checks"] if not check["passed"]] == ["repeats.csv", "rank_plot.png"]
    assert not (out / ".checkpoint").exists()


def test_a_diagnostic_that_fails_leaves_the_draws(sampled, tmp_path, monkeypatch):
    def fails(*_: object) -> None:
        raise ValueError("All tail values are the same")

    monkeypatch.setattr(result_folder, "_write_figures", lambda *_: None)
    monkeypatch.setattr(power_scaling, "sensitivity", fails)
    path = written(sampled, tmp_path / "records.csv")
    done = here("fit", path, "--out", tmp_path / "out")
    assert done.exit_code == 4
    assert "power scaling failed: ValueError: All tail values are the same; " in done.stderr
    summary = pd.read_csv(tmp_path / "out" / "summary.csv")
    assert summary["contraction"].notna().any()
    assert summary["decided_by"].isna().all()


def test_the_target_acceptance_is_handed_on_and_recorded(sampled, tmp_path, monkeypatch):
    monkeypatch.setattr(result_folder, "_write_figures", lambda *_: None)
    monkeypatch.setattr(workflow, "judge", once(workflow.judge))
    fit, asked = workflow.fit_hierarchical, []

    def watched(*arguments: object) -> xr.DataTree:
        asked.append(arguments[1])
        return fit(*arguments)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(workflow, "fit_hierarchical", watched)
    path = written(sampled, tmp_path / "records.csv")
    assert here("fit", path, "--out", tmp_path / "one", "--target-accept", 0.9, "--quiet").exit_code == 0
    run = tmp_path / "one" / "run.json"
    assert json.loads(run.read_text())["options"]["target_accept"] == 0.9
    assert here("fit", "--from", run, "--out", tmp_path / "two", "--quiet").exit_code == 0
    # A run.json of a version without the option is repeated without it.
    earlier = json.loads(run.read_text())
    del earlier["options"]["target_accept"]
    run.write_text(json.dumps(earlier))
    assert here("fit", "--from", run, "--out", tmp_path / "three", "--quiet").exit_code == 0
    assert [settings.target_accept for settings in asked] == [0.9, 0.9, None]
    assert here("fit", path, "--out", tmp_path / "four", "--target-accept", 1.2).exit_code == 2


def with_tyres(table: pd.DataFrame) -> pd.DataFrame:
    """Return the records as made on two tyres of each configuration, each record at a pressure of its own."""
    number = table.groupby("record", sort=False).ngroup()
    return table.assign(tyre="T" + (number % 2 + 1).astype(str), pressure_bar=8.0 + 0.1 * number)


def test_specimens_and_a_covariate_are_fitted_recorded_and_shown(tmp_path):
    table = simulate(Plan(configurations=("dual", "single"), speeds=(0.0,), loads=(20.0,), points=20), 3)[0]
    with_tyres(table).to_csv(tmp_path / "records.csv", index=False)
    out = tmp_path / "out"
    done = here(
        "fit", tmp_path / "records.csv", "--specimen", "tyre", "--covariate", "pressure_bar", "--out", out, *FEW
    )
    assert done.exit_code == 4, done.stderr  # so few draws fall short
    run = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert {name: run["options"].get(name) for name in ("specimen", "day", "covariates")} == {
        "specimen": "tyre",
        "day": None,
        "covariates": ["pressure_bar"],
    }
    parameters = set(pd.read_csv(out / "summary.csv")["parameter"])
    tyres = [f"{configuration} T{n}" for configuration in ("dual", "single") for n in (1, 2)]
    assert {f"log_{name}_specimen[{tyre}]" for name in ("k", "beta") for tyre in tyres} <= parameters
    assert {f"sd_log_{name}_specimen" for name in ("k", "beta")} <= parameters
    assert {f"log_{name}_covariate[pressure_bar]" for name in ("k", "beta")} <= parameters
    assert set(pd.read_csv(out / "repeats.csv")["tyre"]) == {"T1", "T2"}
    planned = workflow.planned_in(out / "run.json", lambda _: None)
    assert (planned.model.specimen, planned.model.covariates) == ("tyre", ("pressure_bar",))
    with xr.open_datatree(out / "posterior.nc", engine="h5netcdf") as tree:
        (sd,) = tree["constant_data"]["covariate_sd"].to_numpy()
    # Twelve records, 0.1 bar apart.
    assert sd == pytest.approx(0.1 * np.arange(12).std())
    page = here("report", out, "--kept-figures")
    assert page.exit_code == done.exit_code
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "Other tyres of a type" not in text
    assert "--day COLUMN" in text


def test_a_column_that_is_not_there_is_refused_by_its_name(tmp_path):
    with_tyres(small()).to_csv(tmp_path / "records.csv", index=False)
    done = here("fit", tmp_path / "records.csv", "--specimen", "tire", "--out", tmp_path / "out", *FEW)
    assert_refused(done.exit_code, done.stderr, str(tmp_path / "records.csv"), "column tire", "--specimen")
    assert not (tmp_path / "out" / "run.json").exists()


def test_units_that_were_checked_are_fitted(sampled, tmp_path, monkeypatch):
    monkeypatch.setattr(result_folder, "_write_figures", lambda *_: None)
    path = written(sampled.assign(force_kN=sampled["force_kN"] * 1000), tmp_path / "records.csv")
    done = here("fit", path, "--out", tmp_path / "out", "--units-checked", "--quiet")
    # The draws are of a thousandth of these forces, and the residuals show it.
    assert done.exit_code == 4
    assert (tmp_path / "out" / "run.json").is_file()


@pytest.mark.parametrize(
    ("run_json", "said"),
    [(None, "holds no run.json"), ("{", "run.json"), ("[]", "run.json"), ('{"origin": "x"}', "summary.csv")],
)
def test_show_refuses_a_folder_without_a_result(run_json, said, tmp_path):
    if run_json is not None:
        (tmp_path / "run.json").write_text(run_json, encoding="utf-8")
    done = here("show", tmp_path)
    assert_refused(done.exit_code, done.stderr, str(tmp_path), said)
    assert done.stdout == ""


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """Run the installed `fit` with far too few draws; give the folder it lies in, as `one`, and how it ended."""
    folder = tmp_path_factory.mktemp("a fit")
    written(small(), folder / "the records.csv")
    return folder, installed("fit", "the records.csv", "--out", "one", *FEW, "--seed", 7, cwd=folder)


def test_too_few_draws_end_with_4_and_every_file_says_so(fitted):
    folder, done = fitted
    assert done.returncode == 4, done.stderr
    assert "verdict fail" in done.stdout
    assert files_of(folder / "one") == FIT_FILES
    for name in TABLES:
        table = pd.read_csv(folder / "one" / name)
        assert table.columns[-1] == "verdict"
        assert set(table["verdict"]) == {"fail"}
        assert set(table["origin"]) == {"simulated"}
    diagnostics = json.loads((folder / "one" / "diagnostics.json").read_text(encoding="utf-8"))
    assert diagnostics["verdict"] == "fail"
    assert (diagnostics["chains"], diagnostics["draws"]) == (2, 170)
    assert any("ESS" in reason for reason in diagnostics["reasons"])
    assert done.stderr == "".join(f"bayes-tyre: {in_words(reason)}\n" for reason in diagnostics["reasons"])


def test_a_run_tells_how_it_was_made(fitted):
    folder, _ = fitted
    run = json.loads((folder / "one" / "run.json").read_text(encoding="utf-8"))
    few = "--chains 2 --warmup 130 --draws 170 --target-accept 0.65 --seed 7"
    assert run["command"] == f"bayes-tyre fit 'the records.csv' --out one {few}"
    sampler = {"chains": 2, "warmup": 130, "draws": 170, "target_accept": 0.65, "longest": 1}
    model = {"region": "all", "initial_load": "nominal", "displacement_scale_sd": 0.0}
    model |= {"displacement_sd": None, "columns": None}
    model |= {"likelihood": "compressed", "repeats": "mixture", "noise": "auto", "noise_window": 1}
    model |= {"sampler": "collapsed", "law": "equation_2"}
    assert run["options"] == {**sampler, **model, "interval": 0.95, "units_checked": False, "priors": PRIORS.given()}
    assert run["seed"] == 7
    digest = hashlib.sha256((folder / "the records.csv").read_bytes()).hexdigest()
    assert run["inputs"] == {"the records.csv": digest}
    for library in ("bayes-tyre", "jax", "numpyro", "arviz", "numpy"):
        assert run["versions"][library] == version(library)
    assert run["versions"]["python"] == ".".join(map(str, sys.version_info[:3]))
    assert run["wall_time_s"] > 1
    assert run["device"] == "cpu"
    others = [path for path in (folder / "one").rglob("*") if path.is_file() and path.name != "run.json"]
    assert all(path.stat().st_mtime_ns <= (folder / "one" / "run.json").stat().st_mtime_ns for path in others)


def test_the_posterior_on_disk_has_names_labels_and_units(fitted):
    folder, _ = fitted
    with xr.open_datatree(folder / "one" / "posterior.nc", engine="h5netcdf") as tree:
        posterior_of = tree["posterior"].to_dataset()
        assert posterior_of["k"].dims == ("chain", "draw", "record")
        assert posterior_of["k_case"].dims == ("chain", "draw", "case")
        assert posterior_of["k"].attrs["units"] == "kN/mm"
        assert posterior_of["beta_case"].attrs["units"] == "mm"
        assert all("units" in draws.attrs for draws in posterior_of.data_vars.values())
        assert set(posterior_of["record"].to_numpy()) == set(pd.read_csv(folder / "one" / "repeats.csv")["record"])
        assert tree["sample_stats"]["diverging"].shape == (2, 170)
        assert tree.attrs["origin"] == "simulated"


def test_figures_are_pictures(fitted):
    folder, _ = fitted
    for path in (folder / "one" / "figures").iterdir():
        assert path.read_bytes().startswith(b"\x89PNG")


def test_show_prints_the_table_of_a_result_and_what_it_rests_on(fitted):
    folder, _ = fitted
    shutil.copytree(folder / "one", folder / "two")
    done = installed("show", "one", "two", cwd=folder)
    assert done.returncode == 0, done.stderr
    means = pd.read_csv(folder / "one" / "summary.csv").query("parameter in ('k_mean', 'beta_mean')")
    assert len(means) == 4
    for text, cells in Counter(f"{median:.4g}" for median in means["median"]).items():
        assert len(re.findall(rf"(?<![\d.]){re.escape(text)} \[", done.stdout)) == 2 * cells
    for word in ("single", "k, kN/mm", "beta, mm", "not measured", "verdict: fail", "95 % interval"):
        assert done.stdout.count(word) >= 2
    assert done.stdout.count("files: one\n") == done.stdout.count("files: two\n") == 1
