"""The top of the hierarchy: each prior has its own density though families are sampled together, and all are used."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.simulated_records import Plan, simulate
from numpyro.handlers import seed, substitute, trace
from numpyro.infer.initialization import init_to_uniform
from scipy import stats

from bayes_tyre.inference.model import models
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.half_normal import HalfNormal
from bayes_tyre.inference.model.hyperparameters import (
    hyperparameter_starts,
    prior_sites,
    published_sites,
    sample_hyperparameters,
)
from bayes_tyre.inference.model.coordinates.laplace import laplace_approximation
from bayes_tyre.inference.model.likelihood import compress
from bayes_tyre.inference.model.coordinates.reparameterisation import Gaussian
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.inference.sampling.hierarchical_fit import record_batch
from bayes_tyre.record import CASE_FACTORS
from bayes_tyre.record_table import record_factors

PLANS = {
    "all that varies": Plan(configurations=("single",), steps=(-10.0, -5.0, 5.0, 10.0), points=20),
    "one record": Plan(configurations=("a",), speeds=(0.0,), loads=(20.0,), steps=(10.0,), repeats=1, points=30),
}


class Used(dict):
    """Remembers what was asked of it."""

    def __init__(self, values):
        super().__init__(values)
        self.names = set()

    def __getitem__(self, name):
        self.names.add(name)
        return super().__getitem__(name)


def bare(model):
    return substitute(seed(model, 0), substitute_fn=init_to_uniform)


def at_the_top(sites: tuple[str, ...]) -> set[str]:
    """Return those sampled by family; cells and typical noise levels are placed where what they rule is."""
    return {site for site in sites if not site.endswith(("_group", "_typical"))}


def levels_of(plan: str) -> Factors:
    return find_factors(record_factors(simulate(PLANS[plan], 1)[0]))


@pytest.fixture
def used(monkeypatch) -> list[Used]:
    made = []

    def watched(sites, priors):
        made.append(Used(sample_hyperparameters(sites, priors)))
        return made[-1]

    monkeypatch.setattr(models, "sample_hyperparameters", watched)
    return made


@pytest.mark.slow  # compiles least squares, for the picture that the model's coordinates follow
@pytest.mark.parametrize("plan", PLANS)
def test_the_model_of_records_uses_every_prior_that_it_samples(plan, used):
    table, _ = simulate(PLANS[plan], 1)
    batch, factors = record_batch(table), levels_of(plan)
    data, approximation = record_data(batch), laplace_approximation(batch, factors)
    model, likelihood = bare(models.records_model), compress(data)
    sites = trace(model).get_trace(likelihood, data, approximation, factors)
    assert used[-1].names == set(used[-1]) == at_the_top(prior_sites(factors))
    assert set(prior_sites(factors)) <= set(sites)
    assert len(prior_sites(factors)) == len(set(prior_sites(factors)))


def test_the_model_of_printed_means_uses_every_prior_that_it_samples(used):
    table, _ = simulate(PLANS["all that varies"], 1)
    factors = find_factors(table[list(CASE_FACTORS)].drop_duplicates())
    printed = {"k": np.full(len(factors.cases), 1.8), "beta": np.full(len(factors.cases), 0.03)}
    model = bare(models.published_model)
    jax.eval_shape(lambda: model(printed, factors) or 0)
    assert used[-1].names == set(used[-1]) == at_the_top(published_sites(factors))


def test_priors_of_a_family_are_sampled_together_each_with_its_own_density():
    sites = prior_sites(levels_of("all that varies"), noise="ar1")
    starts = hyperparameter_starts(sites, PRIORS.medians())
    model = substitute(seed(lambda: sample_hyperparameters(sites), 0), data=jax.tree.map(jnp.asarray, starts))
    found = trace(model).get_trace()
    together = sum(np.sum(site["fn"].log_prob(site["value"])) for name, site in found.items() if name in starts)
    own = [jnp.asarray(PRIORS[name].distribution().log_prob(PRIORS.medians()[name])) for name in at_the_top(sites)]
    assert float(together) == pytest.approx(float(sum(own)), abs=1e-9)
    for name in at_the_top(sites):
        assert float(found[name]["value"]) == pytest.approx(float(PRIORS.medians()[name]))
    assert isinstance(found["populations_HalfNormal"]["fn"], HalfNormal)  # in coordinates without a wall


@pytest.mark.parametrize(("records", "spread"), [(1, 0.0), (5, 0.4)])
def test_a_typical_noise_level_has_its_prior_and_records_scatter_about_it(records, spread):
    value = jnp.log(jnp.linspace(0.02, 0.05, records))
    estimate = Gaussian(value, jnp.full(records, 60.0))
    model = bare(lambda: models._about_typical("sigma_typical", estimate, "s", {"s": jnp.asarray(spread)}, PRIORS))
    names = ("sigma_typical", *["sigma_typical_records"] * (records > 1))

    def placed(z: dict) -> jax.Array:
        each, typical = substitute(model, data=z)()  # pyright: ignore[reportGeneralTypeIssues]  (what the model returns)
        return each if records == 1 else jnp.concatenate([jnp.reshape(typical, (1,)), each])

    z = {f"{name}_z": jnp.full(1 if name == "sigma_typical" else records, 0.3) for name in names}
    volume = np.concatenate(list(jax.jacobian(placed)(z).values()), axis=1)
    there = np.asarray(placed(z))
    expected = stats.norm.logpdf(there[0], *PRIORS["sigma_typical"].parameters)
    if records > 1:
        expected += stats.norm.logpdf(there[1:], there[0], spread).sum()
    expected += np.log(np.abs(np.linalg.det(volume)))
    sites = trace(substitute(model, data=z)).get_trace()
    density = sum(np.sum(sites[f"{name}_density"]["fn"].log_factor) for name in names)
    assert float(density) == pytest.approx(float(expected), rel=1e-9)
