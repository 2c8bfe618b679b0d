"""Records whose noise has heavy tails: what is put in comes back, and unseen records are predicted better with them."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.short_fits import OF_STANDING, STANDING, covered
from helpers.simulated_records import simulate
from scipy.stats import binom

from bayes_tyre.inference.diagnostics.leave_one_out.fits import leave_one_record_out
from bayes_tyre.inference.diagnostics.residual_checks import residual_checks
from bayes_tyre.inference.diagnostics.residuals import residuals
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.record_table import check_record_table

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("iterations_fully_compiled")]

SIGMA_KN, NU = 0.03, 3.0


@pytest.fixture(scope="module")
def heavy():
    """Return a table of 24 records of 40 points with t(3) noise, its truth, and the fit with such noise."""
    table, truth = simulate(STANDING, seed=5)
    quiet, _ = simulate(replace(STANDING, noise_kN=1e-12), seed=5)
    noise = np.random.default_rng(5).standard_t(NU, len(table))
    table = check_record_table(table.assign(force_kN=quiet["force_kN"] + SIGMA_KN * noise))
    return table, truth, fit_hierarchical(table, OF_STANDING, ModelSettings(noise="student"))


def test_what_was_put_in_comes_back(heavy):
    table, truth, tree = heavy
    posterior = tree["posterior"].to_dataset()
    # Were coverage exactly 95 %, fewer than 40 of 48 would come up with probability 0.2 %.
    assert binom.cdf(39, 2 * len(truth), 0.95) < 0.0025
    assert covered(tree, truth) >= 40
    # The information of 960 points on log nu and log sigma at nu = 3 leaves standard errors of 0.11 and 0.042; four.
    assert np.log(posterior["noise_nu"].median().item() / NU) == pytest.approx(0.0, abs=0.44)
    assert np.log(posterior["sigma_typical"].median().item() / SIGMA_KN) == pytest.approx(0.0, abs=0.17)
    assert int(tree["sample_stats"]["diverging"].sum()) == 0
    # Ten checks that fail by chance with probability 1e-3 each.
    assert [check.name for check in residual_checks(tree, table) if not check.passed] == []


def test_residuals_that_count_for_what_they_weigh_have_sigma_as_their_standard_deviation(heavy):
    table, _, tree = heavy
    of_records = residuals(tree, table)
    square = np.sum(of_records.white_kN**2) / (of_records.batch.points - 4).sum()
    # A weighted residual's square has a standard deviation below 1.2 of its mean: 960 of them, 4 %; four.
    assert square == pytest.approx(np.mean(of_records.sigma_kN**2), rel=0.16)
    assert np.abs(of_records.white_kN).max() < np.abs(of_records.residual_kN).max() / 2.0


def test_records_left_out_are_predicted_better_with_heavy_tails(heavy):
    table, _, tree = heavy
    normal = fit_hierarchical(table, OF_STANDING, ModelSettings(noise="iid"))
    pairs = (tree, ModelSettings(noise="student")), (normal, ModelSettings(noise="iid"))
    student, iid = (leave_one_record_out(of, table, model).elpd for of, model in pairs)
    difference = np.asarray(student.elpd_i) - np.asarray(iid.elpd_i)
    assert difference.sum() > 2.0 * np.sqrt(len(difference)) * difference.std(ddof=1)
