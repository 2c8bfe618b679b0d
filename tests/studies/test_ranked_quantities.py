"""Log densities and ratios are what the model says of truths, and the same of draws as of truths."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.quick_design import quick_design
from scipy.linalg import toeplitz
from scipy.stats import beta, halfnorm, norm, t

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING, PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.inference.model.repeat_distribution import MixtureAbout
from bayes_tyre.studies.design import calibration_design
from bayes_tyre.studies.ranked_quantities import (
    OF_RECORD,
    Hierarchy,
    configuration_ratios,
    discordance_probability,
    log_likelihood_of_records,
    log_prior,
    log_repeats,
    with_derived,
)
from bayes_tyre.studies.truths import Truths, draw_truths, noiseless_forces, study_priors


@pytest.mark.parametrize("noise", ["iid", "ar1"])
def test_the_log_likelihood_of_truths_is_that_of_their_noise(noise):
    """Against a normal with the covariance written down."""
    design = quick_design()
    truths, force = draw_truths(design, 3, 0, study_priors(), noise=noise)
    found, points = log_likelihood_of_records(design, truths, force), design.u.shape[1]
    residual = force - noiseless_forces(design, truths)
    rho = truths.get("rho", np.zeros(found.shape))
    for place in np.ndindex(found.shape):
        covariance = truths["sigma"][place] ** 2 * toeplitz(rho[place] ** np.arange(points))
        square = residual[place] @ np.linalg.solve(covariance, residual[place])
        log_volume = np.linalg.slogdet(2.0 * np.pi * covariance)[1]
        assert found[place] == pytest.approx(-0.5 * (square + log_volume))


def test_the_log_likelihood_of_truths_with_heavy_tailed_noise_is_that_of_a_t_at_every_point():
    design = quick_design()
    truths, force = draw_truths(design, 2, 0, study_priors(), noise="student")
    found, residual = log_likelihood_of_records(design, truths, force), force - noiseless_forces(design, truths)
    for i, record in np.ndindex(found.shape):
        density = t.logpdf(residual[i, record], truths["noise_nu"][i], scale=truths["sigma"][i, record])
        assert found[i, record] == pytest.approx(np.sum(density))


def repeats(truths: Truths, i: int) -> tuple[MixtureAbout, np.ndarray]:
    """Return the model's distribution of the records of one set, and where they are."""
    factors, both = quick_design().factors, ("k", "beta")
    case = factors.of_record
    records = np.stack([np.log(truths[name][i]) for name in both], axis=1)
    cases = np.stack([np.log(truths[f"{name}_case"][i][case]) for name in both], axis=1)
    by_speed = [truths[f"sd_log_{name}_repeat_by_speed"][i][factors.speed.of_case[case]] for name in both]
    weight = jnp.asarray(truths["discordant_weight"][i])
    return MixtureAbout(
        jnp.asarray(cases), jnp.asarray(np.stack(by_speed, axis=1)), weight, DISCORDANT_WIDENING
    ), records


def test_the_density_of_repeats_at_truths_is_that_of_the_model():
    design = quick_design()
    truths, _ = draw_truths(design, 3, 0, study_priors())
    hierarchy = Hierarchy(design.factors, study_priors(), prior_sites(design.factors))
    density, probability = log_repeats(hierarchy, truths), discordance_probability(hierarchy, truths)
    for i in range(3):
        about, records = repeats(truths, i)
        np.testing.assert_allclose(density[i], jnp.sum(about.log_prob(jnp.asarray(records))), rtol=1e-9)
        np.testing.assert_allclose(probability[i], about.probability(jnp.asarray(records)), rtol=1e-8)


def test_the_log_prior_is_the_density_of_every_hyperparameter():
    design = quick_design()
    truths, _ = draw_truths(design, 1, 0, PRIORS, noise="ar1")
    sites = prior_sites(design.factors, noise="ar1")
    assert {"k_group", "J_group", "sd_J", "sigma_typical", "atanh_rho_typical", "discordant_weight"} <= set(sites)
    expected = 0.0
    for name in sites:
        of, family = PRIORS[name].parameters, PRIORS[name].family.__name__
        for value in np.ravel(truths[name]):
            if family == "LogNormal":
                expected += float(norm.logpdf(np.log(value), *of))
            elif family == "HalfNormal":
                expected += float(halfnorm.logpdf(value, scale=of[0]))
            else:
                expected += float({"Beta": beta, "Normal": norm}[family].logpdf(value, *of))
    np.testing.assert_allclose(log_prior(sites, truths, PRIORS), [expected])


def test_ratios_are_of_two_configurations_over_the_cases_that_match():
    design = calibration_design()
    truths, _ = draw_truths(design, 2, 0, study_priors())
    k = dict(zip(map(tuple, design.factors.cases), truths["k_case"][1], strict=True))
    pairs = [(k[case], k["single", *case[1:]]) for case in k if case[0] == "dual"]
    assert len(pairs) == 2
    expected = np.sqrt(np.prod([dual / single for dual, single in pairs]))
    assert configuration_ratios(design.factors, truths)["k_ratio"][1] == pytest.approx(expected)
    assert configuration_ratios(quick_design().factors, truths) == {}
    of_case = design.factor_table["configuration"] + design.factor_table["direction"]
    three = find_factors(design.factor_table.assign(configuration=of_case))
    assert configuration_ratios(three, truths) == {}


def test_draws_of_many_sets_are_weighed_as_truths_are():
    design, priors = calibration_design(), study_priors()
    hierarchy = Hierarchy(design.factors, priors, prior_sites(design.factors))
    truths, force = draw_truths(design, 4, 1, priors)
    draws = {name: np.stack([values, values], axis=1) for name, values in truths.items()}
    of_truths = with_derived(hierarchy, truths, log_likelihood_of_records(design, truths, force))
    of_draws = with_derived(hierarchy, draws, log_likelihood_of_records(design, draws, force[:, None]))
    derived = {OF_RECORD, "log_likelihood", "log_prior", "log_repeats", "k_ratio", "beta_ratio"}
    assert set(of_draws) == set(of_truths) == set(truths) | derived
    for name in derived:
        np.testing.assert_allclose(of_draws[name][:, 1], of_truths[name])
    np.testing.assert_allclose(of_truths["log_likelihood"], of_truths[OF_RECORD].sum(axis=1))
