"""`fit --record-draws`: a smaller posterior.nc, the same tables, and every command that reads it still works."""

import json
import tomllib

import pandas as pd
import pytest
from helpers.command_line import TABLES, here, small, written
from helpers.quick_fits import put_draws_for_the_sampler

from bayes_tyre.formats.netcdf import read_tree
from bayes_tyre.report.figures import catalogue

# Fits, and a report with its figures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def fits(tmp_path_factory):
    """Return the folder with the fits `all` and `few`, of the same draws."""
    folder = tmp_path_factory.mktemp("fits")
    with pytest.MonkeyPatch.context() as monkeypatch:
        put_draws_for_the_sampler(monkeypatch)
        monkeypatch.setattr(catalogue, "drawings", lambda *_: iter(()))
        table = written(small(), folder / "records.csv")
        for name, options in (("all", ()), ("few", ("--record-draws", 40))):
            done = here("fit", table, "--out", folder / name, *options)
            assert done.exit_code == 4, done.stderr  # draws that are not of these records
    return folder


def test_tables_are_of_all_draws_and_the_file_holds_few_of_records(fits):
    for name in TABLES:
        assert (fits / "few" / name).read_bytes() == (fits / "all" / name).read_bytes()
    whole, few = (read_tree(fits / name / "posterior.nc") for name in ("all", "few"))
    assert few["record_draws"].sizes["draw"] == 10
    assert few["posterior"].to_dataset()["k_case"].equals(whole["posterior"].to_dataset()["k_case"])
    options = [json.loads((fits / name / "run.json").read_text())["options"] for name in ("all", "few")]
    assert options[1] == {**options[0], "record_draws": 40}


def test_too_few_draws_for_an_interval_are_refused(tmp_path):
    done = here("fit", written(small(), tmp_path / "records.csv"), "--out", tmp_path / "out", "--record-draws", 2)
    assert done.exit_code == 2
    assert "'--record-draws': Input should be greater than or equal to 40" in done.stderr
    assert not (tmp_path / "out").exists()


def test_every_command_that_reads_it_takes_it(fits, tmp_path):
    few = fits / "few"
    assert here("export", few, "--to", "csv-spline", "--out", tmp_path / "export").exit_code == 4
    goal = ("--goal", "k loading / unloading", "--precision", 0.05)
    assert here("next", few, *goal, "--out", tmp_path / "next").exit_code == 4
    done = here("report", few, "--out", tmp_path / "report.html")
    assert done.exit_code == 4
    assert "could not be drawn" not in done.stderr
    assert "failed" not in done.stderr


def test_a_prediction_is_that_of_all_draws_but_for_their_number(fits, tmp_path):
    for name in ("all", "few"):
        done = here("predict", fits / name, "--case", "speed_km_h=0", "--out", tmp_path / name)
        assert done.exit_code == 4, done.stderr
    whole, few = (pd.read_csv(tmp_path / name / "prediction.csv") for name in ("all", "few"))
    of_all, of_few = (tomllib.loads((tmp_path / name / "prediction.toml").read_text()) for name in ("all", "few"))
    assert of_few["case"][0]["k_kN_per_mm"] == of_all["case"][0]["k_kN_per_mm"]
    # A median of 40 draws: its error is 1.25 sd / sqrt(40) = 0.2 sd, and F_i has a sd of 0.02 kN, k of 3 %.
    assert (few["median"] / whole["median"] - 1).abs().max() < 0.05
