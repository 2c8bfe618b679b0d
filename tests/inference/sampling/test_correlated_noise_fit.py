"""Records whose noise is not independent: intervals hold the truth when told so, and the verdict asks for it."""

import numpy as np
import pandas as pd
import pytest
from helpers.short_fits import SHORT, covered
from helpers.simulated_records import Plan, simulate
from scipy.stats import binom

from bayes_tyre.inference.diagnostics.residual_checks import residual_checks
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.hierarchical_fit import fit_hierarchical
from bayes_tyre.record_table import check_record_table

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("iterations_fully_compiled")]

POINTS, NOISE_KN, RHO, WINDOW = 150, 0.03, 0.8, 20


def autoregressive(rng: np.random.Generator) -> np.ndarray:
    noise = rng.standard_normal(POINTS)
    for t in range(1, POINTS):
        noise[t] = RHO * noise[t - 1] + np.sqrt(1.0 - RHO**2) * noise[t]
    return noise


def smoothed(rng: np.random.Generator) -> np.ndarray:
    return np.convolve(rng.standard_normal(POINTS + WINDOW - 1), np.ones(WINDOW), "valid") / np.sqrt(WINDOW)


def noisy(kind, seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return 48 records with this noise, and their truth."""
    table, truth = simulate(Plan(points=POINTS, noise_kN=1e-12), seed)
    rng = np.random.default_rng(seed)
    table["force_kN"] += NOISE_KN * np.concatenate([kind(rng) for _ in range(len(truth))])
    return check_record_table(table), truth


def _rho_and_sigma_come_back(posterior) -> None:
    # Over 48 records of 150 points the standard error of a common rho is 0.6 / sqrt(7200) = 0.007, of log sigma three
    # times 1 / sqrt(14400) = 0.025; six of them.
    assert np.tanh(posterior["atanh_rho_typical"].median().item()) == pytest.approx(RHO, abs=0.045)
    assert posterior["sigma_typical"].median().item() == pytest.approx(NOISE_KN, rel=0.15)


@pytest.mark.parametrize(
    ("kind", "model"),
    [(autoregressive, ModelSettings(noise="ar1")), (smoothed, ModelSettings(noise_window=WINDOW))],
    ids=["autoregressive", "smoothed"],
)
def test_intervals_hold_the_truth_when_the_noise_is_told(kind, model):
    table, truth = noisy(kind, seed=11)
    tree = fit_hierarchical(table, SHORT, model)
    hits, of = covered(tree, truth), 2 * len(truth)
    # Were coverage exactly 95 %, fewer than 85 or all of 96 would come up with probability 1.6 % and 0.7 %.
    assert binom.cdf(84, of, 0.95) + binom.pmf(of, of, 0.95) < 0.025
    assert 85 <= hits < of
    # Whitened, 48 records of 150 points leave a mean lag-1 autocorrelation near 0: its standard error is 0.012.
    found = {check.name: check for check in residual_checks(tree, table)}
    assert abs(found["residual_autocorrelation"].value) < 0.1
    # Seven checks that fail by chance with probability 1e-3 each.
    assert [name for name, check in found.items() if not check.passed] == []
    if model.noise == "ar1":
        _rho_and_sigma_come_back(tree["posterior"].to_dataset())


def test_independent_noise_in_their_place_is_too_sure_and_the_verdict_says_what_to_do():
    table, truth = noisy(autoregressive, seed=11)
    tree = fit_hierarchical(table, SHORT, ModelSettings(noise="iid"))
    # With a lag-1 autocorrelation of 0.8 a record holds a ninth of the points it seems to: intervals a third as wide.
    assert covered(tree, truth) < 75
    failed = [check for check in residual_checks(tree, table) if not check.passed]
    assert any("--noise auto or ar1" in check.remedy for check in failed)
