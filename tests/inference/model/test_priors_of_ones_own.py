"""Priors as an argument: read, refused in words that name the key, and used wherever a prior is."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.simulated_records import Plan, simulate
from numpyro import distributions as dist
from numpyro.handlers import seed, substitute, trace
from scipy import stats

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import by_family, prior_sites, sample_hyperparameters
from bayes_tyre.inference.model.models import records_model
from bayes_tyre.inference.model.prior_predictive import PriorDraws, draw_prior
from bayes_tyre.inference.model.priors import FAMILIES, Prior, Priors
from bayes_tyre.inference.model.terms import find_terms
from bayes_tyre.inference.record_data import RecordData
from bayes_tyre.record_table import record_factors

OWN = PRIORS.changed(
    {
        "k_group": {"median": 1.8, "sd_log": 0.3},
        "sd_J": {"family": "log_normal", "median": 3.0, "sd_log": 0.2},
        "discordant_weight": Prior(dist.Beta, (2.0, 5.0)),
        "discordant_widening": 9,
        "apart_weight": 0,
    }
)


@pytest.fixture(scope="module")
def factors():
    return find_factors(record_factors(simulate(Plan(), seed=0)[0]))


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_a_family_has_one_distribution_in_numpyro_and_scipy_and_comes_back_as_it_was_given(family):
    given = dict(zip(family.parameters, (0.7, 0.3), strict=False))
    prior = Prior(family.distribution, family.to_numpyro(*given.values()))
    assert prior.given() == {"family": family.name, **given}
    at = np.array([0.1, 0.4, 0.9])
    np.testing.assert_allclose(prior.distribution().log_prob(jnp.asarray(at)), prior.scipy().logpdf(at), rtol=1e-12)


def test_what_is_given_comes_back_to_the_bit():
    assert PRIORS.changed(json.loads(PRIORS.to_json())).changes_from(PRIORS) == {}
    again = PRIORS.changed(json.loads(OWN.to_json()))
    assert {name: prior.parameters for name, prior in again.items()} == {n: p.parameters for n, p in OWN.items()}
    assert (again.discordant_widening, again.apart_weight) == (9.0, 0.0)
    assert set(OWN.changes_from(PRIORS)) == {
        "k_group",
        "sd_J",
        "discordant_weight",
        "discordant_widening",
        "apart_weight",
    }
    assert OWN["k_group"].unit == "kN/mm"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"k_groupp": {}}, "priors, k_groupp: there is no such quantity; did you mean k_group"),
        ({"?": {}}, "priors, ?: there is no such quantity; there are k_group, "),
        ({"k_group": 1.8}, "priors, k_group: 1.8 is no prior; give its parameters, such as { median = 1, sd_log = 1 }"),
        ({"k_group": {"median": 1.8}}, "priors, k_group, sd_log: a log_normal prior has median and sd_log"),
        ({"k_group": {"median": 1.8, "sd_log": -1}}, "priors, k_group, sd_log: -1 is not above 0"),
        ({"k_group": {"median": "much", "sd_log": 1}}, "priors, k_group, median: 'much' is not a finite number"),
        ({"k_group": {"family": "half_normal", "scale": 1}}, "priors, k_group, family: must be log_normal"),
        ({"sd_J": {"family": "cauchy", "scale": 1}}, "priors, sd_J, family: 'cauchy' is unknown; use log_normal,"),
        ({"sd_J": Prior(dist.Beta, (1.0, 1.0))}, "priors, sd_J, family: must be log_normal or half_normal"),
        ({"discordant_widening": 1}, "priors, discordant_widening: 1 does not widen; give a number above 1"),
        ({"apart_widening": 0.5}, "priors, apart_widening: 0.5 does not widen; give a number above 1"),
        ({"apart_weight": 1}, "priors, apart_weight: 1 is no share; give a number from 0 to below 1"),
        ({"discordant_widening": True}, "priors, discordant_widening: True is not a finite number"),
    ],
)
def test_what_cannot_be_is_refused_by_its_key(changes, said):
    with pytest.raises(BadInput) as refused:
        PRIORS.changed(changes)
    assert str(refused.value).startswith(said)


def test_the_models_density_changes_by_the_ratio_of_the_priors(factors):
    values = PRIORS.medians()

    def density(priors) -> float:
        by_site = by_family(prior_sites(factors), priors).items()
        data = {site: jnp.stack([values[name] for name in names]) for site, names in by_site}
        model = substitute(lambda: sample_hyperparameters(prior_sites(factors), priors), data)
        sites = [site for site in trace(seed(model, 0)).get_trace().values() if site["type"] == "sample"]
        return sum(float(np.sum(site["fn"].log_prob(site["value"]))) for site in sites)

    sd_J, weight = values["sd_J"], values["discordant_weight"]
    (usual,) = PRIORS["sd_J"].parameters
    expected = stats.lognorm.logpdf(sd_J, 0.2, scale=3.0) - stats.halfnorm.logpdf(sd_J, scale=usual)
    expected += stats.beta.logpdf(weight, 2, 5) - stats.beta.logpdf(weight, 1, 19)
    assert density(OWN) - density(PRIORS) == pytest.approx(expected, abs=1e-9)
    # Group means are normal on the logarithm, in coordinates of their own.
    terms = find_terms(factors, ("k", "beta"), OWN)
    groups = len(factors.group.labels)
    np.testing.assert_allclose(terms.mean[:groups], np.log(1.8))
    np.testing.assert_allclose(terms.fixed[:groups], 0.3)


@pytest.mark.slow  # compiles the model run forwards four times
def test_draws_of_the_prior_follow_it(factors):
    draws, names = 4000, ("k_group", "sd_J", "k", "k_case")
    starts = jnp.zeros(len(factors.of_record))
    none = jnp.zeros((len(starts), 0))
    data = RecordData(none, none, none > 0, starts, starts, starts + 5.0)

    def drawn(priors: Priors) -> PriorDraws:
        arguments = {"data": data, "factors": factors, "priors": priors, "observed": False}
        return draw_prior(records_model, arguments, names, draws, seed=1)

    own = drawn(OWN)
    # Means of logarithms of 4000 draws: standard errors 0.0047 and 0.0032; beyond 5 of them 6e-7 of seeds each.
    assert np.mean(np.log(own["k_group"][:, 0])) == pytest.approx(np.log(1.8), abs=0.0237)
    assert np.mean(np.log(own["sd_J"])) == pytest.approx(np.log(3.0), abs=0.0158)
    narrow = {
        "sd_log_k_repeat": {"median": 0.02, "sd_log": 0.1},
        "sd_log_k_repeat_over_speeds": {"scale": 0.01},
        "discordant_weight": {"a": 200.0, "b": 2.0},
    }

    def spread(widening: float) -> float:
        values = drawn(PRIORS.changed(narrow | {"discordant_widening": widening}))
        return float(np.std(np.log(values["k"] / values["k_case"][:, factors.of_record])))

    assert spread(40.0) / spread(2.0) == pytest.approx(20.0, rel=0.1)
