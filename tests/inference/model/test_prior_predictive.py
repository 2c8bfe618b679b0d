"""Draws of the priors alone: the same laws and the same hierarchy as the model that is sampled."""

import numpy as np
import pandas as pd
import pytest
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING, PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.inference.model.prior_predictive import (
    Start,
    prior_draws,
    prior_parameters,
    prior_records,
)
from bayes_tyre.record_table import record_factors

DRAWS = 40_000
PLANS = {
    "all that varies": Plan(configurations=("single",), steps=(-10.0, -5.0, 5.0, 10.0), points=20),
    "two repeats": Plan(configurations=("single",), repeats=2, points=30),
    "one case": Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=30),
    "one record": Plan(configurations=("a",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), repeats=1, points=30),
}


def levels_of(plan: str) -> tuple[pd.DataFrame, Factors]:
    table, _ = simulate(PLANS[plan], 1)
    return table, find_factors(record_factors(table))


@pytest.mark.parametrize("site", PRIORS)
def test_each_law_is_the_prior_s_own(site):
    law, prior = PRIORS[site].scipy(), PRIORS[site].distribution()
    at = law.ppf([0.001, 0.02, 0.3, 0.5, 0.8, 0.999])
    np.testing.assert_allclose(law.logpdf(at), prior.log_prob(at), rtol=1e-9, atol=1e-9)
    drawn = prior_draws((site,), DRAWS, seed=2)[site]
    # Shares below quantiles: a standard error of 0.0025 at most, 20 sites x 3 quantiles; 5 of them: 3e-5.
    for share in (0.1, 0.5, 0.9):
        assert np.mean(drawn < law.ppf(share)) == pytest.approx(share, abs=5 * 0.0025)


def test_scales_with_a_log_normal_prior_are_spread_on_their_logarithm():
    assert PRIORS["sigma_typical"].of_logarithm
    assert not PRIORS["sd_J"].of_logarithm
    assert not PRIORS["discordant_weight"].of_logarithm


def second_moment(site: str) -> float:
    return float(PRIORS[site].scipy().moment(2))


@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("parameter", ["k", "beta"])
def test_k_and_beta_scatter_as_far_as_the_hierarchy_adds_up_to(plan, parameter):
    _, factors = levels_of(plan)
    case = len(factors.cases) - 1
    sites = set(prior_sites(factors))
    log_values = np.log(prior_parameters(factors, case, DRAWS, seed=3)[parameter])
    location, spread = PRIORS[f"{parameter}_group"].parameters
    variance = spread**2
    for name, factor in factors.effects(parameter).items():
        weight = np.sum((factor.basis[factor.of_case[case]]) ** 2)
        variance += weight * second_moment(f"sd_log_{parameter}_{name}")
    if f"sd_log_{parameter}_case" in sites:
        variance += second_moment(f"sd_log_{parameter}_case")
    scatter = second_moment(f"sd_log_{parameter}_repeat")
    if f"sd_log_{parameter}_repeat_over_speeds" in sites:
        # E exp(2 s z) over z normal and s half-normal(t): E exp(2 s^2) = 1 / sqrt(1 - 4 t^2), infinite from t = 0.5 on.
        assert PRIORS[f"sd_log_{parameter}_repeat_over_speeds"].parameters[0] > 0.5
        middle = np.abs(log_values - location) < 3 * np.sqrt(variance)
        assert np.var(log_values[middle]) > 0.8 * variance
        return
    if "discordant_weight" in sites:
        scatter *= 1 + float(PRIORS["discordant_weight"].scipy().mean()) * (DISCORDANT_WIDENING**2 - 1)
    variance += scatter
    # Means: 5 standard errors. Variances: the tails are at most those of a scale mixture, kurtosis below 10.
    assert np.mean(log_values) == pytest.approx(location, abs=5 * np.sqrt(variance / DRAWS))
    assert np.var(log_values) == pytest.approx(variance, rel=5 * np.sqrt(9 / DRAWS))


def test_friction_goes_both_ways_and_noise_has_its_typical_size():
    _, factors = levels_of("one case")
    found = prior_parameters(factors, 0, DRAWS, seed=4)
    assert np.mean(found["J"] > 0) == pytest.approx(0.5, abs=5 * 0.0025)
    assert np.var(found["J"]) == pytest.approx(second_moment("sd_J"), rel=0.15)
    assert np.median(found["sigma"]) == pytest.approx(0.03, rel=0.05)


def test_records_are_equation_2_of_their_parameters_with_noise_on_every_point():
    _, factors = levels_of("one case")
    d = 12.0 + np.linspace(0.0, 3.0, 40)
    forces = prior_records(factors, 0, Start(20.0, 6.0, d), DRAWS, seed=5)
    assert forces.shape == (DRAWS, 40)
    of_record = {name: value[:, None] for name, value in prior_parameters(factors, 0, DRAWS, seed=5).items()}
    u = d - d[0]
    change = (of_record["J"] + of_record["k"] * u) * -np.expm1(-u / of_record["beta"])
    left = forces - change
    F_i = np.median(left, axis=1)
    assert np.mean(left[:, 0]) == pytest.approx(20.0, abs=5 * 6.5 / np.sqrt(DRAWS))
    assert np.std(F_i) == pytest.approx(6.0, rel=0.05)
    noise = (left - left.mean(axis=1, keepdims=True)) / of_record["sigma"]
    assert np.std(noise) == pytest.approx(np.sqrt(39 / 40), rel=0.01)
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1])) < 0.05


def test_records_go_the_way_of_their_displacement_and_the_seed_decides_them():
    _, factors = levels_of("one case")
    down = Start(20.0, 6.0, 12.0 - np.linspace(0.0, 3.0, 20))
    forces = prior_records(factors, 0, down, 2000, seed=6)
    assert np.median(forces[:, -1]) < 20.0 - 1.0
    np.testing.assert_array_equal(forces, prior_records(factors, 0, down, 2000, seed=6))
    assert not np.array_equal(forces, prior_records(factors, 0, down, 2000, seed=7))
