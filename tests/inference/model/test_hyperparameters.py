"""The top of the hierarchy: each prior has its own density though families are sampled together, and all are used."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
import pytest
from helpers.simulated_records import Plan, simulate
from numpyro.handlers import seed, substitute, trace
from numpyro.infer.util import log_density

from bayes_tyre.inference.model import models
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import (
    apart_weight,
    by_family,
    prior_sites,
    published_sites,
    sample_hyperparameters,
    standard_normals,
    unused_priors,
)
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.inference.model.priors import Priors
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.record_table import record_factors

PLANS = {
    "all that varies": Plan(configurations=("single",), steps=(-10.0, -5.0, 5.0, 10.0), points=20),
    "one record": Plan(configurations=("a",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), repeats=1, points=30),
}


def at_the_top(sites: tuple[str, ...]) -> set[str]:
    """Return those sampled by family; cells and typical noise levels are placed where what they rule is."""
    return {site for site in sites if not site.endswith(("_group", "_typical"))}


def levels_of(plan: str) -> Factors:
    return find_factors(record_factors(simulate(PLANS[plan], 1)[0]))


@pytest.mark.slow  # compiles the gradients of three models
def test_the_models_use_every_prior_that_they_sample():
    """A hyperparameter that nothing used would leave the density of all below it as it is."""
    for plan in PLANS:
        table, _ = simulate(PLANS[plan], 1)
        data, factors = record_data(record_batch(table)), levels_of(plan)
        sites = prior_sites(factors)
        assert len(sites) == len(set(sites))
        _all_matter(lambda: models.records_model(data, factors), sites)  # noqa: B023  (called at once)
    table, _ = simulate(PLANS["all that varies"], 1)
    factors = find_factors(table[list(CASE_FACTORS)].drop_duplicates())
    printed = {"k": np.full(len(factors.cases), 1.8), "beta": np.full(len(factors.cases), 0.03)}
    _all_matter(lambda: models.published_model(printed, factors), published_sites(factors))


def _all_matter(model, sites: tuple[str, ...]) -> None:
    values = {name: site["value"] for name, site in trace(seed(model, 0)).get_trace().items() if drawn(site)}
    at_top = set(by_family(sites, PRIORS))
    assert at_top <= set(values)

    @jax.jit
    @jax.grad
    def slope(hyperparameters: dict) -> jax.Array:
        _, sites = log_density(model, (), {}, {**values, **hyperparameters})
        below = [site for name, site in sites.items() if site["type"] == "sample" and name not in at_top]
        return sum((jnp.sum(site["fn"].log_prob(site["value"])) for site in below), jnp.zeros(()))

    for name, of_site in slope({name: values[name] for name in at_top}).items():
        assert np.all(np.asarray(of_site) != 0.0), name


def drawn(site: dict) -> bool:
    return site["type"] == "sample" and not site["is_observed"]


def test_priors_of_a_family_are_sampled_together_each_with_its_own_density():
    sites = prior_sites(levels_of("all that varies"), noise="ar1")
    starts = medians_by_site(sites, PRIORS)
    model = substitute(seed(lambda: sample_hyperparameters(sites), 0), data=starts)
    found = trace(model).get_trace()
    together = sum(np.sum(site["fn"].log_prob(site["value"])) for name, site in found.items() if name in starts)
    own = [jnp.asarray(PRIORS[name].distribution().log_prob(PRIORS.medians()[name])) for name in at_the_top(sites)]
    assert float(together) == pytest.approx(float(sum(own)), abs=1e-9)
    for name in at_the_top(sites):
        assert float(found[name]["value"]) == pytest.approx(float(PRIORS.medians()[name]))


def medians_by_site(sites: tuple[str, ...], priors: Priors) -> dict[str, jax.Array]:
    medians = priors.medians()
    return {site: jnp.stack([medians[name] for name in names]) for site, names in by_family(sites, priors).items()}


@pytest.mark.parametrize(
    ("plan", "share"),
    [
        (Plan(), 0.05),
        (Plan(repeats=2), 0.05),
        (Plan(repeats=1), 0.0),  # apart, or its one repeat discordant: nobody knows
        (Plan(configurations=("a",), speeds=(0.0,), steps=(10.0,)), 0.0),  # two cases that their loads explain
        (Plan(configurations=("a",)), 0.0),  # few cases more than the effects can fit: which is it?
    ],
)
def test_cases_stand_apart_where_the_data_can_tell_one_that_does(plan, share):
    factors = find_factors(record_factors(simulate(plan, 1)[0]))
    assert apart_weight(factors, ("k", "beta"), PRIORS) == share
    assert apart_weight(factors, ("k", "beta"), PRIORS.changed({"apart_weight": 0.0})) == 0.0


def test_priors_of_quantities_that_a_model_does_not_have_are_named():
    changes = {"m_group": {"median": 300.0, "sd_log": 0.1}, "k_group": {"median": 2.0, "sd_log": 0.1}}
    changed = PRIORS.changed({**changes, "apart_weight": 0.1})
    assert unused_priors(changed, ["k_group", "beta_group"]) == ["m_group"]
    assert unused_priors(PRIORS, []) == []


def test_normals_to_draw_by_are_there_where_a_draw_is_wanted():
    def model() -> None:
        numpyro.deterministic("z", jnp.nan if (z := standard_normals("z_drawn", (2, 3))) is None else z)

    def value(of_model: Callable[[], Any]) -> np.ndarray:
        return np.asarray(trace(of_model).get_trace()["z"]["value"])

    assert np.isnan(value(model))
    assert value(seed(model, 0)).shape == (2, 3)
    given = jnp.arange(6.0).reshape(2, 3)
    np.testing.assert_array_equal(value(substitute(model, data={"z_drawn": given})), given)
    # A density counts nothing for them, given or not.
    for of_model in (model, substitute(model, data={"z_drawn": given})):
        assert float(log_density(of_model, (), {}, {})[0]) == 0.0
