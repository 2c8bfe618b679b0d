"""The compressed likelihood is the direct one: values, gradients, ragged records."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.simulated_records import Plan, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Array

from bayes_tyre.inference.correlated_noise import SharedError, UnequalNoise, smoothed_noise
from bayes_tyre.inference.model.coordinates.laplace import RecordEstimates, estimate_records
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.likelihood import compressed
from bayes_tyre.inference.model.likelihood.compressed import CompressedLikelihood, compress
from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood
from bayes_tyre.inference.model.prepared_records import record_batch
from bayes_tyre.inference.record_data import LAWS, RecordData, record_data
from bayes_tyre.record_table import check_record_table

# Compilation and module fixtures: over 10 s for the file from cold.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def records() -> tuple[DirectLikelihood, CompressedLikelihood, RecordEstimates]:
    table, _ = simulate(Plan(speeds=(0.0,), loads=(20.0,), points=240), seed=3)
    # Ragged: the last record loses its tail.
    last = table["record"].iloc[-1]
    table = table.drop(table.index[table["record"] == last][150:])
    batch = record_batch(check_record_table(table))
    data = record_data(batch)
    return DirectLikelihood(data), compress(data), estimate_records(batch)


@pytest.fixture(scope="module", params=["autoregressive", "smoothed"])
def correlated(request, records) -> tuple[DirectLikelihood, CompressedLikelihood, RecordEstimates, float | None]:
    """Return both likelihoods under noise that is not independent, the picture, and rho where there is one."""
    direct, _, approximation = records
    if request.param == "autoregressive":
        return direct, compress(direct.data, neighbours=True), approximation, 0.7
    whitening = smoothed_noise(direct.data.u.shape[1], 20)
    return DirectLikelihood(direct.data, whitening), compress(direct.data, whitening=whitening), approximation, None


def displaced(present: Array) -> SharedError:
    """Return a whitening with a map of its own for each record."""
    random, shape = np.random.default_rng(5), present.shape
    shared = np.where(present, random.standard_normal(shape), 0.0)
    shared /= np.linalg.norm(shared, axis=1, keepdims=True)
    weight = np.where(present, random.uniform(0.2, 1.0, shape), 1.0)
    shrink = random.uniform(0.0, 0.9, shape[0])
    others, (shared, shrink) = UnequalNoise(jnp.asarray(weight)), map(jnp.asarray, (shared, shrink))
    return SharedError(others, shared, shared, shrink)


def off_from(approximation: RecordEstimates, sds: Array) -> tuple[Array, Array]:
    """Return F_i and J, and log k, so many standard deviations of each record's own estimate away from it."""
    offsets = jnp.linalg.cholesky(jnp.linalg.inv(approximation.information[:, :2, :2]))
    of_k = approximation.of_log_values().precision[:, 0, 0]
    level = approximation.centre[:, :2] + jnp.einsum("rij,j->ri", offsets, sds[:2])
    return level, approximation.log_k + sds[2] / jnp.sqrt(of_k)


def prior_beta(quantile_sd: float) -> float:
    location, scale = PRIORS["beta_group"].parameters
    return location + quantile_sd * scale


@settings(max_examples=60)
@given(
    where=st.floats(-3.0, 3.0),
    sigma_factor=st.sampled_from([0.1, 1.0, 10.0]),
    off=st.lists(st.floats(-30.0, 30.0), min_size=3, max_size=3),
)
def test_values_agree_to_1e_5_over_the_range_of_the_prior(records, where, sigma_factor, off):
    direct, compressed, approximation = records
    # Off by up to 30 standard deviations of the record's own estimate in F_i, J and k, beta over the prior.
    level, log_k = off_from(approximation, jnp.asarray(off))
    log_beta = jnp.full_like(log_k, prior_beta(where))
    theta = jnp.concatenate([level, log_k[:, None], log_beta[:, None]], axis=1)
    sigma = jnp.exp(approximation.log_sigma) * sigma_factor
    difference = compressed(theta, sigma) - direct(theta, sigma)
    assert float(jnp.max(jnp.abs(difference))) < 1e-5


def test_gradients_agree_to_1e_6_of_their_size(records):
    direct, compressed, approximation = records
    for where in np.linspace(-3.0, 3.0, 25):
        theta = approximation.centre.at[:, 3].set(prior_beta(float(where)))
        sigma = jnp.exp(approximation.log_sigma)
        ours = jax.jacfwd(lambda t, s=sigma: compressed(t, s).sum())(theta)
        theirs = jax.jacfwd(lambda t, s=sigma: direct(t, s).sum())(theta)
        size = jnp.max(jnp.abs(theirs), axis=1, keepdims=True)
        assert float(jnp.max(jnp.abs(ours - theirs) / (1.0 + size))) < 1e-6


def test_a_record_of_150_000_points_is_kept_in_no_more_numbers_than_one_of_100():
    def kept(points: int) -> list[tuple[int, ...]]:
        u = jnp.linspace(0.0, 2.0, points)[None]
        one = jnp.ones(1)
        data = RecordData(u, 20.0 + 1.7 * u, jnp.ones_like(u, dtype=bool), one, 20.0 * one, 3.4 * one)
        return [leaf.shape for leaf in jax.tree.leaves(compress(data))]

    # A density is of the table and the unknowns alone: where the table is no larger, nothing is.
    assert kept(150_000) == kept(100)
    assert max(np.prod(shape) for shape in kept(100)) < 150_000


@pytest.mark.parametrize("law", LAWS)
def test_the_direct_likelihood_is_the_normal_density(records, law):
    direct, _, approximation = records
    theta, sigma = approximation.centre, jnp.exp(approximation.log_sigma)
    data = direct.data
    direct = DirectLikelihood(data, law=law)
    first = np.asarray(data.present[0])
    u, F = np.asarray(data.u[0])[first], np.asarray(data.F[0])[first]
    F_i, J, log_k, log_beta = np.asarray(theta[0])
    rise = 1 - np.exp(-np.abs(u) / np.exp(log_beta))
    curve = F_i + J * rise + np.exp(log_k) * u * (rise if law == "equation_2" else 1.0)
    by_hand = np.sum(-0.5 * ((F - curve) / sigma[0]) ** 2 - np.log(sigma[0]) - 0.5 * np.log(2 * np.pi))
    assert float(direct(theta, sigma)[0]) == pytest.approx(float(by_hand), rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", ["independent", "autoregressive", "smoothed", "displaced", "displaced autoregressive"])
def test_offsets_are_those_of_the_density_point_by_point(records, kind, law):
    direct, _, approximation = records
    data, sigma, random = direct.data, jnp.exp(approximation.log_sigma), np.random.default_rng(2)
    whitening = smoothed_noise(data.u.shape[1], 20) if kind == "smoothed" else None
    whitening = displaced(data.present) if "displaced" in kind else whitening
    rho = jnp.full_like(sigma, 0.6) if "autoregressive" in kind else None
    direct = DirectLikelihood(data, whitening, law)
    compressed = compress(data, neighbours=rho is not None, whitening=whitening, law=law)
    starts = jnp.stack([data.F_0, jnp.zeros_like(data.F_0)], axis=1)
    for likelihood in (direct, compressed):
        of_offsets = likelihood.of_offsets(approximation.centre[:, 2:], sigma, rho)
        for _ in range(3):
            offsets = approximation.centre[:, :2] - starts + 0.1 * random.standard_normal((len(sigma), 2))
            theta = jnp.concatenate([starts + offsets, approximation.centre[:, 2:]], axis=1)
            np.testing.assert_allclose(of_offsets.at(offsets), direct(theta, sigma, rho), rtol=1e-9, atol=1e-5)
            about = jnp.asarray(random.standard_normal((len(sigma), 2)))
            moved = of_offsets.about(*about.T).at(offsets - about)
            np.testing.assert_allclose(moved, of_offsets.at(offsets), rtol=1e-9, atol=1e-5)


@pytest.mark.parametrize("kind", ["independent", "smoothed", "displaced"])
def test_records_are_tabulated_some_at_a_time_as_all_at_once(records, kind, monkeypatch):
    data = records[0].data
    maps = {"smoothed": smoothed_noise(data.u.shape[1], 20), "displaced": displaced(data.present)}
    whole = compress(data, neighbours=True, whitening=maps.get(kind))
    # Lots of five whose last overlaps with the one before it.
    assert len(data.u) % 5 != 0
    monkeypatch.setattr(compressed, "_AT_ONCE", 5)
    in_lots = compress.__wrapped__(data, neighbours=True, whitening=maps.get(kind))
    for ours, theirs in zip(jax.tree.leaves(in_lots), jax.tree.leaves(whole), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12 * float(jnp.max(jnp.abs(theirs))))


def test_padding_does_not_count(records):
    _, compressed, _ = records
    assert compressed.points[-1] == 150
    assert compressed.points[0] == 240


@settings(max_examples=40)
@given(
    where=st.floats(-3.0, 3.0),
    sigma_factor=st.sampled_from([0.1, 1.0, 10.0]),
    rho_factor=st.floats(-1.4, 1.4),
    off=st.lists(st.floats(-30.0, 30.0), min_size=3, max_size=3),
)
def test_correlated_noise_agrees_to_1e_5_likewise(correlated, where, sigma_factor, rho_factor, off):
    direct, compressed, approximation, rho = correlated
    level, log_k = off_from(approximation, jnp.asarray(off))
    theta = jnp.concatenate([level, log_k[:, None], jnp.full_like(log_k, prior_beta(where))[:, None]], axis=1)
    sigma = jnp.exp(approximation.log_sigma) * sigma_factor
    of_records = None if rho is None else jnp.full_like(sigma, rho * rho_factor)
    ours, theirs = compressed(theta, sigma, of_records), direct(theta, sigma, of_records)
    # What is left is a small difference of sums of squares of y / sigma, (1 + rho) / (1 - rho) times as large once
    # they are whitened (4e10 where rho is 0.97 and sigma a tenth of the rmse): they are right to their last bit or two.
    data, most = direct.data, 0.0 if rho is None else abs(rho * rho_factor)
    squares = jnp.sum(jnp.where(data.present, (data.F - data.F_0[:, None]) / sigma[:, None], 0.0) ** 2, axis=1)
    last_bits = 2.0 * np.finfo(float).eps * squares * (1.0 + most) / (1.0 - most)
    assert float(jnp.max(jnp.abs(ours - theirs) - last_bits)) < 1e-5


def test_rho_needs_the_products_of_neighbours(records):
    _, compressed, approximation = records
    sigma = jnp.exp(approximation.log_sigma)
    with pytest.raises(ValueError, match="neighbours=True"):
        compressed(approximation.centre, sigma, 0.5 * jnp.ones_like(sigma))
