"""`show --truth`: results of a folder beside the simulator's truth, and truths that are none."""

import pandas as pd
import pytest
from helpers.command_line import assert_refused, here

from bayes_tyre.record import FACTORS


@pytest.fixture
def folder(tmp_path):
    factors = pd.DataFrame([("single", "unloading", 0.0, 30.0, -10.0, 1)], columns=list(FACTORS)).assign(record="r")
    factors.assign(k_kN_per_mm=2.0, beta_mm=0.1).to_csv(tmp_path / "truth.csv", index=False)
    factors.assign(k_kN_per_mm=2.1, beta_mm=0.1, status="ok").to_csv(tmp_path / "least_squares.csv", index=False)
    return tmp_path


def test_least_squares_beside_the_truth(folder):
    done = here("show", folder, "--truth", folder / "truth.csv")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "k: rms relative error 5.00 %" in done.stdout
    assert "another curve's: it differs without noise." in done.stdout.splitlines()[-1]


def test_what_is_no_truth_is_refused(folder):
    done = here("show", folder, "--truth", folder / "none.csv")
    assert_refused(done.exit_code, done.stderr, "none.csv", "no such file")
    (folder / "least_squares.csv").unlink()
    done = here("show", folder, "--truth", folder / "truth.csv")
    assert_refused(done.exit_code, done.stderr, str(folder), "holds neither")
    assert here("show", folder).exit_code == 3
