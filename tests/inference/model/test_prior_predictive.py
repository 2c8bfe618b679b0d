"""Draws of the priors alone: what the documentation says of each level, in numbers worked out by hand."""

from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.simulated_records import Plan, simulate

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING, PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.inference.model.models import records_model
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.inference.model.prior_predictive import PriorDraws, draw_prior, prior_forces, without_points
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.inference.sampling.datatree import QUANTITIES
from bayes_tyre.record_table import record_factors

DRAWS = 40_000
PLANS = {
    "all that varies": Plan(configurations=("single",), steps=(-10.0, -5.0, 5.0, 10.0), points=20),
    "two repeats": Plan(configurations=("single",), repeats=2, points=30),
    "one case": Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=30),
    "one record": Plan(configurations=("a",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), repeats=1, points=30),
}


@cache
def drawn(plan: str, noise: str = "iid") -> tuple[PriorDraws, Factors]:
    table, _ = simulate(PLANS[plan], 1)
    data, factors = without_points(record_data(record_batch(table))), find_factors(record_factors(table))
    start = data._replace(F_0=jnp.full(len(table["record"].unique()), 20.0), span=jnp.full_like(data.span, 6.0))
    arguments = {"data": start, "factors": factors, "noise": noise, "observed": False}
    return draw_prior(records_model, arguments, QUANTITIES, DRAWS, seed=3), factors


@pytest.mark.parametrize("site", PRIORS)
def test_scipy_s_distribution_is_that_of_numpyro(site):
    of_scipy, prior = PRIORS[site].scipy(), PRIORS[site].distribution()
    at = of_scipy.ppf([0.001, 0.02, 0.3, 0.5, 0.8, 0.999])
    np.testing.assert_allclose(of_scipy.logpdf(at), prior.log_prob(at), rtol=1e-9, atol=1e-9)


def test_hyperparameters_are_drawn_from_their_priors():
    draws, factors = drawn("all that varies")
    # Shares below quantiles: a standard error of 0.0025 at most, 30 sites x 3 quantiles; 5 of them: 5e-5.
    for site in prior_sites(factors):
        values = draws[site].reshape(DRAWS, -1)[:, 0]
        for share in (0.1, 0.5, 0.9):
            assert np.mean(values < PRIORS[site].scipy().ppf(share)) == pytest.approx(share, abs=5 * 0.0025)


def test_scales_with_a_log_normal_prior_are_spread_on_their_logarithm():
    assert PRIORS["sigma_typical"].of_logarithm
    assert not PRIORS["sd_J"].of_logarithm
    assert not PRIORS["discordant_weight"].of_logarithm


def second_moment(site: str) -> float:
    return float(PRIORS[site].scipy().moment(2))


@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("parameter", ["k", "beta"])
def test_k_and_beta_scatter_as_far_as_the_hierarchy_adds_up_to(plan, parameter):
    draws, factors = drawn(plan)
    case, sites = len(factors.cases) - 1, set(prior_sites(factors))
    log_values = np.log(draws[parameter][:, int(np.flatnonzero(factors.of_record == case)[0])])
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
    draws, _ = drawn("one case")
    assert np.mean(draws["J"][:, 0] > 0) == pytest.approx(0.5, abs=5 * 0.0025)
    assert np.var(draws["J"][:, 0]) == pytest.approx(second_moment("sd_J") + second_moment("J_group"), rel=0.15)
    assert np.median(draws["sigma"][:, 0]) == pytest.approx(0.03, rel=0.05)


@pytest.mark.parametrize("noise", ["iid", "ar1"])
def test_records_are_equation_2_of_their_parameters_with_noise_on_every_point(noise):
    draws, _ = drawn("one case", noise)
    d = 12.0 + np.linspace(0.0, 3.0, 40)
    forces = prior_forces(draws, 1, d, seed=5)
    assert forces.shape == (DRAWS, 40)
    F_i, J, k, beta, sigma = (draws[name][:, 1, None] for name in ("F_i", "J", "k", "beta", "sigma"))
    u = d - d[0]
    assert np.mean(F_i) == pytest.approx(20.0, abs=5 * 6.0 / np.sqrt(DRAWS))
    assert np.std(F_i) == pytest.approx(6.0, rel=0.05)
    z = (forces - F_i + (J + k * u) * np.expm1(-u / beta)) / sigma
    rho = draws["rho"][:, 1, None] if noise == "ar1" else 0.0
    new = (z[:, 1:] - rho * z[:, :-1]) / np.sqrt(1.0 - rho**2)
    for values in (z[:, 0], new):
        # Of 40,000 values: standard errors of 0.5 % and 0.35 %; what is new in each point has less than that.
        assert np.mean(values) == pytest.approx(0.0, abs=0.025)
        assert np.std(values) == pytest.approx(1.0, rel=0.02)
    assert abs(np.mean(new[:, 1:] * new[:, :-1])) < 0.01


def test_records_go_the_way_of_their_displacement_and_the_seed_decides_them():
    draws, _ = drawn("one case")
    down = 12.0 - np.linspace(0.0, 3.0, 20)
    forces = prior_forces(draws, 0, down, seed=6)
    assert np.median(forces[:, -1]) < 20.0 - 1.0
    np.testing.assert_array_equal(forces, prior_forces(draws, 0, down, seed=6))
    assert not np.array_equal(forces, prior_forces(draws, 0, down, seed=7))
