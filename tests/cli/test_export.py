"""`export` as a user meets it: files of each format read back, what is left out, what is not to be trusted, faults."""

import configparser
import json
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, tree_of
from helpers.hand_made_posteriors import grid, motion_cases, posterior, scattered
from helpers.slow_tests import campaign

from bayes_tyre.formats.netcdf import write_tree
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.results import summary
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.signals.load_deflection import averaged, check_load_deflection, with_deflection
from bayes_tyre.workflow.load_deflection import _cases, _tests

HOSTILE = ('a\n**END "quoted" $ [VERTICAL] ü', "A **end quoted vertical")

SECTIONS = ["MDI_HEADER", "UNITS", "MODEL", "DIMENSION", "VERTICAL"]


def a_result(folder: Path, tree, verdict: str = "pass") -> Path:
    """Write what `export` reads of a result."""
    folder.mkdir(parents=True)
    write_tree(tree, folder / "posterior.nc")
    (folder / "diagnostics.json").write_text(json.dumps({"verdict": verdict}), encoding="utf-8")
    (folder / "run.json").write_text("{}", encoding="utf-8")
    return folder


def records(*configurations: str, without: tuple[str, ...] = ()):
    factor_table = grid(configurations, repeats=1, speeds=(0.0,)).drop(columns=list(without))
    draws = scattered(factor_table, seed=5)
    draws["J"] = draws["J"] * np.sign(factor_table["step_kN"].to_numpy())
    return posterior(draws, factor_table)


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> dict[str, Path]:
    """Return folders of a fit, of one that failed, of motions, and of slow tests."""
    folder = tmp_path_factory.mktemp("results")
    slow = check_load_deflection(campaign(repeats=2).query("configuration == 'single'"))
    readings = with_deflection(slow, {"single": load_rig("single")})
    (folder / "slow").mkdir()
    tests = _tests(readings, None)
    tests.to_csv(folder / "slow" / "load_deflection.csv", index=False)
    _cases(averaged(readings.query("speed_km_h == 0"))[0], None).to_csv(
        folder / "slow" / "load_deflection_cases.csv", index=False
    )
    return {
        "fit": a_result(folder / "fit", records("single")),
        "failed": a_result(folder / "failed", records("single"), "fail"),
        "motion": a_result(folder / "motion", _with_damping(motion_cases())),
        "slow": folder / "slow",
    }


def _with_damping(tree):
    made = tree["posterior"].to_dataset()
    tree["posterior"] = made.assign(c_case=0.0015 + 0.0 * made["k_case"])
    return tree


def export(folder: Path, to: str, out: Path, *options: object) -> dict[str, str]:
    done = here("export", folder, "--to", to, "--out", out, *options)
    assert (done.exit_code, done.stderr) == (0, "")
    return {path.name: path.read_text(encoding="ascii") for path in out.iterdir()}


def ini(text: str) -> configparser.ConfigParser:
    parser = configparser.ConfigParser(comment_prefixes="$", allow_no_value=True, delimiters="=")
    parser.read_string(text)
    return parser


def said(text: str) -> str:
    """Return the text with all line breaks and marks of comments taken away."""
    return " ".join(text.replace("\n$ ", " ").replace("\n# ", " ").replace("\n  // ", " ").split())


def test_a_fit_as_property_files_holds_the_medians_of_its_table_and_omits_what_it_does_not_know(results, tmp_path):
    files = export(results["fit"], "tir", tmp_path / "out")
    assert sorted(files) == ["single_0_20_30.tir", "single_0_30_20.tir"]
    table = summary.cases(records("single"), "pass").query("parameter == 'k'")
    for name, row in zip(sorted(files), table.to_dict("records"), strict=True):
        made = ini(files[name])
        assert made.sections() == SECTIONS
        assert float(made["VERTICAL"]["VERTICAL_STIFFNESS"]) == pytest.approx(1e6 * row["median"])
        assert list(made["VERTICAL"]) == ["vertical_stiffness"]
        assert dict(made["DIMENSION"]) == {}
        assert made["UNITS"]["FORCE"] == "'newton'"
        text = said(files[name])
        assert f"95 % interval {1e6 * row['lower']:.6g} to {1e6 * row['upper']:.6g}" in text
        for key in ("UNLOADED_RADIUS", "VERTICAL_DAMPING", "DEFLECTION_LOAD_CURVE", "FNOMIN"):
            assert f"left out: {key}" in text
        assert "hysteresis is lost" in text
        assert "data: simulated; values: median of the posterior; verdict: pass" in text


def test_quantiles_add_files_and_the_radius_is_in_metres(results, tmp_path):
    options = ("--quantiles", "0.025,0.975", "--unloaded-radius-mm", "498.7")
    files = export(results["fit"], "tir", tmp_path / "out", *options)
    assert len(files) == 6
    names = [f"single_0_20_30{ending}.tir" for ending in ("_q0_025", "", "_q0_975")]
    low, median, high = (float(ini(files[name])["VERTICAL"]["VERTICAL_STIFFNESS"]) for name in names)
    row = summary.cases(records("single"), "pass").query("parameter == 'k' and direction == 'loading'").iloc[0]
    assert [low, median, high] == pytest.approx([1e6 * row[name] for name in ("lower", "median", "upper")])
    assert {ini(text)["DIMENSION"]["UNLOADED_RADIUS"] for text in files.values()} == {"0.4987"}
    assert "quantile 0.025 of the posterior" in said(files[names[0]])


@pytest.mark.parametrize("asked", ["single (0)20-30", "(0)20-30", "direction=loading,speed_km_h=0"])
def test_cases_that_are_asked_for_are_exported_alone(asked, results, tmp_path):
    files = export(results["fit"], "tir", tmp_path / "out", "--case", asked)
    assert list(files) == ["single_0_20_30.tir"]


def test_a_speed_that_was_not_tested_is_exported_as_it_is_predicted_and_says_so(results, tmp_path):
    asked = "direction=loading,speed_km_h=20"
    files = export(results["fit"], "tir", tmp_path / "out", "--case", asked)
    assert list(files) == ["single_20_20_30.tir"]
    text = files["single_20_20_30.tir"]
    assert "tested: none; predicted from other tests for single, loading, 20 km/h" in said(text)
    assert " C = " not in said(text)
    here("predict", results["fit"], "--case", asked, "--out", tmp_path, "--displacement", "0,1")
    case = tomllib.loads((tmp_path / "prediction.toml").read_text(encoding="utf-8"))["case"][0]
    limits = [1e6 * case["k_kN_per_mm"][side] for side in ("lower", "upper")]
    assert f"95 % interval {limits[0]:.6g} to {limits[1]:.6g}" in said(text)


@pytest.mark.parametrize(("result", "text"), [("fit", "no case matches"), ("slow", "leave --case out")])
def test_a_case_that_is_not_there_is_refused(result, text, results, tmp_path):
    done = here("export", results[result], "--to", "tir", "--out", tmp_path / "out", "--case", "triple")
    assert_refused(done.exit_code, done.stderr, str(results[result]), text)
    assert not (tmp_path / "out").exists()


def test_means_are_those_that_a_fit_prints(results, tmp_path):
    files = export(results["fit"], "tir", tmp_path / "out", "--means")
    assert sorted(files) == ["single_loading_mean.tir", "single_unloading_mean.tir"]
    table = summary.summary(records("single"), "pass").query("parameter == 'k_mean'")
    for name, row in zip(sorted(files), table.to_dict("records"), strict=True):
        assert float(ini(files[name])["VERTICAL"]["VERTICAL_STIFFNESS"]) == pytest.approx(1e6 * row["median"])
        text = said(files[name])
        assert f"95 % interval {1e6 * row['lower']:.6g} to {1e6 * row['upper']:.6g}" in text
        assert f"mean over 1 cases of single {row['direction']}" in text


@pytest.mark.parametrize(
    ("missing", "name", "of"),
    [(("configuration",), "loading_mean", "loading"), (("configuration", "direction"), "mean", "all records")],
)
def test_means_of_records_without_a_factor_are_named_by_the_others(missing, name, of, tmp_path):
    files = export(a_result(tmp_path / "fit", records("single", without=missing)), "tir", tmp_path / "out", "--means")
    assert f"cases of {of};" in said(files[f"{name}.tir"])


def test_a_motion_gives_the_damping(results, tmp_path):
    made = ini(export(results["motion"], "tir", tmp_path / "out")["single_0_20_30.tir"])
    assert float(made["VERTICAL"]["VERTICAL_DAMPING"]) == pytest.approx(1500.0)
    assert "DEFLECTION_LOAD_CURVE" not in made


def test_slow_tests_give_a_deflection_load_curve_averaged_where_they_could_be(results, tmp_path):
    files = export(results["slow"], "tir", tmp_path / "out")
    assert len(files) == 3
    made = ini(files["single_0_km_h_mean_of_2.tir"])
    columns, first, *rows = made["DEFLECTION_LOAD_CURVE"]
    assert (columns, first) == ("{pen fz}", "0.0 0.0")
    d, F = np.array([row.split() for row in rows], dtype=float).T
    assert (np.diff(d) > 0).all()
    np.testing.assert_allclose(np.polyfit(d, F, 1)[0], float(made["VERTICAL"]["VERTICAL_STIFFNESS"]))
    text = said(files["single_0_km_h_mean_of_2.tir"])
    assert "status: beta not determined" in text
    assert "values: least-squares estimates" in text
    assert "verdict" not in text.replace("verdict fail", "")


def test_tydex_files_hold_the_curve_and_are_read_as_records_again(results, tmp_path):
    files = export(results["fit"], "tydex", tmp_path / "out")
    assert all("not a measurement" in text for text in files.values())
    table = read_table(tmp_path / "out" / "single_0_30_20.tdx")
    assert set(table["record"]) == {"single (0)30-20"}
    assert table["displacement_mm"].iloc[[0, -1]].tolist() == [0.0, -4.0]
    assert (np.diff(table["force_kN"]) < 0).all()
    export(results["motion"], "tydex", tmp_path / "motion")
    loop = read_table(tmp_path / "motion" / "single_0_20_30.tdx")
    assert loop["displacement_mm"].max() == pytest.approx(2.0)
    assert loop["displacement_mm"].iloc[-1] == pytest.approx(-2.0)
    assert loop["force_kN"].iloc[0] == pytest.approx(-3.6 - 0.306, abs=2e-3)  # -k a - (x - k beta): before loading


def test_splines_are_read_by_numpy_and_their_deflection_grows(results, tmp_path):
    for name in ("fit", "motion", "slow"):
        files = export(results[name], "csv-spline", tmp_path / name)
        for file, text in files.items():
            mm, newton = np.loadtxt(tmp_path / name / file, delimiter=",").T
            assert (np.diff(mm) > 0).all()
            assert (np.diff(newton) > 0).all()
            assert "columns: deflection mm, force N" in said(text)
            assert "hysteresis is lost" in said(text)
    assert np.loadtxt(tmp_path / "fit" / "single_0_20_30.csv", delimiter=",")[-1, 0] == pytest.approx(4.0)


def test_modelica_has_a_record_and_a_table_of_each_case(results, tmp_path):
    files = export(results["motion"], "modelica", tmp_path / "out")
    assert set(files) == {f"{name}_0_20_30.{suffix}" for name in ("single", "dual") for suffix in ("mo", "txt")}
    record, table = files["dual_0_20_30.mo"], files["dual_0_20_30.txt"]
    assert record.startswith("record dual_0_20_30\n")
    assert 'parameter Real c(unit="N.s/m") = 1500.0 "95 % interval 1500 to 1500";' in record
    numbers = pd.read_csv(tmp_path / "out" / "dual_0_20_30.txt", comment="#", sep=" ").to_numpy()
    assert table.splitlines()[-len(numbers) - 1] == f"double force({len(numbers)},2)"
    np.testing.assert_allclose(numbers[:, 1], 1.8e6 * numbers[:, 0], atol=1e-6)


def test_a_result_that_failed_is_written_says_so_in_every_file_and_ends_with_4(results, tmp_path):
    for to in ("tir", "tydex", "modelica", "csv-spline"):
        done = here("export", results["failed"], "--to", to, "--out", tmp_path / to)
        assert done.exit_code == 4
        assert done.stderr.count("\n") == 1
        assert "not to be trusted" in done.stderr
        assert all("NOT TO BE TRUSTED: verdict fail" in path.read_text() for path in (tmp_path / to).iterdir())


def test_hostile_labels_are_text_and_no_two_cases_share_a_file(tmp_path):
    folder = a_result(tmp_path / "fit", records(*HOSTILE))
    for to in ("tir", "tydex", "modelica", "csv-spline"):
        files = export(folder, to, tmp_path / to)
        assert len({name.lower() for name in files}) == (8 if to == "modelica" else 4)
        assert all(Path(name).stem.isidentifier() for name in files)
        if to == "tir":
            assert all(ini(text).sections() == SECTIONS for text in files.values())
        if to == "tydex":
            assert all(text.count("\n**END") == 1 for text in files.values())


def test_loading_and_unloading_differ_in_their_files_names_where_no_load_does(tmp_path):
    folder = a_result(tmp_path / "fit", records("single", without=("initial_load_kN",)))
    names = export(folder, "tydex", tmp_path / "out")
    assert "single_0_step_10_kN.tdx" in names
    assert "single_0_step_minus_10_kN.tdx" in names
    assert not any("energy_per_cycle" in text for text in names.values())
    assert all(
        "C is the envelope's force where the records' displacement is 0" in said(text) for text in names.values()
    )


def test_what_a_format_needs_and_a_result_has_not_is_refused_and_nothing_written(results, tmp_path):
    tree = motion_cases()
    tree.attrs["law"] = "rigid_ring"
    folder = a_result(tmp_path / "ring", tree)
    before = tree_of(tmp_path)
    for to in ("tydex", "csv-spline"):
        done = here("export", folder, "--to", to, "--out", tmp_path / "out")
        assert_refused(done.exit_code, done.stderr, str(folder), "no force curve", "use --to tir")
    done = here("export", results["slow"], "--to", "tir", "--out", tmp_path / "out", "--quantiles", "0.1")
    assert_refused(done.exit_code, done.stderr, "no posterior", "leave --quantiles out")
    assert tree_of(tmp_path) == before
    assert list(export(folder, "modelica", tmp_path / "out")) != []


def test_damaged_motions_are_refused(tmp_path):
    for name, said in (("amplitude", "does not say the amplitude"), ("draws", "k_case holds no numbers")):
        tree = motion_cases()
        if name == "amplitude":
            tree.attrs["amplitude_mm"] = "x"
        else:
            draws = tree["posterior"].to_dataset()
            tree["posterior"] = draws.assign(k_case=draws["k_case"].astype(str))
        folder = a_result(tmp_path / name, tree)
        done = here("export", folder, "--to", "tir", "--out", tmp_path / "out")
        assert_refused(done.exit_code, done.stderr, f"{folder / 'posterior.nc'}: {said}", "again")


@pytest.mark.filterwarnings("default:1 tests without a k")
def test_load_deflection_of_an_older_version_or_without_any_stiffness_is_refused(results, tmp_path):
    table = pd.read_csv(results["slow"] / "load_deflection.csv")
    for spoilt, text in (
        (table.drop(columns="flat_ground_low_mm"), "lacks column flat_ground_low_mm"),
        (table.assign(k_kN_per_mm=np.nan), "no k above zero"),
    ):
        spoilt.to_csv(tmp_path / "load_deflection.csv", index=False)
        done = here("export", tmp_path, "--to", "tir", "--out", tmp_path / "out")
        assert_refused(done.exit_code, done.stderr, "load_deflection.csv", text)
    table.assign(k_kN_per_mm=[np.nan, *table["k_kN_per_mm"][1:]]).to_csv(tmp_path / "load_deflection.csv", index=False)
    done = here("export", tmp_path, "--to", "tir", "--out", tmp_path / "out")
    assert done.exit_code == 0
    assert "1 tests without a k above zero are left out" in done.stderr


@pytest.mark.parametrize(
    "options",
    [
        ("--to", "tydex", "--unloaded-radius-mm", "500"),
        ("--to", "tir", "--unloaded-radius-mm", "-1"),
        ("--to", "tir", "--unloaded-radius-mm", "0.4987"),  # metres
        ("--to", "tydex", "--means"),
        ("--to", "tir", "--means", "--case", "single (0)20-30"),
        ("--to", "tir", "--quantiles", "0,1"),
        ("--to", "tir", "--quantiles", "a"),
        ("--to", "mf"),
    ],
)
def test_options_that_make_no_sense_are_usage_errors(options, results, tmp_path):
    done = here("export", results["fit"], "--out", tmp_path / "out", *options)
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("result", "options", "lacks"), [("fit", [], True), ("motion", ["--unloaded-radius-mm", 500], False)]
)
def test_the_command_ends_with_the_range_of_k_and_with_what_the_files_lack(result, options, lacks, results, tmp_path):
    done = here("export", results[result], "--to", "tir", "--out", tmp_path, *options)
    stiffness = [
        float(line.split(" = ")[1])
        for path in tmp_path.glob("*.tir")
        for line in path.read_text().splitlines()
        if line.startswith("VERTICAL_STIFFNESS")
    ]
    assert f"k of {len(stiffness)} cases: {min(stiffness):.4g} to {max(stiffness):.4g} N/m" in done.stdout
    assert "use the case nearest to what you simulate, or the means over cases: --means" in done.stdout
    for key in ("UNLOADED_RADIUS", "VERTICAL_DAMPING"):
        assert (f"not in the files: {key}: " in done.stdout) is lacks
