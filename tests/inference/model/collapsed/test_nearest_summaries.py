"""Records summed up: what they say of what they share, against integrals over their own density."""

from functools import cache
from itertools import permutations
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.simulated_records import Plan, simulate
from scipy.special import logsumexp
from scipy.stats import norm

from bayes_tyre.inference.model.collapsed.nearest_summaries import refine_summaries, summarise_records
from bayes_tyre.inference.model.collapsed.record_summaries import (
    NoiseSummaries,
    RecordSummaries,
    ValueSummaries,
    empty_summaries,
    record_log_density,
)
from bayes_tyre.inference.model.coordinates.laplace import LaplaceApproximation
from bayes_tyre.inference.model.normal_posterior import NormalPosterior, QuadraticApproximation
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.record_table import check_record_table

PLAN = Plan(("a",), (0.0,), (20.0,), (-10.0, 10.0), points=60, noise_kN=0.05)
#: Standard deviations of k and beta about the case, and of the noise among records: what two truths share.
SCATTER, SD_NOISE = np.array([0.04, 0.1]), {"iid": np.array([0.05]), "ar1": np.array([0.05, 0.1])}


class Case(NamedTuple):
    records: PreparedRecords
    approximation: LaplaceApproximation
    summaries: RecordSummaries


@cache
def made(noise: str) -> Case:
    settings = ModelSettings(noise=noise)
    records = prepare_records(check_record_table(simulate(PLAN, 4)[0]), settings)
    approximation = records.approximation(settings)
    known = records.data, records.normal_likelihood, approximation, records.factors, noise
    return Case(records, approximation, summarise_records(*known, 6.0))


def of_J(case: Case) -> tuple[jax.Array, jax.Array]:
    """Return the means of J, and its standard deviation about them, that the records are first summed up at."""
    return case.approximation.records.typical_J(case.records.factors)


class Shared(NamedTuple):
    """What records share: their cases, scatter about these, typical noise and its scatter, mean and sd of J."""

    above: np.ndarray
    scatter: np.ndarray
    noise: np.ndarray
    sd: np.ndarray
    mean_J: jax.Array
    sd_J: jax.Array


def given(summaries: RecordSummaries, shared: Shared) -> tuple[NormalPosterior, NormalPosterior, np.ndarray]:
    """Return the posteriors of values and noise by the summaries, and the log density with both integrated out."""
    count, above = len(shared.above), jnp.asarray(shared.above)
    noise, sd = (jnp.broadcast_to(jnp.asarray(each), (count, len(each))) for each in (shared.noise, shared.sd))
    of_noise, _, noise_posterior = summaries.noise.log_marginal(noise, sd)
    values, constant = summaries.values.given(noise + noise_posterior.draw(jnp.zeros_like(noise.T)).T)
    values = summaries.offsets.move(values, shared.mean_J, shared.sd_J)
    scatter = jnp.broadcast_to(jnp.asarray(shared.scatter)[:, None], (2, count))
    posterior = NormalPosterior(values.slope_at(above).T, jnp.moveaxis(values.precision, 0, -1), scatter)
    log_density = values.at(above) + constant + posterior.log_marginal + of_noise
    log_density = log_density + summaries.offsets.at(shared.mean_J, shared.sd_J)
    return posterior, noise_posterior, np.asarray(log_density)


def by_importance(case: Case, shared: Shared) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values and noise of the records, and the weights that make their own density of the summaries'."""
    random, draws, wider, q = np.random.default_rng(0), 20_000, 1.2, len(shared.noise)
    values, noise, _ = given(case.summaries, shared)
    z = wider * random.standard_normal((draws, 2 + q, len(shared.above)))
    log_values = shared.above + np.moveaxis(np.asarray(jax.vmap(values.draw)(jnp.asarray(z[:, :2]))), 1, -1)
    noises = shared.noise + np.moveaxis(np.asarray(jax.vmap(noise.draw)(jnp.asarray(z[:, 2:]))), 1, -1)
    log_prior = norm.logpdf(log_values, shared.above, shared.scatter).sum(axis=-1)
    log_prior = log_prior + norm.logpdf(noises, shared.noise, shared.sd).sum(axis=-1)
    log_proposal = norm.logpdf(z, 0.0, wider).sum(axis=1) - np.asarray(values.log_volume + noise.log_volume)
    of_each = (jnp.asarray(log_values), jnp.asarray(noises), shared.mean_J, shared.sd_J)
    exact = np.asarray(log_densities(case.records.data, case.records.normal_likelihood, *of_each))
    return log_values, noises, exact + log_prior - log_proposal


@eqx.filter_jit  # what is shared is an argument: one compilation for all of it
def log_densities(data, likelihood, log_values, noises, mean_J, sd_J):
    return jax.vmap(lambda at, of: record_log_density(data, likelihood, at, of, mean_J, sd_J))(log_values, noises)


@cache
def refined(noise: str) -> tuple[Case, Shared]:
    """Return records summed up about their posterior given what they share."""
    case, random = made(noise), np.random.default_rng(2)
    centre = np.asarray(case.summaries.values.centre)
    typical = np.asarray(case.summaries.noise.quadratic.centre).mean(axis=0)
    above = np.broadcast_to(centre.mean(axis=0), centre.shape)
    shared = Shared(above, SCATTER, typical, SD_NOISE[noise], *of_J(case))
    log_values, noises, log_weights = by_importance(case, shared)
    weights = np.exp(log_weights - logsumexp(log_weights, axis=0))
    picked = np.stack([random.choice(len(weights), 10_000, p=own) for own in weights.T], axis=1)
    values, noise_drawn = (
        jnp.asarray(np.take_along_axis(of, picked[..., None], axis=0)) for of in (log_values, noises)
    )
    known = case.records.data, case.records.normal_likelihood
    return case._replace(summaries=refine_summaries(*known, values, noise_drawn, shared.mean_J, shared.sd_J)), shared


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["iid", "ar1"])
def test_the_log_density_of_what_is_shared_is_that_of_the_records_integrated(noise):
    case, shared = refined(noise)
    others: list[Shared] = [
        shared,
        shared._replace(above=shared.above + 0.3 * SCATTER, scatter=0.8 * SCATTER),
        shared._replace(above=shared.above - 0.3 * SCATTER, scatter=1.25 * SCATTER),
        shared._replace(noise=shared.noise + 0.3 * shared.sd, sd=0.7 * shared.sd),
        shared._replace(noise=shared.noise - 0.3 * shared.sd, sd=1.4 * shared.sd),
        shared._replace(sd_J=1.2 * shared.sd_J),
        shared._replace(mean_J=shared.mean_J + 0.3 * shared.sd_J),
        shared._replace(mean_J=shared.mean_J + 0.3 * shared.sd_J, above=shared.above + 0.3 * SCATTER),
        shared._replace(sd_J=1.2 * shared.sd_J, above=shared.above + 0.3 * SCATTER),
    ]
    found = []
    for other in others:
        *_, log_weights = by_importance(case, other)
        found.append(given(case.summaries, other)[2] - logsumexp(log_weights, axis=0))
    # Only differences mean anything. The densities move by up to 1; importance sampling has a standard error of 0.005
    # at weights that vary by 0.7.
    np.testing.assert_allclose(np.array(found) - found[0], 0.0, atol=0.01)


@pytest.mark.parametrize("sd", [[0.05, 0.15], [0.2, 0.02], [1e-6, 0.1]])
def test_third_derivatives_along_two_parameters_of_the_noise_count_together(sd):
    """Against the integral over the density itself: equal to first order in the third derivatives."""
    rng, whiten = np.random.default_rng(1), np.array([[[8.0, 0.0], [1.0, 5.0]]])
    parts = [np.transpose(rng.uniform(0.5, 1.0, (2, 2, 2)), order) for order in permutations(range(3))]
    third = 1e-3 * np.sum(parts, axis=0)
    precision, centre, slope = whiten.mT @ whiten, np.array([[-3.5, 0.1]]), np.array([[2.0, -1.0]])
    quadratic = QuadraticApproximation(*map(jnp.asarray, (centre, slope, precision)))
    summaries = NoiseSummaries(quadratic, jnp.asarray(whiten), jnp.asarray(third[None]), jnp.zeros((1, 2)))
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 1, 2)
    weights = np.outer(weights, weights).ravel() / weights.sum() ** 2
    for above in (centre, centre + np.array([0.05, -0.1])):
        integral = np.log(weights @ np.exp(np.asarray(summaries.at(jnp.asarray(above + sd * grid)))[:, 0]))
        of_each = [jnp.asarray(np.broadcast_to(each, (1, 2))) for each in (above, sd)]
        found, without = (
            float(each.log_marginal(*of_each)[0][0])
            for each in (summaries, summaries._replace(third=jnp.zeros((1, 2, 2, 2))))
        )
        # What is of second order is a share of the whole as small as they are.
        assert abs(found - integral) < 0.03 * abs(without - integral)


@pytest.mark.slow
def test_records_are_summed_up_about_the_draws_given():
    case, shared = refined("iid")
    log_values, _, log_weights = by_importance(case, shared)
    weights = np.exp(log_weights - logsumexp(log_weights, axis=0))
    mean = np.einsum("dr,dri->ri", weights, log_values)
    sd = np.sqrt(np.einsum("dr,dri->ri", weights, (log_values - mean) ** 2))
    # 12 means of 10,000 draws, off by 0.01 sd each.
    np.testing.assert_allclose((case.summaries.values.centre - mean) / sd, 0.0, atol=0.05)
    found = np.asarray(given(case.summaries, shared)[0].root())
    np.testing.assert_allclose(np.sqrt((found**2).sum(axis=1)).T / sd, 1.0, atol=0.05)


@pytest.mark.parametrize("noise", ["iid", "ar1"])
def test_what_records_say_of_their_values_follows_their_noise(noise):
    case, random = made(noise), np.random.default_rng(3)
    centre = np.asarray(case.summaries.values.centre)
    log_values = jnp.asarray(centre + 0.3 * SCATTER * random.standard_normal((200, *centre.shape)))
    at = np.asarray(case.summaries.values.noise)
    noises = at + 0.02 * random.standard_normal((200, *at.shape))
    known, mean_J = (case.records.data, case.records.normal_likelihood), of_J(case)[0]

    def summed_up(noises: np.ndarray) -> ValueSummaries:
        # 1 kN leaves J open: what a narrow prior says does not scale with the noise.
        return refine_summaries(*known, log_values, jnp.asarray(noises), mean_J, jnp.ones(())).values

    here, off = summed_up(noises), np.array([0.1, 0.2][: at.shape[1]])
    there = summed_up(noises + off)
    (exact, _), (followed, _), (still, _) = there.given(there.noise), here.given(there.noise), here.given(here.noise)
    # Of second order in the change of the noise: exactly right but for a prior of F_i where it is sigma's.
    size = np.sqrt(np.einsum("rii->ri", exact.precision))
    relative = (np.asarray(followed.precision) - exact.precision) / (size[:, :, None] * size[:, None])
    np.testing.assert_allclose(relative, 0.0, atol=0.03)
    np.testing.assert_allclose((np.asarray(followed.slope) - exact.slope) / size, 0.0, atol=0.03)
    unmoved = (np.asarray(still.precision) - exact.precision) / (size[:, :, None] * size[:, None])
    assert np.abs(np.einsum("rii->ri", unmoved)).min() > 0.15


def test_the_mean_over_the_values_is_the_same_at_every_noise():
    values, random = made("ar1").summaries.values, np.random.default_rng(4)
    # Coordinates whose variance is known, as `draws` have exactly: their mean is 0 and they are uncorrelated.
    draws = random.standard_normal((50, *values.score.shape))
    draws -= draws.mean(axis=0)
    root = np.linalg.cholesky(np.einsum("mri,mrj->rij", draws, draws) / 50)
    draws = np.linalg.solve(root, draws[..., None])[..., 0] * np.sqrt(values.variance)
    log_values = values.centre + np.linalg.solve(np.asarray(values.root), draws[..., None])[..., 0]
    means = []
    for off in (np.zeros(2), np.array([0.2, -0.1])):
        density, constant = values.given(values.noise + off)
        means.append(np.asarray(density.at(jnp.asarray(log_values))).mean(axis=0) + constant)
    np.testing.assert_allclose(means[1], means[0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("noise", ["iid", "ar1"])
def test_what_is_compiled_for_has_the_shapes_of_what_comes(noise):
    case = made(noise)
    blank = jax.tree.map(jnp.shape, empty_summaries(len(case.records.batch.records), noise))
    assert blank == jax.tree.map(jnp.shape, case.summaries)
