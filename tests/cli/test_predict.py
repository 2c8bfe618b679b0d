"""What predict prints and writes: curves as CSV, parameters as TOML, both or none; and what it refuses."""

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import assert_refused, files_of, here, installed, tree_of
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered

from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.inference.sampling.common_scales import with_scale
from bayes_tyre.results.prediction import COLUMNS
from bayes_tyre.workflow.from_results import predict as workflow

# Fixtures and processes of their own: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

HOSTILE = ("=cmd()", "../../x", "<script>alert(1)</script>", 'a "b" \\ ]]', "two\nlines", "sängle ü 轮胎", "[[case]]")
PARAMETERS = ("k_kN_per_mm", "beta_mm", "J_kN", "C_kN", "F_i_kN", "d_i_mm")
CASE, OTHER_CASE = ("--case", "single (0)20-30"), ("--case", "single (25)30-20")


def a_fit(folder: Path, configurations: tuple[str, ...] = ("single", "dual"), verdict: str = "pass") -> Path:
    """Write what `predict` reads of a fit, from draws made by hand; loading comes with unloading from its end alone."""
    factor_table = grid(configurations)
    scatter = {f"sd_log_{name}_repeat": fixed(0.05, 4, 250) for name in ("k", "beta")}
    draws = scattered(factor_table, seed=31) | scatter | {"sd_log_sigma": fixed(0.1, 4, 250)}
    folder.mkdir(parents=True, exist_ok=True)
    write_tree(posterior(draws, factor_table), folder / "posterior.nc")
    (folder / "diagnostics.json").write_text(json.dumps({"verdict": verdict}), encoding="utf-8")
    (folder / "run.json").write_text("{}", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def written_once(tmp_path_factory) -> Path:
    return a_fit(tmp_path_factory.mktemp("written") / "fit")


@pytest.fixture
def fitted(written_once, tmp_path) -> Path:
    return shutil.copytree(written_once, tmp_path / "fit")


def test_the_installed_command_writes_curves_and_parameters_into_the_fits_folder(fitted, tmp_path):
    done = installed("predict", "fit", "--case", "dual (0)20-30", "--displacement", "0:4:5", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    last = pd.read_csv(tmp_path / "fit/prediction.csv").iloc[-1]
    assert done.stdout == (
        f"dual (0)20-30 loading, 4 mm from the start of the step: {last['median']:.4g} kN "
        f"[{last['lower']:.4g}, {last['upper']:.4g}]\n"
        "no opposite direction of dual (0)20-30\n"
        f"wrote {Path('fit/prediction.csv')} (data: simulated, verdict pass)\n"
        f"wrote {Path('fit/prediction.toml')} (data: simulated, verdict pass)\n"
    )
    curves = pd.read_csv(tmp_path / "fit/prediction.csv")
    assert list(curves.columns) == list(COLUMNS)
    assert curves["displacement_mm"].tolist() == [0, 1, 2, 3, 4]
    assert (curves["lower"] < curves["median"]).all()
    assert (curves["median"] < curves["upper"]).all()
    said = curves[["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN", "interval", "of"]]
    assert said.drop_duplicates().to_numpy().tolist() == [["dual", "loading", 0.0, 20.0, 10.0, 0.95, "case"]]


def test_a_vehicle_model_can_read_the_parameters_and_gets_the_curve_from_them(fitted):
    done = here("predict", fitted, *OTHER_CASE, "--displacement", "0,0.01,1,3", "--interval", "0.9")
    assert done.exit_code == 0
    made = tomllib.loads((fitted / "prediction.toml").read_text(encoding="utf-8"))
    assert (made["of"], made["interval"], made["origin"], made["verdict"]) == ("case", 0.9, "simulated", "pass")
    assert made["equation"].startswith("F = F_i + (J + k u) (1 - exp(-|u| / beta))")
    assert made["version"].startswith("bayes-tyre ")
    (case,) = made["case"]
    words = ("label", "configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN")
    assert [case[word] for word in words] == ["single (25)30-20", "single", "unloading", 25.0, 30.0, -10.0]
    assert all(case[name]["lower"] < case[name]["mean"] < case[name]["upper"] for name in PARAMETERS)
    k, beta, J, C, F_i, d_i = (case[name]["mean"] for name in PARAMETERS)
    assert k * d_i + C - F_i == pytest.approx(J, abs=0.1 * case["C_kN"]["sd"])
    curves = pd.read_csv(fitted / "prediction.csv")
    u = curves["displacement_mm"].to_numpy()
    assert u.tolist() == [-0.0, -0.01, -1.0, -3.0]
    force = F_i + ((k * (d_i + u) + C) - F_i) * (1 - np.exp(-np.abs(u) / beta))  # Equation 2 as it is written down
    # Means against medians of draws that scatter by 3 % of k: apart by less than a tenth of the interval.
    assert (np.abs(force - curves["median"]) < 0.1 * (curves["upper"] - curves["lower"])).all()


@pytest.mark.parametrize("label", HOSTILE)
def test_hostile_labels_are_text_in_both_files_and_no_path(label, tmp_path):
    folder = a_fit(tmp_path / "fit", (label, "other"))
    before = set(tree_of(tmp_path))
    done = here("predict", folder, "--case", f"configuration={label},speed_km_h=0", "--displacement", "0,1")
    assert (done.exit_code, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 5  # two ends, what has no opposite, two files
    assert set(tree_of(tmp_path)) - before == {"fit/prediction.csv", "fit/prediction.toml"}
    made = tomllib.loads((folder / "prediction.toml").read_text(encoding="utf-8"))
    assert {case["configuration"] for case in made["case"]} == {label}
    cells = set(pd.read_csv(folder / "prediction.csv", dtype=str)["configuration"])
    assert cells == {f"'{label}" if label.startswith("=") else label}


def test_a_repeat_is_the_same_with_the_same_seed_and_wider_than_the_case(fitted, tmp_path):
    widths, of = {}, (*CASE, "--displacement", "0:3:9")
    for name, seed in {"one": 7, "two": 7, "other": 8}.items():
        done = here("predict", fitted, *of, "--of", "repeat", "--seed", seed, "--out", tmp_path / name, "--quiet")
        assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
        widths[name] = pd.read_csv(tmp_path / name / "prediction.csv").eval("upper - lower")
    for name in ("prediction.csv", "prediction.toml"):
        one, two, other = ((tmp_path / folder / name).read_bytes() for folder in widths)
        assert one == two != other
    assert tomllib.loads(one.decode())["of"] == "repeat"
    assert here("predict", fitted, *of).exit_code == 0
    assert (pd.read_csv(fitted / "prediction.csv").eval("upper - lower") < widths["one"]).all()


@pytest.mark.parametrize(
    ("out", "csv", "toml"),
    [
        ("made/here", "made/here/prediction.csv", "made/here/prediction.toml"),
        ("made/tyre.csv", "made/tyre.csv", "made/tyre.toml"),
        ("v1.2", "v1.2/prediction.csv", "v1.2/prediction.toml"),
        ("there.csv", "there.csv/prediction.csv", "there.csv/prediction.toml"),
    ],
)
def test_out_is_a_folder_or_a_csv(out, csv, toml, fitted, tmp_path):
    (tmp_path / "there.csv").mkdir()
    before = files_of(tmp_path)
    done = here("predict", fitted, *CASE, "--out", tmp_path / out)
    assert done.exit_code == 0
    assert files_of(tmp_path) - before == {csv, toml}
    assert f"wrote {tmp_path / csv}" in done.stdout


def test_a_posterior_that_failed_is_written_says_so_and_ends_with_4(tmp_path):
    folder = a_fit(tmp_path / "fit", verdict="fail")
    done = here("predict", folder, *CASE)
    assert done.exit_code == 4
    assert done.stderr.count("\n") == 1
    assert "not to be trusted" in done.stderr
    assert str(folder / "diagnostics.json") in done.stderr
    assert set(pd.read_csv(folder / "prediction.csv")["verdict"]) == {"fail"}
    assert tomllib.loads((folder / "prediction.toml").read_text(encoding="utf-8"))["verdict"] == "fail"


def compared(folder: Path, verdict: str = "pass", **weights: float) -> Path:
    folder.mkdir()
    rows = {"model": list(weights), "weight": list(weights.values()), "verdict": verdict}
    pd.DataFrame(rows).to_csv(folder / "comparison.csv", index=False)
    return folder


def test_fits_that_were_compared_predict_together(tmp_path):
    fits = [a_fit(tmp_path / "one"), a_fit(tmp_path / "two", verdict="fail")]
    of = [*OTHER_CASE, "--displacement", "0,1,3"]
    done = here("predict", *fits, "--weights", compared(tmp_path / "all", one=0.6, two=0.4), *of)
    assert done.exit_code == 4
    said = " ".join(done.stderr.split())
    assert f"nor is the prediction; {fits[1] / 'diagnostics.json'} gives the reason" in said  # not that of the other
    made = tomllib.loads((tmp_path / "all/prediction.toml").read_text(encoding="utf-8"))
    assert (made["weights"], made["verdict"]) == ({"one": 0.6, "two": 0.4}, "fail")
    alone = here("predict", *fits, "--weights", compared(tmp_path / "one alone", one=1.0, two=0.0), *of)
    assert alone.exit_code == 0, alone.stderr  # the one that failed has no weight
    here("predict", fits[0], *of)
    first, second = (pd.read_csv(tmp_path / name / "prediction.csv") for name in ("one alone", "one"))
    pd.testing.assert_frame_equal(first, second)


def test_a_comparison_that_is_not_to_be_trusted_makes_no_prediction_that_is(tmp_path):
    fits = [a_fit(tmp_path / "01"), a_fit(tmp_path / "02")]  # names, not numbers
    table = compared(tmp_path / "all", verdict="fail", **{"01": 0.6, "02": 0.4})
    done = here("predict", *fits, "--weights", table / "comparison.csv", *OTHER_CASE)
    assert done.exit_code == 4
    assert f"{table / 'comparison.csv'} gives the reason" in " ".join(done.stderr.split())
    assert set(pd.read_csv(table / "prediction.csv")["verdict"]) == {"fail"}


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ({"one": 0.5, "other": 0.5}, "compares one, other, the folders are one, two"),
        ({"one": 1.0}, "compares one, the folders are one, two"),
        ({"one": 1.5, "two": -0.5}, "column weight: weights are 0 or more"),
        ({"one": 0.0, "two": 0.0}, "and not all of them 0; run compare again"),
    ],
)
def test_weights_that_are_not_of_these_fits_are_refused(weights, said, tmp_path):
    fits = [a_fit(tmp_path / "one"), a_fit(tmp_path / "two")]
    table = compared(tmp_path / "all", **weights)
    done = here("predict", *fits, "--weights", table, *OTHER_CASE)
    assert_refused(done.exit_code, done.stderr, str(table / "comparison.csv"), said)
    done = here("predict", *fits, *OTHER_CASE)
    assert done.exit_code == 2
    assert "of several fits each has a weight" in " ".join(done.stderr.split())


def test_fits_with_and_without_an_unknown_factor_are_not_stacked(tmp_path):
    fits = [a_fit(tmp_path / "one"), a_fit(tmp_path / "two")]
    with xr.open_datatree(fits[1] / "posterior.nc", engine="h5netcdf") as tree:
        scaled = with_scale(tree.load(), "force_scale", 0.02, seed=1)
    write_tree(scaled, fits[1] / "posterior.nc")
    table = compared(tmp_path / "all", one=0.5, two=0.5)
    done = here("predict", *fits, "--weights", table, *OTHER_CASE)
    assert_refused(done.exit_code, done.stderr, "one and two have an unknown force_scale", "--force-scale-sd")


def test_a_disk_that_fills_leaves_both_older_files_as_they_were(fitted, monkeypatch):
    assert here("predict", fitted, *CASE).exit_code == 0
    before = tree_of(fitted)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "prediction.toml")

    monkeypatch.setattr(workflow, "write_text", full)
    done = here("predict", fitted, "--case", "single (25)20-30")
    assert done.exit_code == 3
    assert "No space left on device" in done.stderr
    assert tree_of(fitted) == before


def spoil(folder: Path, what: str) -> None:
    nc = folder / "posterior.nc"
    if what == "cut":
        nc.write_bytes(nc.read_bytes()[:3000])
    elif what == "text":
        nc.write_text("no netCDF", encoding="utf-8")
    elif what == "another program's":
        draws = xr.Dataset({"theta": (("chain", "draw"), np.zeros((2, 4)))})
        write_tree(xr.DataTree.from_dict({"posterior": draws}), nc)
    elif what == "printed":
        factor_table = grid(repeats=1).drop(columns=["record", "repeat"])
        k = fixed(np.ones(len(factor_table)))
        write_tree(posterior({"k_case": k, "beta_case": k}, factor_table, origin="published"), nc)
    elif what.startswith("no "):
        (folder / what[3:]).unlink()
    else:
        (folder / "diagnostics.json").write_text(what, encoding="utf-8")


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("no run.json", ("holds no run.json", "name a folder that fit wrote")),
        ("no posterior.nc", ("posterior.nc", "no such file")),
        ("no diagnostics.json", ("diagnostics.json", "run fit again")),
        ("{", ("diagnostics.json", "verdict")),
        ("[]", ("diagnostics.json", "verdict")),
        ('{"verdict": "perhaps"}', ("diagnostics.json", "verdict")),
        ("cut", ("posterior.nc", "cannot be read as netCDF")),
        ("text", ("posterior.nc", "cannot be read as netCDF")),
        ("another program's", ("posterior.nc", "no posterior of this program")),
        ("printed", ("posterior.nc", "no records", "J")),
    ],
)
def test_a_folder_without_a_result_of_records_is_refused(what, said, fitted):
    spoil(fitted, what)
    before = tree_of(fitted)
    done = here("predict", fitted, *CASE)
    assert_refused(done.exit_code, done.stderr, str(fitted), *said)
    assert tree_of(fitted) == before


WRONG = {
    "missing: holds no run.json": ("missing", "single (0)20-30"),
    "file: holds no run.json": ("file", "single (0)20-30"),
    "no case matches x; there are 8": ("fit", "x"),
    "no case matches single (0)1-2; there are 8: single (0)20-30": ("fit", "single (0)1-2"),
    "no case matches configuration=triple, speed_km_h=7.0; there are 8": ("fit", "configuration=triple,speed_km_h=7"),
    "file/x: is a file": ("fit", "single (0)20-30", "--out", "file/x"),
    "x.parquet: the curves are written as CSV": ("fit", "single (0)20-30", "--out", "x.parquet"),
}


@pytest.fixture
def beside_a_file(fitted, tmp_path, monkeypatch) -> Path:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("said", WRONG)
def test_what_is_no_folder_and_no_case_is_refused_in_one_line(said, beside_a_file):
    before = tree_of(beside_a_file)
    folder, case, *more = WRONG[said]
    done = here("predict", folder, "--case", case, *more)
    assert_refused(done.exit_code, done.stderr, said)
    assert done.stdout == ""
    assert tree_of(beside_a_file) == before


WRONG_GRIDS = ("", "x", "0:3", "0:3:1", "3:0:9", "0:3:1e9", "0:3:200000", "0:nan:4", "0,inf", "1,,2", "0,1e9")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "--case"),
        ([], "there are 8: single (0)20-30"),
        (["--case", " "], "there are 8: single (0)20-30"),
        (["--case", "speed=0"], "'speed' is no factor"),
        (["--case", "direction=up"], "loading or unloading"),
        ([*CASE, "--case", "speed_km_h=0"], "side by side"),
        ([*CASE, "--of", "records"], "--of"),
        ([*CASE, "--interval", "1"], "--interval"),
        *(([*CASE, "--displacement", grid_text], "--displacement") for grid_text in WRONG_GRIDS),
    ],
)
def test_an_option_that_cannot_be_is_a_usage_error(options, said, fitted):
    before = tree_of(fitted)
    done = here("predict", fitted, *options)
    assert done.exit_code == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert tree_of(fitted) == before


@pytest.mark.parametrize("text", ["-3:3:7", "-3,-2,-1,0,1,2,3"])
def test_signed_displacements_serve_each_direction_with_those_of_its_sign(text, fitted):
    asked = [*CASE, "--case", "single (0)30-20", "--displacement", text]
    assert here("predict", fitted, *asked).exit_code == 0
    by_direction = pd.read_csv(fitted / "prediction.csv").groupby("direction")["displacement_mm"]
    assert {d: u.tolist() for d, u in by_direction} == {"loading": [0, 1, 2, 3], "unloading": [-3, -2, -1, 0]}


def test_a_speed_that_was_not_tested_is_predicted_and_said_to_be_so(fitted, tmp_path):
    asked = "configuration=single,direction=loading,speed_km_h=10,speed_km_h=40"
    done = here("predict", fitted, "--case", asked, "--out", tmp_path, "--displacement", "0,2")
    assert done.exit_code == 0, done.stderr
    assert "not tested: single (10)20-30, single (40)20-30; predicted from the effects of what was" in done.stdout
    assert "speed 40 km/h is beyond what was tested, 0 to 25 km/h" in done.stdout
    curves = pd.read_csv(tmp_path / "prediction.csv")
    rows = curves[["speed_km_h", "of"]].drop_duplicates().to_numpy().tolist()
    assert rows == [[10.0, "untested case"], [40.0, "untested case"]]
    cases = tomllib.loads((tmp_path / "prediction.toml").read_text(encoding="utf-8"))["case"]
    assert [case["tested"] for case in cases] == [False, False]
    assert all("k_kN_per_mm" in case and "C_kN" not in case for case in cases)
