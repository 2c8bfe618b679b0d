"""`compare`: real fits of the same records, one of which a normal scatter of repeats cannot hold."""

import pandas as pd
import pytest
from helpers.command_line import assert_refused, here
from helpers.short_fits import OF_STANDING, STANDING
from helpers.simulated_records import simulate

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("without_figures")]

ODD = "single (0)20-30(2)"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with fits of one table by mixture and normal; one repeat is 60 % stiffer than it should be."""
    folder = tmp_path_factory.mktemp("compare")
    table, _ = simulate(STANDING, seed=5)
    rows = table["record"] == ODD
    start = table.loc[rows, "force_kN"].iloc[0]
    table.loc[rows, "force_kN"] = start + 1.6 * (table.loc[rows, "force_kN"] - start)
    table.to_csv(folder / "records.csv", index=False)
    for repeats in ("mixture", "normal"):
        options = ["--repeats", repeats, "--chains", OF_STANDING.chains, "--warmup", OF_STANDING.warmup]
        options += ["--draws", OF_STANDING.draws, "--target-accept", OF_STANDING.target_accept]
        done = here("fit", folder / "records.csv", "--out", folder / repeats, *options, "--quiet")
        # Enough draws to compare; too few for an R-hat of 1.01 of every one of some 200 quantities.
        assert done.exit_code == 4, done.stderr
    return folder


def test_the_mixture_predicts_better_where_a_repeat_is_discordant(folder, tmp_path):
    done = here("compare", folder / "normal", folder / "mixture", "--no-refit", "--out", tmp_path)
    assert done.exit_code == 4, done.stderr
    assert "is not to be trusted" in done.stderr
    table = pd.read_csv(tmp_path / "comparison.csv")
    assert table["model"].tolist() == ["mixture", "normal"]
    assert table["elpd_difference"].iloc[1] < -4.0
    assert "mixture predicts a record left out" in done.stdout
    by_record = pd.read_csv(tmp_path / "comparison_records.csv").pivot(index="record", columns="model", values="elpd")
    assert len(by_record) == 24
    # The odd repeat is what the normal scatter cannot foresee, and what widens it for all the others.
    assert (by_record["mixture"] > by_record["normal"]).mean() > 0.7
    # A record of 40 points at 0.03 kN is worth some 40 * 2.09 = 83 in log density, less what its parameters cost.
    usual = by_record.drop(index=ODD)["mixture"]
    assert 50.0 < usual.median() < 84.0
    of_cases = pd.read_csv(tmp_path / "comparison_cases.csv")
    assert of_cases["model"].tolist() == ["mixture", "normal"]
    assert set(of_cases["cases"]) == {8}
    assert "mixture predicts a case left out" in done.stdout
    # All three records of a case, which no other record knows: worth less than each is beside the other two.
    assert 8 * 3 * 40.0 < of_cases["elpd"].iloc[0] < table["elpd"].iloc[0]
    shown = here("show", tmp_path)
    assert "cases left out, one at a time:" in shown.stdout
    both = folder / "normal", folder / "mixture"
    done = here("predict", *both, "--weights", tmp_path, "--case", "speed_km_h=0", "--displacement", "0,1")
    assert done.exit_code == 4, done.stderr  # the fits have too few draws
    assert set(pd.read_csv(tmp_path / "prediction.csv")["verdict"]) == {"fail"}
    here("compare", *both, "--no-refit", "--out", tmp_path, "--quiet")
    assert not (tmp_path / "prediction.csv").exists()  # it had the weights of before
    assert not (tmp_path / "prediction.toml").exists()


def test_folders_that_hold_no_two_fits_of_the_same_points_are_refused(folder, tmp_path):
    for given, factors in (
        ([folder / "mixture"], ["two folders or more"]),
        ([folder / "mixture", folder / "mixture"], ["named twice"]),
        ([folder / "mixture", tmp_path], ["run.json"]),
    ):
        done = here("compare", *given, "--out", tmp_path / "out")
        assert_refused(done.exit_code, done.stderr, *factors)
    assert not (tmp_path / "out").exists()
