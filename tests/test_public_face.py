"""`import bayes_tyre`: it waits for no library, its names carry an analysis, and every example shown is true."""

import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import environment, small, written
from helpers.hand_made_posteriors import grid, posterior, scattered
from helpers.quick_fits import drawn
from matplotlib.figure import Figure

import bayes_tyre as bt
from bayes_tyre import analysis
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.constant_data import put_together
from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.inference.model.prepared_records import used_points
from bayes_tyre.laws import fancher
from bayes_tyre.record_table import check_record_table

README = Path(__file__).parents[1] / "README.md"


def alone(script: str, folder: Path, without: tuple[str, ...] = ()) -> str:
    """Return what a script prints in a process of its own, started as a user would start it."""
    command, env = [sys.executable, "-c", script], environment()
    env = {name: value for name, value in env.items() if name not in without}
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_importing_the_package_and_asking_for_help_wait_for_no_library(tmp_path):
    script = """
import contextlib, io, json, sys
import bayes_tyre as bt
from bayes_tyre.cli import app
said = io.StringIO()
with contextlib.redirect_stdout(said):
    try:
        app(["predict", "--help"], prog_name="bayes-tyre")
    except SystemExit as end:
        assert not end.code
heavy = ("jax", "numpy", "numpyro", "pandas", "xarray", "arviz", "matplotlib", "h5py", "scipy")
print(json.dumps([sorted(dir(bt)), [name for name in heavy if name in sys.modules], said.getvalue()]))
"""
    names, imported, said = json.loads(alone(script, tmp_path))
    assert imported == []
    assert set(bt.__all__) <= set(names)
    said = " ".join(said.split())
    for factors in ("Example: bayes-tyre predict ", "force (kN)", "displacement (mm)", "kN/mm", "prediction.toml"):
        assert factors in said


def test_every_name_is_there_and_says_what_it_is():
    assert bt.__all__ == sorted(analysis.__all__) == analysis.__all__
    for name in bt.__all__:
        assert getattr(bt, name) is getattr(analysis, name)
        assert (getattr(bt, name).__doc__ or "").strip()
    with pytest.raises(AttributeError, match="nonsense"):
        bt.nonsense  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_the_face_computes_in_float64_on_a_device_for_each_chain(tmp_path):
    script = """
import bayes_tyre as bt
settings = bt.SamplerSettings(), bt.FitSettings()
force = bt.equation_2(3.0, k=1.8, C=0.4, beta=0.05, d_i=0.0, F_i=0.0)
import jax
print(force.dtype, jax.local_device_count(), jax.numpy.ones(1).dtype)
"""
    assert alone(script, tmp_path, without=("JAX_NUM_CPU_DEVICES",)) == "float64 4 float64\n"


def test_equation_2_is_that_of_the_laws():
    values = {"k": 1.8, "C": 0.4, "beta": 0.05, "d_i": 0.2, "F_i": 0.3}
    d = np.linspace(-1.0, 3.0, 7)
    np.testing.assert_array_equal(bt.equation_2(d, **values), fancher.equation_2(d, **values))


def test_records_are_read_and_checked(tmp_path):
    table = small()
    read = bt.read_records(str(written(table, tmp_path / "records.csv")))
    pd.testing.assert_frame_equal(read[table.columns], table, check_dtype=False)
    wrong = written(table.drop(columns="force_kN"), tmp_path / "wrong.csv")
    with pytest.raises(bt.BadInput, match=r"wrong\.csv: missing column force_kN"):
        bt.read_records(wrong)
    for function in (bt.fit, bt.fit_least_squares):
        with pytest.raises(BadInput, match="missing column force_kN"):
            function(table.drop(columns="force_kN"))


def test_tables_carry_the_verdict_of_their_posterior_whoever_made_it(tmp_path):
    factors = grid()
    tree = posterior(scattered(factors, seed=41), factors)
    assert bt.diagnose(tree).verdict == "pass"
    for table in (bt.cases(tree), bt.contrasts(tree), bt.repeats(tree), bt.predict(tree, "single (0)20-30").curves):
        assert set(table["verdict"]) == {"pass"}
    write_tree(tree, tmp_path / "posterior.nc")
    (tmp_path / "run.json").write_text("{}", encoding="utf-8")
    (tmp_path / "diagnostics.json").write_text('{"verdict": "fail"}', encoding="utf-8")
    failed = bt.read_posterior(str(tmp_path))
    for table in (
        bt.cases(failed),
        bt.contrasts(failed),
        bt.repeats(failed),
        bt.predict(failed, "dual (0)20-30").curves,
    ):
        assert set(table["verdict"]) == {"fail"}
    with pytest.raises(BadInput, match=r"holds no run\.json"):
        bt.read_posterior(tmp_path / "nowhere")


def test_a_posterior_shows_itself_as_table_and_verdict_and_is_a_tree(tmp_path):
    factors = grid(("single", "<b>&"))
    tree = posterior(scattered(factors, seed=43), factors)
    write_tree(tree, tmp_path / "posterior.nc")
    (tmp_path / "run.json").write_text("{}", encoding="utf-8")
    (tmp_path / "diagnostics.json").write_text('{"verdict": "pass"}', encoding="utf-8")
    read = bt.read_posterior(tmp_path)
    lines = str(read).splitlines()
    assert lines[0].endswith("4 chains of 250 draws; verdict: pass")
    (loading,) = (line for line in lines if line.startswith("k, kN/mm loading"))
    k = tree["posterior"]["k_case"].sel(case=["single (0)20-30", "single (25)20-30"]).mean("case")
    low, middle, high = np.quantile(k, [0.025, 0.5, 0.975])
    assert f"{middle:.4g} [{low:.4g}, {high:.4g}]" in loading
    html = read._repr_html_()
    assert "<b>" not in html
    assert "&lt;b&gt;&amp;" in html
    assert "verdict is fail" not in str(read) + html
    failed = read.copy()
    failed.attrs["verdict"] = "fail"
    assert "bt.diagnose says why the verdict is fail" in str(failed)
    assert "bt.diagnose says why the verdict is fail" in failed._repr_html_()
    assert isinstance(read, xr.DataTree)
    xr.testing.assert_equal(put_together(read)["posterior"].to_dataset(), tree["posterior"].to_dataset())


def test_units_that_look_wrong_are_refused_or_warned_of_as_by_the_commands():
    newtons = small().assign(force_kN=lambda table: 1000 * table["force_kN"])
    with pytest.raises(BadInput, match="looks like N; divide by 1000; or say units_checked=True"):
        bt.fit(newtons, draws=4, chains=1)
    with pytest.warns(UserWarning, match="looks like N; divide by 1000"):
        bt.fit_least_squares(newtons)


def test_progress_that_the_settings_ask_for_is_called_beside_the_bars(monkeypatch):
    def sampled(_table, settings, *_):
        settings.on_stage("warm-up", 10)
        settings.on_progress(3)
        raise InterruptedError

    calls = []
    settings = bt.SamplerSettings(on_progress=calls.append, on_stage=lambda *stage: calls.append(stage))
    monkeypatch.setattr(analysis, "fit_hierarchical", sampled)
    with pytest.raises(InterruptedError):
        bt.fit(small(), settings)
    assert calls == [("warm-up", 10), 3]


def test_cases_are_asked_for_by_one_text_or_several():
    factors = grid()
    tree = posterior(scattered(factors, seed=42), factors)
    one = bt.predict(tree, "single (0)20-30", [0, 1.5])
    assert one.curves["displacement_mm"].tolist() == [0.0, 1.5]
    both = bt.predict(tree, ["single (0)20-30", "dual (0)20-30"], np.array([0.0, 1.5]), interval=0.5)
    assert both.curves["configuration"].tolist() == ["single"] * 2 + ["dual"] * 2
    assert set(both.curves["interval"]) == {0.5}


@pytest.mark.parametrize("interval", [0.0, 1.0, 95.0, -0.5, np.nan])
def test_an_interval_that_is_no_probability_is_refused(interval):
    factors = grid()
    tree = posterior(scattered(factors, seed=44), factors)
    for call in (
        *(partial(table, tree) for table in (bt.cases, bt.contrasts, bt.repeats)),
        *(partial(bt.figure, tree, "contrasts"), partial(bt.predict, tree, "single (0)20-30")),
    ):
        with pytest.raises(BadInput, match="give a number between 0 and 1"):
            call(interval=interval)


def test_a_figure_is_drawn_of_the_points_and_records_that_were_fitted(monkeypatch):
    table, shown = check_record_table(small()), []
    tree = drawn(table)
    tree.attrs["region"] = "thesis"
    monkeypatch.setattr(analysis, "chosen_figure", lambda result, _: shown.append(result.table) or Figure())
    backwards = pd.concat([rows for _, rows in sorted(table.groupby("record"), reverse=True)])
    bt.figure(tree, "records_with_bands", backwards)
    pd.testing.assert_frame_equal(shown[0], used_points(table, "thesis"))
    with pytest.raises(BadInput, match="not the records that the posterior was fitted to"):
        bt.figure(tree, "records_with_bands", table[table["record"] != table["record"].iloc[0]])


def test_a_figure_has_the_reference_of_the_fit(monkeypatch):
    factors, shown = grid(), []
    tree = posterior(scattered(factors, seed=41), factors)
    monkeypatch.setattr(analysis, "chosen_figure", lambda result, _: shown.append(result.contrasts) or Figure())
    bt.figure(tree, "contrasts")
    tree.attrs["reference"] = "dual"
    bt.figure(tree, "contrasts")
    assert [table["contrast"].iloc[0] for table in shown] == ["dual / single", "single / dual"]


EXAMPLES = """
import doctest, importlib, json, pkgutil
import bayes_tyre
found = {}
for module in pkgutil.walk_packages(bayes_tyre.__path__, "bayes_tyre."):
    if not module.name.endswith("__main__"):
        failed, tried = doctest.testmod(importlib.import_module(module.name), optionflags=doctest.ELLIPSIS)
        found[module.name] = [failed, tried]
print("\\n" + json.dumps(found))
"""


@pytest.mark.slow
def test_examples_in_docstrings_are_true(tmp_path):
    said = alone(EXAMPLES, tmp_path)
    found = json.loads(said.splitlines()[-1])
    assert sum(failed for failed, _ in found.values()) == 0, said
    for module in ("bayes_tyre.analysis", "bayes_tyre.rig.axle", "bayes_tyre.rig.calibration"):
        assert found[module][1] > 0


@pytest.mark.slow
def test_the_ten_lines_of_the_readme_give_what_it_shows(tmp_path):
    section = README.read_text(encoding="utf-8").split("\n## In ten lines of Python\n")[1].split("\n## ")[0]
    (example,) = re.findall(r"```pycon\n(.*?)```", section, flags=re.DOTALL)
    assert example.count(">>> ") <= 10
    # And what the command's posterior holds beside the draws.
    groups = ["constant_data", "convergence", "derived", "identifiability", "posterior", "sample_stats"]
    beside = f">>> sorted(posterior.children)\n{groups}\n"
    (tmp_path / "example.txt").write_text(example + beside, encoding="utf-8")
    script = "import doctest; print(doctest.testfile('example.txt', False, optionflags=doctest.ELLIPSIS))"
    said = alone(script, tmp_path)
    assert said == f"TestResults(failed=0, attempted={example.count('>>> ') + 1})\n", said
