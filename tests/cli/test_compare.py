"""`compare`: real fits of the same records, one of which a normal scatter of repeats cannot hold."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, here
from helpers.short_fits import OF_STANDING, STANDING
from helpers.simulated_records import simulate

from bayes_tyre.inference.diagnostics import leave_one_out as leave_out
from bayes_tyre.inference.diagnostics.leave_one_out import leave_one_record_out
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.record_table import check_record_table

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


def test_folders_that_hold_no_two_fits_of_the_same_points_are_refused(folder, tmp_path):
    for given, factors in (
        ([folder / "mixture"], ["two folders or more"]),
        ([folder / "mixture", folder / "mixture"], ["named twice"]),
        ([folder / "mixture", tmp_path], ["run.json"]),
    ):
        done = here("compare", *given, "--out", tmp_path / "out")
        assert_refused(done.exit_code, done.stderr, *factors)
    assert not (tmp_path / "out").exists()


def test_importance_sampling_and_a_fit_without_the_record_agree(monkeypatch):
    # No repeat is odd here; model and shapes are those of the normal fit above, and so is what is compiled.
    table, model = check_record_table(simulate(STANDING, seed=3)[0]), ModelSettings(repeats="normal")
    settings = replace(OF_STANDING, draws=1000)
    tree = fit_hierarchical(table, settings, model)
    smoothed = leave_one_record_out(tree, table, model)
    assert not smoothed.refitted.any()
    # The record with the largest k is fitted again.
    least = np.sort(smoothed.pareto_k)[-2:].mean()
    monkeypatch.setattr(leave_out, "PARETO_K_MOST", float(least))
    told: list[str] = []
    exact = leave_one_record_out(tree, table, model, settings, told.append)
    record = int(smoothed.pareto_k.argmax())
    assert exact.refitted.tolist() == [i == record for i in range(24)]
    assert told == [str(exact.elpd.elpd_i["record"].to_numpy()[record])]
    difference = exact.elpd.elpd_i.to_numpy() - smoothed.elpd.elpd_i.to_numpy()
    assert (difference[np.arange(24) != record] == 0.0).all()
    assert exact.elpd.elpd == pytest.approx(float(exact.elpd.elpd_i.sum()))
    # And so is the one with the largest k that importance sampling is said to handle: two Monte Carlo estimates of one
    # number of the order of 70. 2000 draws each leave some 0.1; k up to 0.7 a few.
    handled = int(np.where(smoothed.pareto_k <= 0.7, smoothed.pareto_k, -1.0).argmax())
    again = leave_out._refit_without(handled, prepare_records(table, model), settings, model)
    assert again == pytest.approx(smoothed.elpd.elpd_i.to_numpy()[handled], abs=0.6)
