"""Cases with their repeats summed out: SciPy's normals of all repeats together, choice by choice."""

import arviz as az
import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from helpers.means_agree import assert_means_agree
from helpers.repeats_by_hand import PARAMETERS, Numbers, by_hand, some_numbers
from helpers.simulated_records import Plan, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from numpyro import handlers
from numpyro.infer.util import constrain_fn
from scipy import stats

from bayes_tyre.inference.model import marginal_mixture
from bayes_tyre.inference.model.case_effects import CaseDistribution
from bayes_tyre.inference.model.coordinates.laplace import laplace_approximation
from bayes_tyre.inference.model.coordinates.sites import record_starts, records_in_coordinates
from bayes_tyre.inference.model.default_priors import APART_WIDENING, DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.marginal_mixture import (
    ChoicePosterior,
    RepeatsOfCases,
    apart_probability,
    choice_number,
    draw_cases,
    find_members,
    outlier_probability,
)
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling import hierarchical_fit as fit
from bayes_tyre.inference.sampling.chunks import draw_keys, named_normals
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.run import SamplerSettings
from bayes_tyre.record_table import check_record_table

EIGHT_CASES = Plan(("x",), (0.0, 25.0), (20.0, 30.0), (-5.0, 5.0), discordant=("x (0)20-25(2)",))
MODEL, SAMPLING = ModelSettings(), SamplerSettings(warmup=500, draws=1000, seed=1, target_accept=0.65)


def levels_of(*repeats: int) -> Factors:
    """Return cases with so many repeats each, their records in no order."""
    cases = np.random.default_rng(0).permutation(np.repeat(np.arange(len(repeats)), repeats))
    return find_factors(pd.DataFrame({"configuration": [f"case {case}" for case in cases]}))


def offset_of(numbers: Numbers) -> np.ndarray:
    """Return what specimens and days might add to the records: any numbers, for the density is about them."""
    return np.random.default_rng(2).normal(0.0, 0.3, numbers.records.shape)


def repeats_of(numbers: Numbers, factors: Factors) -> RepeatsOfCases:
    members = find_members(factors, "mixture", apart=True)
    assert members is not None
    mean, scatter, remainder, weight = map(jnp.asarray, numbers[1:5])
    about = CaseDistribution(mean, remainder, scatter, numbers.apart_weight, APART_WIDENING, offset_of(numbers))
    return RepeatsOfCases(about, weight, DISCORDANT_WIDENING, factors.of_record, members)


def summed(numbers: Numbers, factors: Factors) -> ChoicePosterior:
    return repeats_of(numbers, factors).given(jnp.asarray(numbers.records + offset_of(numbers)))


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_choices_are_those_of_all_repeats_together(seed):
    factors = levels_of(3, 1, 2)
    numbers = some_numbers(factors, seed)
    found, members = summed(numbers, factors), find_members(factors, "mixture", apart=True)
    assert members is not None
    for case, count in enumerate(factors.repeats):
        expected = by_hand(numbers, factors, case)
        total = np.logaddexp.reduce(list(expected.values()))
        assert float(found.log_density[case]) == pytest.approx(total, rel=1e-9, abs=1e-9)
        for number, choice in enumerate(members.choices):
            log_choice = float(found.log_choice[number, case])
            if choice[count:].any():  # a repeat that is not there
                assert log_choice == -np.inf
            else:
                same = tuple(map(bool, choice[:count]))
                joint = np.logaddexp.reduce([value for (_, odd), value in expected.items() if odd == same])
                assert log_choice == pytest.approx(joint - total, rel=1e-7, abs=1e-7)


def test_a_scatter_far_smaller_than_what_lies_about_the_predictor_loses_few_digits():
    factors = levels_of(3)
    near, far = (some_numbers(factors, 5, ratio) for ratio in (1.0, 1e-9))
    far.remainder[:] = near.remainder[:] = 1e3  # what the predictor says then hardly matters, near or far
    np.testing.assert_allclose(summed(far, factors).log_choice, summed(near, factors).log_choice, atol=1e-5)


def test_draws_have_the_density_that_is_claimed():
    factors = levels_of(3, 1, 2)
    numbers = some_numbers(factors, 8)
    numbers.remainder[:], numbers = 0.3, numbers._replace(apart_weight=0.2)
    one, other = (repeats_of(numbers._replace(weight=np.array(weight)), factors) for weight in (0.2, 0.4))
    drawn = one.sample(jax.random.PRNGKey(1), (20_000,))
    # The mean of a ratio of densities over draws of the one below is 1: as likely off by 5 standard errors as 6e-7.
    ratio = np.exp(np.asarray(jax.vmap(other.log_prob)(drawn) - jax.vmap(one.log_prob)(drawn)))
    assert abs(ratio.mean() - 1.0) < 5 * ratio.std() / np.sqrt(len(ratio))
    case = int(np.argmax(factors.repeats))
    records = np.flatnonzero(factors.of_record == case)
    between = 0.3**2 * (1.0 + 0.2 * (APART_WIDENING**2 - 1.0))
    within = numbers.scatter[0, case] ** 2 * (1.0 + 0.2 * (DISCORDANT_WIDENING**2 - 1.0))
    covariance = np.cov(np.asarray(drawn)[:, records, 0].T)
    # Standard errors of 20,000 draws of a kurtosis below 10 are 2 %; the covariances' are smaller.
    np.testing.assert_allclose(np.diag(covariance), between + within, rtol=0.1)
    np.testing.assert_allclose(covariance[0, 1:], between, rtol=0.2)


def test_a_case_is_drawn_as_its_repeats_leave_it():
    factors = levels_of(3)
    numbers = some_numbers(factors, 3)
    numbers.remainder[:], numbers = 0.1, numbers._replace(apart_weight=0.2)
    found, random = summed(numbers, factors), np.random.default_rng(7)
    z = jnp.asarray(random.standard_normal((20_000, 1 + 2 * PARAMETERS)))

    def draw(z: jax.Array) -> jax.Array:
        return draw_cases(found, z[:1], z[1 : 1 + PARAMETERS, None], z[1 + PARAMETERS :, None])[:, 0]

    drawn = np.asarray(jax.vmap(draw)(z))
    # On a grid: the density of usual cases and of those that stand apart in either, times that of repeats, each usual
    # or discordant, about each pair of values.
    at = np.linspace(-1.5, 1.5, 601)
    first, second = np.meshgrid(at, at, indexing="ij")
    density = np.zeros(first.shape)
    for values in (first, second):
        usual, apart = (stats.norm.logpdf(values, 0, wider * 0.1) for wider in (1.0, APART_WIDENING))
        density += np.logaddexp(np.log(0.8) + usual, np.log(0.2) + apart)
    for record in range(3):
        usual, odd = (np.log(1 - numbers.weight), 1.0), (np.log(numbers.weight), DISCORDANT_WIDENING)
        of_each = []
        for log_weight, wider in (usual, odd):
            about = [numbers.records[record, i] - numbers.mean[i, 0] for i in range(PARAMETERS)]
            sd = wider * numbers.scatter[:, 0]
            of_each.append(
                log_weight + stats.norm.logpdf(about[0], first, sd[0]) + stats.norm.logpdf(about[1], second, sd[1])
            )
        density += np.logaddexp(*of_each)
    share = np.exp(density - density.max())
    for i, values in enumerate((first, second)):
        mean = np.sum(values * share) / share.sum()
        sd = np.sqrt(np.sum((values - mean) ** 2 * share) / share.sum())
        # Of 20,000 draws: 5 standard errors of the mean; a false alarm in a million. The sd likewise, heavy tails and
        # all within 5 %.
        assert abs(drawn[:, i].mean() - mean) < 5 * sd / np.sqrt(20_000)
        assert drawn[:, i].std() == pytest.approx(sd, rel=0.05)


def test_each_record_has_its_own_probability():
    factors = levels_of(3, 2, 3)
    numbers, members = some_numbers(factors, 4), find_members(factors, "mixture", apart=True)
    assert members is not None
    found = np.asarray(outlier_probability(summed(numbers, factors), members, factors))
    for record, case in enumerate(factors.of_record):
        joint = by_hand(numbers, factors, case)
        reparameterise = int(np.flatnonzero(np.flatnonzero(factors.of_record == case) == record)[0])
        odd = np.logaddexp.reduce([value for (_, choice), value in joint.items() if choice[reparameterise]])
        assert found[record] == pytest.approx(np.exp(odd - np.logaddexp.reduce(list(joint.values()))), rel=1e-7)


def test_each_parameter_of_a_case_has_its_own_probability_to_stand_apart():
    factors = levels_of(3, 2, 1)
    numbers = some_numbers(factors, 4)
    found = np.asarray(apart_probability(summed(numbers, factors)))
    for case in range(len(factors.cases)):
        joint = by_hand(numbers, factors, case)
        for parameter in range(PARAMETERS):
            apart = np.logaddexp.reduce([value for (kind, _), value in joint.items() if kind[parameter]])
            expected = np.exp(apart - np.logaddexp.reduce(list(joint.values())))
            assert found[parameter, case] == pytest.approx(expected, rel=1e-7)


def test_the_density_s_slope_is_that_of_finite_differences():
    factors = levels_of(3, 1, 2)
    numbers, step = some_numbers(factors, 6), 1e-6
    numbers.remainder[:] = [[0.1], [0.0]]  # the slope exists where a parameter has no remainder too

    def density(remainder: jax.Array, scatter: jax.Array) -> jax.Array:
        repeats = repeats_of(numbers, factors)
        repeats.about = repeats.about._replace(remainder=remainder, sd_repeat=scatter)
        return repeats.log_prob(jnp.asarray(numbers.records))

    at = jnp.asarray(numbers.remainder), jnp.asarray(numbers.scatter)
    for which, slope in enumerate(jax.grad(density, argnums=(0, 1))(*at)):
        assert np.isfinite(slope).all()
        for place in np.ndindex(*slope.shape):
            ends = []
            for sign in (1.0, -1.0):
                moved = list(at)
                moved[which] = at[which].at[place].add(sign * step)
                ends.append(float(density(*moved)))
            # Of second order in the step, and rounding of 1e-15 x 1e3 / 1e-6.
            assert slope[place] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-5, abs=1e-5)


@settings(max_examples=25)
@given(odd=st.lists(st.booleans(), min_size=6, max_size=6))
def test_the_choice_that_some_records_look_is_found(odd):
    factors = levels_of(3, 1, 2)
    members, looks = find_members(factors, "mixture", apart=True), jnp.asarray(odd)
    assert members is not None
    found = choice_number(looks, members)
    for case, count in enumerate(factors.repeats):
        of_case = np.array(odd)[factors.of_record == case]
        same = [np.array_equal(choice[:count], of_case) and not choice[count:].any() for choice in members.choices]
        assert sum(same) == 1
        assert found[case] == same.index(True)


@pytest.mark.parametrize("apart", [True, False])
def test_only_mixtures_of_few_repeats_are_summed_out(apart):
    assert find_members(levels_of(3), "student", apart) is None
    assert (find_members(levels_of(3), "normal", apart) is None) == (not apart)
    assert find_members(levels_of(marginal_mixture.MOST_REPEATS + 1, 3), "mixture", apart) is None
    assert find_members(levels_of(marginal_mixture.MOST_REPEATS, 3), "mixture", apart) is not None


def test_a_fit_without_a_record_is_sampled_as_that_of_all():
    most = marginal_mixture.MOST_REPEATS
    first, twice = np.arange(most + 4) > 0, np.repeat(np.arange(most), 2)
    assert find_members(levels_of(most + 1, 3).only(first), "mixture", apart=True) is None
    assert find_members(levels_of(most, 3).only(first[1:]), "mixture", apart=True) is not None
    # Records taken twice are as many as they are: choices of all of them would be too many.
    assert find_members(levels_of(most).only(twice), "mixture", apart=True) is None


@pytest.fixture(scope="module")
def records() -> PreparedRecords:
    return prepare_records(check_record_table(simulate(EIGHT_CASES, 2)[0]), MODEL)


@pytest.fixture(scope="module")
def joint(records, fully_compiled) -> Chains:
    """Return the chains of the records, whose cases are summed out."""
    return fit.joint_chains(records, SAMPLING, MODEL)


@pytest.mark.slow  # compiles the whole model
def test_quantities_of_many_draws_together_are_those_of_each_by_itself(records, joint):
    # XLA has compiled a product of matrices here to something else, for a hundred draws together and not for one.
    arguments = records.arguments(MODEL)
    arguments |= {"approximation": laplace_approximation(records.batch, records.factors)}
    chains = joint.given(arguments, record_starts(arguments))
    draws = chains.advance(chains.begin(0), 40).unconstrained
    together, keys = chains.constrain(draws, (3,)), draw_keys((3,), chains.chains)

    @jax.jit
    def one(key, z):
        model = handlers.substitute(records_in_coordinates, data=named_normals(key, chains._normals))
        return constrain_fn(model, (), arguments, z, return_deterministic=True)

    for draw in (0, 17, 39):
        z = chains.blocks.unpack({name: jnp.asarray(values[0, draw]) for name, values in draws.items()})
        alone = one(jnp.asarray(keys[0, draw]), z)
        for name, values in together.items():
            np.testing.assert_allclose(values[0, draw], alone[name], rtol=1e-9, atol=1e-12, err_msg=name)


@pytest.mark.slow
def test_the_posterior_is_that_of_cases_that_are_sampled(records, joint, monkeypatch):
    summed = fit.fit_prepared(records, SAMPLING, MODEL, joint)["posterior"].to_dataset()
    monkeypatch.setattr(marginal_mixture, "MOST_REPEATS", 0)
    sampled = fit.fit_prepared(records, SAMPLING, MODEL)["posterior"].to_dataset()
    assert_means_agree(summed, sampled, least=200)
    # What it is for: an odd repeat no longer makes two modes of its case. Of 4000 draws, 3060 to 4050 for six seeds.
    assert float(az.ess(summed["beta_case"]).min()) > 1500
