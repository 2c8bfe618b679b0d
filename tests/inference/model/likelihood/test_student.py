"""Noise with heavy tails: the density of a record's forces, with and without its F_i and J, against SciPy's t."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.simulated_records import Plan, simulate
from scipy import stats
from scipy.special import logsumexp

from bayes_tyre.inference.model.likelihood.direct import DirectLikelihood
from bayes_tyre.inference.model.likelihood.student import StudentForces, StudentLikelihood
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.record_table import check_record_table

# Compilation, and quadrature of every number of points: over 10 s for the file.
pytestmark = pytest.mark.slow

SIGMA, MEAN_J, SD_J = 0.03, 0.2, 0.3


class Made(NamedTuple):
    """Two records, the second a third shorter, about known values."""

    likelihood: StudentLikelihood
    log_values: jax.Array

    @property
    def rest(self) -> tuple[jax.Array, ...]:
        return jnp.full(2, SIGMA), jnp.asarray(self.nu), jnp.full(2, MEAN_J), jnp.asarray(SD_J)

    nu: float = 4.0


def made(points: int, nu: float = 4.0, law: str = "equation_2") -> Made:
    table, truth = simulate(Plan(("a",), (0.0,), (20.0,), (5.0,), 2, points, noise_kN=1e-9), seed=7)
    table["force_kN"] += SIGMA * np.random.default_rng(points).standard_t(nu, len(table))
    table = check_record_table(table.iloc[: len(table) - points // 3])
    records = prepare_records(table, ModelSettings(noise="student", law=law))
    assert isinstance(records.likelihood, StudentLikelihood)
    return Made(records.likelihood, jnp.log(jnp.asarray(truth[["k", "beta"]].to_numpy())) + 0.01, nu)


def by_hand(of: Made, record: int, F_i: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return the log density of a record's forces at F_i and J of any one shape (kN)."""
    data = of.likelihood.data
    present = np.asarray(data.present[record])
    u, F = np.asarray(data.u[record])[present], np.asarray(data.F[record])[present]
    k, beta = np.exp(np.asarray(of.log_values[record]))
    g = 1.0 - np.exp(-np.abs(u) / beta)
    off = (F - np.asarray(F_i)[..., None] - (np.asarray(J)[..., None] + k * u) * g) / SIGMA
    # Quicker than SciPy's own, which gives the constant.
    at_zero = stats.t.logpdf(0.0, of.nu) - np.log(SIGMA)
    return len(u) * at_zero - 0.5 * (of.nu + 1.0) * np.log1p(off**2 / of.nu).sum(axis=-1)


@pytest.mark.parametrize("nu", [2.5, 30.0])
def test_the_density_at_given_offsets_is_scipys(nu):
    of = made(12, nu)
    start = np.array([[14.0, 0.4], [14.1, 0.3]])
    found = of.likelihood(jnp.concatenate([jnp.asarray(start), of.log_values], axis=1), *of.rest[:2])
    for record, (F_i, J) in enumerate(start):
        present = np.asarray(of.likelihood.data.present[record])
        u, F = (np.asarray(values[record])[present] for values in of.likelihood.data[:2])
        k, beta = np.exp(np.asarray(of.log_values[record]))
        curve = F_i + (J + k * u) * (1.0 - np.exp(-np.abs(u) / beta))
        expected = stats.t.logpdf(F, nu, curve, SIGMA).sum()
        assert float(found[record]) == pytest.approx(expected, rel=1e-11)
        assert by_hand(of, record, F_i, J) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("points", [10, 40, 400])
@pytest.mark.parametrize("nu", [2.5, 4.0, 30.0])
def test_over_its_coordinates_the_density_integrates_to_that_of_the_forces(points, nu):
    """Whatever places the coordinates: offsets are placed by weights of points, which are no part of the density."""
    of = made(points, nu)
    data = of.likelihood.data
    z = np.linspace(-14.0, 14.0, 201)
    grid = jnp.asarray(np.stack(np.meshgrid(z, z), axis=-1).reshape(-1, 2))
    at = jax.jit(lambda z: of.likelihood.at_coordinates(jnp.stack([z, z]), of.log_values, *of.rest))
    found = logsumexp(np.asarray(jax.lax.map(at, grid, batch_size=500)), axis=0) + 2.0 * np.log(z[1] - z[0])
    # In F_i and in F_i + J, which the points determine apart from each other.
    given = of.likelihood.offsets_given(of.log_values, *of.rest)
    for record in (0, 1):
        sides = np.asarray(jax.vmap(lambda z: given.draw(jnp.stack([z, z])))(grid))[:, record]
        F_i, J = sides.T + np.array([[data.F_0[record]], [MEAN_J]])
        low, high = F_i.min(), F_i.max()
        level, end = np.linspace(low, high, 401), np.linspace((F_i + J).min(), (F_i + J).max(), 402)
        F_i, F_end = np.meshgrid(level, end)
        blocks = [by_hand(of, record, *each) for each in zip(F_i, F_end - F_i, strict=True)]
        prior = stats.norm.logpdf(F_i, data.F_0[record], data.span[record])
        prior = prior + stats.norm.logpdf(F_end - F_i, MEAN_J, SD_J)
        expected = logsumexp(np.stack(blocks) + prior) + np.log((level[1] - level[0]) * (end[1] - end[0]))
        assert found[record] == pytest.approx(expected, abs=1e-3)


def test_with_normal_noise_it_is_the_closed_form_at_every_coordinate():
    of = made(40)
    nu, data = 1e7, of.likelihood.data
    normal = StudentLikelihood(data, DirectLikelihood(data))
    sigma, _, mean_J, sd_J = of.rest
    closed = normal.offsets_given(of.log_values, sigma, jnp.asarray(nu), mean_J, sd_J).log_marginal
    for z in np.random.default_rng(2).standard_normal((3, 2, 2)):
        found = normal.at_coordinates(jnp.asarray(z), of.log_values, sigma, jnp.asarray(nu), mean_J, sd_J)
        # Less the density of the coordinates, standard normals.
        np.testing.assert_allclose(found - stats.norm.logpdf(z).sum(axis=1), closed, atol=1e-4)


def test_gradients_are_those_of_finite_differences_down_to_a_scale_of_J_of_nothing():
    of = made(20)
    for sd_J in (SD_J, 1e-12):
        at = np.array([0.3, -0.5, *np.ravel(of.log_values[0]), np.log(SIGMA), np.log(4.0), MEAN_J, np.log(sd_J)])

        def density(at: jax.Array) -> jax.Array:
            z, log_values, rest = jnp.stack([at[:2]] * 2), jnp.stack([at[2:4]] * 2), jnp.exp(at)
            rest = jnp.full(2, rest[4]), rest[5], jnp.full(2, at[6]), rest[7]
            return of.likelihood.at_coordinates(z, log_values, *rest)[0]

        slope, density = np.asarray(jax.grad(density)(jnp.asarray(at))), jax.jit(density)
        for i, step in enumerate(1e-6 * np.eye(len(at))):
            difference = (float(density(jnp.asarray(at + step))) - float(density(jnp.asarray(at - step)))) / 2e-6
            assert slope[i] == pytest.approx(difference, rel=1e-5, abs=1e-4)


def test_forces_are_drawn_from_their_density():
    of = made(40, nu=4.0)
    data, theta = of.likelihood.data, jnp.concatenate([jnp.ones((2, 2)), of.log_values], axis=1)
    fn = StudentForces(data, theta, *of.rest[:2])
    noiseless = StudentForces(data, theta, jnp.full(2, 1e-12), jnp.asarray(1e6)).sample(jax.random.key(1))
    drawn = np.asarray(fn.sample(jax.random.key(0), (250,)) - noiseless).ravel() / SIGMA
    # 20,000 numbers: further from SciPy's distribution than chance lets one of 1,000 samples be.
    assert stats.kstest(drawn, stats.t(4.0).cdf).pvalue > 1e-3
