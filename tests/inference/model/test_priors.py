"""Each prior allows what its reason says."""

import re

import jax
import numpy as np
import numpyro.distributions as dist
import pytest

from bayes_tyre.inference.model.default_priors import PRIORS

STATED = {
    name: [float(figure) for figure in found.groups()]
    for name, prior in PRIORS.items()
    if prior.family is dist.LogNormal and (found := re.match(r"([\d.]+) to ([\d.]+)", prior.reason))
}


def test_every_log_normal_prior_states_its_range():
    assert set(STATED) == {name for name, prior in PRIORS.items() if prior.family is dist.LogNormal}


@pytest.mark.parametrize("name", sorted(STATED))
def test_95_per_cent_of_a_prior_lies_in_the_range_that_its_reason_states(name):
    prior = PRIORS[name]
    low, high = (float(prior.distribution().icdf(q)) for q in (0.025, 0.975))
    per = 100.0 if "%" in prior.reason.split(":")[0].split(";")[0] else 1.0
    assert [per * low, per * high] == pytest.approx(STATED[name], rel=0.06)


def test_the_weight_of_discordant_repeats_is_as_its_reason_states():
    draws = np.asarray(PRIORS["discordant_weight"].distribution().sample(jax.random.key(0), (100_000,)))
    assert draws.mean() == pytest.approx(0.05, abs=0.001)
    assert np.mean(draws < 0.15) == pytest.approx(0.95, abs=0.005)


def test_the_share_of_cases_that_stand_apart_is_the_mean_of_that_of_discordant_repeats():
    """As its reason states: one of 20; and they are wider than usual cases, or they would be no others."""
    assert PRIORS.apart_weight == pytest.approx(PRIORS["discordant_weight"].scipy().mean())
    assert PRIORS.apart_widening > 1.0


def test_starts_are_near_the_middle_of_each_prior_and_positive_where_it_is():
    for name, start in PRIORS.medians().items():
        below = np.asarray(PRIORS[name].distribution().sample(jax.random.key(1), (4000,)) < start).mean()
        # Of 4000 draws a share of 0.5 has a standard deviation of 0.008; 0.05 is over six of them.
        assert abs(below - 0.5) < 0.05, name
        assert start > 0.0 or PRIORS[name].family is dist.Normal, name
