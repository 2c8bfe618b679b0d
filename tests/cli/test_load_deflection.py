"""`load-deflection` as a user meets it: what it writes and says, the printed slopes, steps beside, faults."""

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, files_of, here, tree_of, written
from helpers.documented import documented_columns
from helpers.slow_tests import Tyre, campaign, on_flat_ground
from helpers.slow_tests import path as slow_path

from bayes_tyre.published import tables
from bayes_tyre.published.load_deflection import reconstruct_tests

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow

K = "k_kN_per_mm"


def read(path) -> pd.DataFrame:
    return pd.read_csv(path, keep_default_na=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with simulated tests, and in `out` what the command wrote of them and of step records."""
    path = tmp_path_factory.mktemp("slow")
    written(campaign().assign(pressure_bar=7.25), path / "slow.csv")
    steps = pd.DataFrame({"configuration": ["single", "dual"], "speed_km_h": 0, K: [1.51, 2.4], f"{K}_se": 0.02})
    written(steps, path / "least_squares.csv")
    done = here("load-deflection", path / "slow.csv", "--out", path / "out", "--steps", path / "least_squares.csv")
    assert (done.exit_code, done.stderr) == (0, "")
    (path / "said").write_text(done.stdout)
    return path


def test_it_writes_a_row_a_test_a_row_a_case_a_figure_and_says_so(folder):
    names = files_of(folder / "out")
    shared, figure = "shared_stiffness.csv", "figures/load_deflection_loops.png"
    assert names == {"load_deflection.csv", "load_deflection_cases.csv", shared, figure}
    said = (folder / "said").read_text().splitlines()
    assert said[-2:] == ["2 stiffnesses shared with step records, 1 in tension", "12 tests, 12 not ok"]
    wrote = [line for line in said if line.startswith("wrote ")]
    assert len(wrote) == len(names)
    assert all("(data: simulated)" in line for line in wrote)
    captions = [line for line in said if line.endswith(" not ok") and " rows, " in line]
    assert len(captions) == 3
    assert captions[0] == "slow tests (data: simulated): 12 rows, 12 not ok"
    tests, cases = (read(folder / "out" / name) for name in ("load_deflection.csv", "load_deflection_cases.csv"))
    assert list(tests.columns[:4]) == ["test", "configuration", "speed_km_h", "repeat"]
    assert list(tests.columns[-3:]) == ["status", "pressure_bar", "origin"]
    assert {str(name).removesuffix("_se").replace("unloading", "loading") for name in tests} - {
        "test",
        "pressure_bar",
    } <= documented_columns()
    assert (len(tests), len(cases)) == (12, 4)
    assert set(cases["repeats"]) == {3}
    assert tests["status"].str.contains("beta not determined: only an upper bound").all()
    assert (tests[["x_kN", "beta_mm"]] == "").all(axis=None)


def test_the_truth_comes_back_on_flat_ground_through_rig_and_command(folder):
    tests = read(folder / "out" / "load_deflection.csv")
    truth = np.where(tests["configuration"] == "single", 1.5, 1.9)
    # 24 numbers beyond 4.5 standard errors of 13 degrees of freedom: one seed in seventy.
    assert (np.abs(tests[K] - truth) < 4.5 * tests[f"{K}_se"]).all()
    settled = 0.7 - truth * 0.05
    assert (np.abs(tests["x_less_k_beta_kN"] - settled) < 4.5 * tests["x_less_k_beta_kN_se"]).all()
    # Flat-ground energies are smaller by about the factor that takes 1 kN there: both are called what they are.
    ratio = tests["energy_per_cycle_J"] / tests["flat_ground_energy_per_cycle_J"]
    assert ratio.between(1.1, 1.25).all()


def test_step_records_of_the_same_tyre_give_a_shared_k_and_the_tension(folder):
    shared = read(folder / "out" / "shared_stiffness.csv")
    assert shared["configuration"].tolist() == ["single", "dual"]
    single, dual = shared.iloc[0], shared.iloc[1]
    assert (single["status"], single["tests"]) == ("ok", 3)
    assert 1.49 < single[f"{K}_combined"] < 1.52
    assert dual["tension"] > 10
    assert "step records stiffer" in dual["status"]


def test_the_printed_slopes_come_back_from_the_tests_reconstructed_from_them(tmp_path):
    path = written(reconstruct_tests(), tmp_path / "reconstructed.csv")
    done = here("load-deflection", path, "--out", tmp_path / "out", "--quiet")
    assert (done.exit_code, done.stderr, done.stdout) == (0, "", "")
    cases = read(tmp_path / "out" / "load_deflection_cases.csv").set_index(["configuration", "speed_km_h"])
    printed = tables.model_and_tests().query("kind == 'tests'").to_dict("records")
    assert len(printed) == 10
    for row in printed:
        found = cases.loc[(row["configuration"], row["speed_km_h"])]
        assert abs(float(found[f"k_{row['direction']}_kN_per_mm"]) - row[K]) <= row["half_digit"] + 1e-6
    assert set(cases["origin"]) == {"reconstructed"}


def test_readings_that_are_the_tyre_s_own_need_no_rig_and_no_words(tmp_path):
    path = written(on_flat_ground(Tyre(), 0.05), tmp_path / "slow.parquet.csv")
    refused = here("load-deflection", path, "--out", tmp_path / "out")
    assert_refused(refused.exit_code, refused.stderr, "no column configuration", "--rig")
    assert not (tmp_path / "out").exists()
    done = here("load-deflection", path, "--out", tmp_path / "out", "--rig", "none", "--beta", "0.05")
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "1 tests, 0 not ok"
    row = read(tmp_path / "out" / "load_deflection.csv").iloc[0]
    assert row["energy_per_cycle_J"] == row["flat_ground_energy_per_cycle_J"]
    assert abs(row["x_kN"] - 0.7) < 5 * row["x_kN_se"]
    assert {name for name in tree_of(tmp_path / "out") if name.endswith(".csv")} == {"load_deflection.csv"}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--rig", "no.toml"), ("no.toml", "no such rig file")),
        (("--steps", "no.csv"), ("no.csv", "no such file")),
        (("--steps", "slow.csv"), ("--steps slow.csv", "missing column k_kN_per_mm", "least_squares.csv")),
    ],
)
def test_what_is_of_no_use_beside_the_table_is_refused_and_nothing_written(
    options, said, folder, monkeypatch, tmp_path
):
    monkeypatch.chdir(folder)
    done = here("load-deflection", "slow.csv", "--out", tmp_path / "out", *options)
    assert_refused(done.exit_code, done.stderr, *said)
    assert tree_of(tmp_path) == {}


def test_a_fault_in_the_table_is_one_line_and_units_are_suspected(tmp_path):
    table = on_flat_ground(Tyre(), configuration="single")
    path = written(table.assign(load_kN=lambda t: 1000 * t["load_kN"]), tmp_path / "newtons.csv")
    done = here("load-deflection", path, "--out", tmp_path / "out")
    assert done.exit_code == 0
    assert done.stderr.startswith("bayes-tyre: warning: ")
    assert "looks like N; divide by 1000" in done.stderr
    table.loc[3, "load_kN"] = np.nan
    done = here("load-deflection", written(table, tmp_path / "gap.csv"), "--out", tmp_path / "gap")
    assert_refused(done.exit_code, done.stderr, "gap.csv: row 4 (line 5), test 'one', column load_kN is empty")
    assert not (tmp_path / "gap").exists()


def test_a_beta_that_is_no_length_is_a_usage_error(tmp_path):
    assert here("load-deflection", "slow.csv", "--out", tmp_path, "--beta", "-1").exit_code == 2


def test_a_curve_of_several_cycles_is_cut_and_can_be_shown_and_reported(tmp_path):
    d = slow_path(high_mm=10.0, steps=100)
    path = written(on_flat_ground(Tyre(beta=0.4), 0.02, 1, np.concatenate([d, d[1:], d[1:]])), tmp_path / "driven.csv")
    done = here("load-deflection", path, "--rig", "none", "--out", tmp_path / "out")
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "3 tests, 0 not ok"
    tests = read(tmp_path / "out" / "load_deflection.csv")
    assert tests["test"].tolist() == ["one, cycle 1", "one, cycle 2", "one, cycle 3"]
    # 3 cycles within 5 standard errors of some 200 degrees of freedom: one seed in 10^5.
    assert (np.abs(tests["x_kN"] - 0.7) < 5 * tests["x_kN_se"]).all()
    shown = here("show", tmp_path / "out")
    assert "slow tests (data: simulated): 3 rows, 0 not ok" in shown.stdout
    assert "k loading, kN/mm" in shown.stdout
    assert here("report", tmp_path / "out").exit_code == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "one, cycle 3" in page
    assert page.count("data:image/png;base64,") == 1
