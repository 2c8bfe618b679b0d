"""`next` from the command line: the files, what is printed, and what is refused."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.command_line import assert_refused, here, small, tree_of
from helpers.hand_made_posteriors import fixed, posterior
from helpers.quick_fits import drawn
from helpers.reported_motions import write_motions
from helpers.reported_results import printed_factors

from bayes_tyre.formats.constant_data import set_apart
from bayes_tyre.formats.netcdf import read_tree, write_tree

FACTORS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN"]
FILES = {"next.csv", "plan.csv", "figures/", "figures/width_against_tests.png"}


@pytest.fixture(scope="module")
def fit(tmp_path_factory) -> Path:
    """Return what `next` reads of a result: loading and unloading, three records each; its verdict is fail."""
    return write_draws(tmp_path_factory.mktemp("fit"), drawn(small()))


def write_draws(folder: Path, tree: xr.DataTree) -> Path:
    write_tree(tree, folder / "posterior.nc")
    (folder / "diagnostics.json").write_text('{"verdict": "fail"}')
    (folder / "run.json").write_text("{}")
    return folder


@pytest.fixture(scope="module")
def motions(tmp_path_factory) -> Path:
    return write_motions(tmp_path_factory.mktemp("motions") / "motions")


def asked(folder: Path, goal: str, out: Path, *options: object):
    return here("next", folder, "--goal", goal, "--precision", "1%", "--out", out, *options)


def test_the_files_are_those_of_the_contract(fit, tmp_path):
    before = tree_of(fit)
    done = asked(fit, "k loading / unloading", tmp_path / "out", "--tests", 4)
    assert done.exit_code == 4  # a forecast from a posterior that is not to be trusted is not either
    assert "not to be trusted" in done.stderr
    assert tree_of(tmp_path / "out").keys() == FILES
    ranked, plan = (pd.read_csv(tmp_path / "out" / name) for name in ("next.csv", "plan.csv"))
    ends = ["origin", "verdict"]
    columns = ["rank", "kind", *FACTORS, "tests", "minutes", "width_now", "width_expected", "method", *ends]
    assert ranked.columns.tolist() == columns
    assert plan.columns.tolist() == ["test", "kind", *FACTORS, "minutes", "width_expected", "method", *ends]
    assert set(ranked["kind"]) == {"repeat"}
    assert set(ranked["tests"]) == {3}
    assert ranked["minutes"].isna().all()
    assert (ranked["width_expected"] < ranked["width_now"]).all()
    assert plan["width_expected"].is_monotonic_decreasing
    assert len(plan) == 4
    assert set(ranked["origin"]) == {"simulated"}
    assert set(plan["verdict"]) == {"fail"}
    assert tree_of(fit) == before


def test_the_answer_is_printed_and_then_where_the_files_are(fit, tmp_path):
    costs = tmp_path / "costs.toml"
    costs.write_text("minutes_per_test = 5\n[setup_minutes]\nspeed_km_h = 10\n")
    done = asked(fit, "k single (0)20-30", tmp_path / "out", "--cost", costs, "--tests", 2)
    first, best, *_, plan, _, _, last = done.stdout.splitlines()
    ranked, planned = (pd.read_csv(tmp_path / "out" / name) for name in ("next.csv", "plan.csv"))
    now, after = (f"{100 * ranked[name][0]:.3g} %" for name in ("width_now", "width_expected"))
    assert first.startswith("k single (0)20-30: median ")
    assert first.endswith(f"95 % interval {now} of it wide (one case)")
    assert best == f"1  3 more repeats of single (0)20-30: interval {now} to {after}, 25 min"
    assert plan.startswith("plan not expected to reach 1 %: 2 tests, ")
    assert plan.endswith(f"{100 * planned['width_expected'][1]:.3g} %, 20 min")
    assert last == f"wrote {tmp_path / 'out' / 'figures' / 'width_against_tests.png'} (data: simulated, verdict fail)"
    shown = here("show", tmp_path / "out").stdout.splitlines()
    assert best in shown
    assert f"plan: 2 tests{plan.partition('2 tests')[2]}" in shown
    quiet = asked(fit, "k single (0)20-30", tmp_path / "quiet", "--cost", costs, "--tests", 2, "--quiet")
    assert quiet.stdout == ""
    assert tree_of(tmp_path / "quiet") == tree_of(tmp_path / "out")


def test_levels_of_the_rig_make_new_cases(fit, tmp_path):
    costs = tmp_path / "costs.toml"
    costs.write_text("minutes_per_test = 5\n[rig]\nspeed_km_h = [50]\n")
    asked(fit, "k single (50)20-30", tmp_path / "out", "--cost", costs, "--repeats", 1)
    ranked = pd.read_csv(tmp_path / "out" / "next.csv")
    assert set(ranked.loc[ranked["kind"] == "case", "speed_km_h"]) == {50.0}
    assert set(ranked.loc[ranked["kind"] == "repeat", "speed_km_h"]) == {0.0}
    assert (ranked.loc[0, "kind"], ranked.loc[0, "tests"], ranked.loc[0, "minutes"]) == ("case", 1, 5)


def test_a_slope_over_the_actual_load_leaves_new_cases_out(tmp_path):
    tree = drawn(small())
    data = tree["posterior"].to_dataset()
    slope = xr.DataArray(0.1 * data["k_case"].to_numpy()[..., :1], dims=("chain", "draw", "load"))
    tree["posterior"] = xr.DataTree(data.assign(log_k_load=slope).assign_coords(load=["per 10 kN"]))
    costs = tmp_path / "costs.toml"
    costs.write_text("minutes_per_test = 5\n[rig]\nspeed_km_h = [50]\n")
    done = asked(write_draws(tmp_path, tree), "k single (0)20-30", tmp_path / "out", "--cost", costs)
    assert done.exit_code == 4, done.stderr
    assert set(pd.read_csv(tmp_path / "out" / "next.csv")["kind"]) == {"repeat"}


def test_energy_is_a_goal_of_motions_alone(fit, motions, tmp_path):
    done = asked(motions, "energy_per_cycle dual / single", tmp_path / "out", "--tests", 2)
    assert done.exit_code == 0, done.stderr
    assert len(pd.read_csv(tmp_path / "out" / "plan.csv")) == 2
    refused = asked(fit, "energy_per_cycle dual / single", tmp_path / "refused")
    assert_refused(refused.exit_code, refused.stderr, "energy_per_cycle", "run bayes-tyre motion")
    assert not (tmp_path / "refused").exists()


def test_a_ranking_is_a_goal_by_its_ratio_in_doubt_or_by_how_probably_it_is_wrong(motions, tmp_path):
    ratio = asked(motions, "ranking k", tmp_path / "ratio", "--tests", 2)
    assert ratio.exit_code == 0, ratio.stderr
    goal = ratio.stdout.splitlines()[0]
    above, _, below = goal.partition("; ")[2].removesuffix(")").partition(" above ")
    assert goal.startswith(f"k {above} / {below}: median 1.0")
    wrong = asked(motions, "wrong ranking k", tmp_path / "wrong", "--tests", 2)
    assert wrong.exit_code == 0, wrong.stderr
    ranked, plan = (pd.read_csv(tmp_path / "wrong" / name) for name in ("next.csv", "plan.csv"))
    assert ranked.columns.tolist()[-6:-3] == ["minutes", "p_wrong_now", "p_wrong_expected"]
    assert (ranked["p_wrong_expected"] < ranked["p_wrong_now"]).all()
    assert plan["p_wrong_expected"].is_monotonic_decreasing
    now = f"{100 * ranked['p_wrong_now'][0]:.3g} %"
    assert wrong.stdout.startswith(f"wrong ranking k: {above} above {below}, wrong with probability {now}\n")
    assert f": wrong ranking {now} to " in here("show", tmp_path / "wrong").stdout


def test_a_posterior_of_printed_tables_has_no_repeats_to_go_by(tmp_path):
    printed = posterior({"k_case": fixed([1.0] * 8), "beta_case": fixed([0.1] * 8)}, printed_factors("single", "dual"))
    done = asked(write_draws(tmp_path, printed), "k dual / single", tmp_path / "out")
    assert_refused(done.exit_code, done.stderr, "posterior.nc", "no repeats", "fit a record table")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("minutes_per_test = ", "cannot be read as TOML"),
        ("budget_minutes = 5", "minutes_per_test: is missing"),
        ("minutes_per_test = 5\n[setup_minutes]\nsped_km_h = 1", "did you mean setup_minutes.speed_km_h?"),
        ("minutes_per_test = -5", "minutes_per_test"),
        ("minutes_per_test = 5\n[rig]\nstep_kN = 5", "rig.step_kN"),
        (None, "cannot be read"),
    ],
)
def test_a_cost_file_that_cannot_be_is_refused(text, said, fit, tmp_path):
    costs = tmp_path / "costs.toml"
    if text is not None:
        costs.write_text(text)
    done = asked(fit, "k single (0)20-30", tmp_path / "out", "--cost", costs)
    assert_refused(done.exit_code, done.stderr, f"--cost {costs}", said)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("precision", ["x", "0", "-2%", "nan", "%"])
def test_a_precision_that_cannot_be_is_a_usage_error(precision, fit, tmp_path):
    done = here("next", fit, "--goal", "k", "--precision", precision, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "--precision" in done.stderr


def test_a_posterior_without_the_means_of_groups_is_refused(tmp_path):
    tree = drawn(small())
    tree["posterior"] = xr.DataTree(tree["posterior"].to_dataset().drop_vars(["k_group"]))
    done = asked(write_draws(tmp_path, tree), "k single (0)20-30", tmp_path / "out")
    assert_refused(done.exit_code, done.stderr, "posterior.nc", "k_group", "run fit again")


def changed(posterior: xr.Dataset, name: str, value: float | str) -> xr.Dataset:
    """Return a posterior one of whose variables has a value in all places."""
    return posterior.assign({name: xr.full_like(posterior[name], value, dtype=np.asarray(value).dtype)})


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda draws: changed(draws, "beta_case", "x"), "beta_case holds no numbers"),
        (lambda draws: changed(draws, "k_case", -1.0), "k_case has draws that are not above 0"),
        (lambda draws: changed(draws, "k_case", np.nan), "k_case has draws that are not above 0"),
        (lambda draws: changed(draws, "sd_log_k_repeat", 0.0), "the scatter of its repeats has draws that are not"),
        (
            lambda draws: draws.assign_coords(record_speed_km_h=draws["record_speed_km_h"] + 1),
            "has a record that is of",
        ),
    ],
)
def test_a_damaged_posterior_is_refused(motions, tmp_path, damage, said):
    damaged = shutil.copytree(motions, tmp_path / "damaged")
    tree = read_tree(motions / "posterior.nc")
    tree["posterior"] = xr.DataTree(damage(tree["posterior"].to_dataset()))
    write_tree(tree, damaged / "posterior.nc")
    done = asked(damaged, "k single (0)20-30", tmp_path / "out")
    assert_refused(done.exit_code, done.stderr, f"{damaged / 'posterior.nc'}: {said}", "run fit or motion again")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("group", "said"), [("posterior", "holds no draws"), ("constant_data", "does not say what its cases are")]
)
def test_a_posterior_without_a_group_of_its_own_is_refused(group, said, motions, tmp_path):
    damaged = shutil.copytree(motions, tmp_path / "damaged")
    whole = set_apart(read_tree(motions / "posterior.nc"))
    write_tree(whole.drop_nodes(group), damaged / "posterior.nc")
    for done in (asked(damaged, "k", tmp_path / "out"), here("show", damaged, "--limit", "k >= 1.8")):
        assert_refused(done.exit_code, done.stderr, f"{damaged / 'posterior.nc'}: {said}", "run fit or motion")
