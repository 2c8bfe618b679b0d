"""Densities of draws: priors and likelihoods as SciPy and numpy write them down, whatever the displacement's factor."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.hand_made_posteriors import grid, posterior, scattered
from helpers.simulated_records import Plan, simulate
from scipy import stats

from bayes_tyre.inference.diagnostics import log_densities
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.inference.model.likelihood.compressed import compress
from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.inference.sampling.common_scales import POWERS, as_measured, with_scale
from bayes_tyre.record_table import record_factors

PLAN = Plan(configurations=("single",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), points=30)


@pytest.fixture(scope="module")
def made():
    """Return a batch of three records, their data, and draws about nothing in particular."""
    table, _ = simulate(PLAN, 1)
    factor_table = record_factors(table)
    batch = record_batch(table)
    return (
        batch,
        record_data(batch),
        posterior(scattered(factor_table, seed=3, chains=2, draws=15), factor_table),
        factor_table,
    )


def test_the_prior_is_that_of_the_top_level_on_the_scale_it_is_spread_on():
    factor_table = grid(("single",))
    tree = posterior(scattered(factor_table, seed=1), factor_table)
    draws = tree["posterior"].to_dataset()
    found = log_densities.log_prior(draws, prior_sites(find_factors(factor_table)))
    expected = stats.norm.logpdf(np.log(draws["k_group"].to_numpy()), 0.0, 1.0)
    np.testing.assert_allclose(found["k_group"], expected, rtol=1e-12)
    (scale,) = PRIORS["sd_J"].parameters
    np.testing.assert_allclose(found["sd_J"], stats.halfnorm.logpdf(draws["sd_J"], scale=scale), rtol=1e-12)
    # A case about its words and a record about its case are no priors.
    assert set(found.data_vars) == {
        *("k_group", "beta_group", "sd_log_k_case", "sd_log_beta_case", "sd_J", "sigma_typical")
    }


def test_the_likelihood_of_each_draw_is_the_normal_density_of_the_residuals(made):
    batch, data, tree, _ = made
    draws = tree["posterior"].to_dataset()
    found = log_densities.log_likelihood_of_records(draws, DirectLikelihood(data))["force"]
    assert found.dims == ("chain", "draw", "record")
    for record in range(3):
        points = batch.points[record]
        d, F = batch.displacement_mm[record, :points], batch.force_kN[record, :points]
        u = d - d[0]
        for chain, draw in ((0, 0), (1, 14)):
            one = {n: float(draws[n][chain, draw, record]) for n in ("k", "beta", "J", "F_i", "sigma")}
            mean = one["F_i"] + (one["J"] + one["k"] * u) * (1 - np.exp(-np.abs(u) / one["beta"]))
            expected = stats.norm.logpdf(F, mean, one["sigma"]).sum()
            assert float(found[chain, draw, record]) == pytest.approx(expected, rel=1e-9)


def test_draws_taken_a_few_at_a_time_give_the_same_and_so_does_the_compressed_likelihood(made, monkeypatch):
    _, data, tree, _ = made
    draws = tree["posterior"].to_dataset()
    whole = log_densities.log_likelihood_of_records(draws, DirectLikelihood(data))["force"]
    monkeypatch.setattr(log_densities, "_TOGETHER", 7 * data.u.size)  # 30 draws are no multiple of 7
    np.testing.assert_allclose(
        log_densities.log_likelihood_of_records(draws, DirectLikelihood(data))["force"], whole, rtol=1e-12
    )
    compressed = log_densities.log_likelihood_of_records(draws, compress(data))["force"]
    np.testing.assert_allclose(compressed, whole, rtol=1e-6)


@pytest.mark.parametrize("factor", POWERS)
def test_a_common_factor_changes_no_density(made, factor):
    _, data, tree, factor_table = made
    sites = prior_sites(find_factors(factor_table))
    plain, scaled = (each["posterior"].to_dataset() for each in (tree, with_scale(tree, factor, 0.05, seed=1)))
    assert float(np.abs(scaled["k"] / plain["k"] - 1.0).max()) > 0.05
    for name in ("k", "beta_case", "k_group", "F_i", "sigma", "sigma_typical"):
        np.testing.assert_allclose(as_measured(scaled)[name], plain[name], rtol=1e-12)
    for one, other in (
        (log_densities.log_prior(scaled, sites, data), log_densities.log_prior(plain, sites, data)),
        *[[log_densities.log_likelihood_of_records(each, DirectLikelihood(data)) for each in (scaled, plain)]],
    ):
        for name in other.data_vars:
            np.testing.assert_allclose(one[name], other[name], rtol=1e-8)


def test_the_first_force_has_its_prior_from_the_record(made):
    _, data, tree, _ = made
    draws = tree["posterior"].to_dataset()
    found = log_densities.log_prior(draws, (), data)
    expected = stats.norm.logpdf(draws["F_i"], np.asarray(data.F_0), np.asarray(data.span)).sum(axis=2)
    np.testing.assert_allclose(found["F_i"], expected, rtol=1e-12)
    assert jnp.all(data.span > 0)


def test_printed_means_have_a_students_density_about_their_case_as_wide_as_at_their_speed():
    factor_table = grid(("single",), repeats=1).drop(columns=["record", "repeat"])
    rng, shape = np.random.default_rng(5), (2, 10)
    draws = {
        "k_case": 1.8 * np.exp(0.1 * rng.normal(size=(*shape, 4))),
        "beta_case": 0.03 * np.exp(0.1 * rng.normal(size=(*shape, 4))),
        "sd_log_k_published": 0.1 * np.exp(0.2 * rng.normal(size=shape)),
        "sd_log_k_published_by_speed": 0.1 * np.exp(0.2 * rng.normal(size=(*shape, 2))),
        "sd_log_beta_published": 0.3 * np.exp(0.2 * rng.normal(size=shape)),
        "student_nu": 8.0 * np.exp(0.2 * rng.normal(size=shape)),
    }
    printed = {"k": np.array([1.5, 1.7, 1.9, 2.2]), "beta": np.array([0.02, 0.03, 0.04, 0.05])}
    found = log_densities.log_likelihood_of_print(posterior(draws, factor_table)["posterior"].to_dataset(), printed)
    one = {name: values[1, 3] for name, values in draws.items()}
    speeds = factor_table["speed_km_h"].to_numpy()
    for case in range(4):
        widths = {"k": one["sd_log_k_published_by_speed"][int(speeds[case] > 0)], "beta": one["sd_log_beta_published"]}
        for name, width in widths.items():
            value = printed[name][case]
            off = np.log(value / one[f"{name}_case"][case])
            expected = stats.t.logpdf(off / width, one["student_nu"]) - np.log(width * value)
            assert float(found[f"printed_{name}"][1, 3, case]) == pytest.approx(expected, rel=1e-9)
