"""The density of a whole record, its own parameters integrated out, against the normal density where it is one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from helpers.simulated_records import Plan, simulate
from scipy import stats

from bayes_tyre.inference.diagnostics.leave_one_out.record_marginal import (
    POINTS,
    RecordPopulation,
    hyperparameters,
    record_density,
    standard_points,
    unknowns,
)
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.inference.model.likelihood.compressed import compress
from bayes_tyre.inference.model.prepared_records import prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.record_data import record_data
from bayes_tyre.record_table import check_record_table, record_factors

#: So narrow that a logarithm is as good as known.
NARROW = 1e-6
J_MEAN, J_SCALE = np.array([0.3, -0.5]), np.array([0.05, 2.0])


@pytest.fixture(scope="module")
def records():
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=3, points=50), seed=3)
    return prepare_records(check_record_table(table), ModelSettings()).batch


def known(estimates, **other) -> RecordPopulation:
    """Return two draws of populations that leave nothing open but F_i and J."""
    pair = np.asarray(estimates.centre[:, 2:])
    values = {
        "log_case": jnp.asarray(np.stack([pair, pair + 0.01])),
        "log_sd_repeat": jnp.full((2, *pair.shape), np.log(NARROW)),
        "mean_J": jnp.asarray(np.broadcast_to(J_MEAN[:, None], (2, len(pair)))),
        "sd_J": jnp.asarray(J_SCALE),
        "log_sigma": jnp.log(jnp.array([0.03, 0.05])),
        "sd_log_sigma": jnp.full(2, NARROW),
        **dict.fromkeys(("discordant_weight", "student_nu", "atanh_rho", "sd_atanh_rho")),
    }
    return RecordPopulation(**{**values, **other})


def by_hand(data, record, log_pair, mean_J, sd_J, sigma, rho=0.0) -> float:
    """Return the log density of a record whose k, beta and sigma are known: a normal one, with F_i and J in it."""
    present = np.asarray(data.present[record])
    u, F = np.asarray(data.u[record])[present], np.asarray(data.F[record])[present]
    k, beta = np.exp(log_pair)
    g = 1.0 - np.exp(-np.abs(u) / beta)
    apart = np.abs(np.subtract.outer(np.arange(len(u)), np.arange(len(u))))
    covariance = sigma**2 * float(rho) ** apart if rho else sigma**2 * np.eye(len(u))
    covariance = covariance + float(data.span[record]) ** 2 + sd_J**2 * np.outer(g, g)
    mean = float(data.F_0[record]) + mean_J * g + k * u * g
    return float(stats.multivariate_normal(mean, covariance).logpdf(F))


def density(batch, model: ModelSettings, of, seed: int = 0, points: int = 8192):
    data, estimates = record_data(batch), estimate_records(batch, model.noise)
    likelihood = compress(data, neighbours=model.noise == "ar1")
    z = standard_points(unknowns(model.noise), seed, points)
    return data, record_density(likelihood, data, estimates, of(estimates), z)


def test_with_k_beta_and_sigma_known_it_is_the_normal_density_with_F_i_and_J_in_it(records):
    data, found = density(records, ModelSettings(), known)
    pairs = np.asarray(known(estimate_records(records)).log_case)
    for draw, sigma in enumerate((0.03, 0.05)):
        for record in range(3):
            expected = by_hand(data, record, pairs[draw, record], J_MEAN[draw], J_SCALE[draw], sigma)
            # 8192 points, of which half count: within 2 % of the density, whatever the scale of J.
            assert float(found.log_density[draw, record]) == pytest.approx(expected, abs=0.03)
    assert float(jnp.min(found.effective_points)) > 2000


def test_autoregressive_noise_likewise(records):
    rho = 0.2
    more = {"atanh_rho": jnp.full(2, np.arctanh(rho)), "sd_atanh_rho": jnp.full(2, NARROW)}
    data, found = density(records, ModelSettings(noise="ar1"), lambda estimates: known(estimates, **more))
    pair = np.asarray(known(estimate_records(records, "ar1")).log_case)[0, 0]
    expected = by_hand(data, 0, pair, J_MEAN[0], J_SCALE[0], 0.03, rho)
    assert float(found.log_density[0, 0]) == pytest.approx(expected, abs=0.03)


def test_student_noise_has_F_i_and_J_among_what_it_is_integrated_over(records):
    table, _ = simulate(Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=3, points=50), seed=3)
    model = ModelSettings(noise="student")
    prepared = prepare_records(check_record_table(table), model)
    estimates = estimate_records(prepared.batch, whitening=prepared.whitening)
    of, nu = known(estimates, noise_nu=jnp.array([3.0, 20.0])), np.array([3.0, 20.0])
    z = standard_points(unknowns("student"), 0, 8192)
    found = record_density(prepared.likelihood, prepared.data, estimates, of, z)
    for draw, sigma in enumerate((0.03, 0.05)):
        pair = np.asarray(of.log_case)[draw, 0]
        expected = student_by_hand(prepared.data, pair, J_MEAN[draw], J_SCALE[draw], sigma, nu[draw])
        # 8192 points, of which at least a quarter count: a standard error of 2 %, of which four.
        assert float(found.log_density[draw, 0]) == pytest.approx(expected, abs=0.08)
    assert float(jnp.min(found.effective_points)) > 2000


def student_by_hand(data, log_pair, mean_J, sd_J, sigma, nu) -> float:
    """Return the log density of the first record as a sum over F_i and F_i + J."""
    present = np.asarray(data.present[0])
    u, F = np.asarray(data.u[0])[present], np.asarray(data.F[0])[present]
    k, beta = np.exp(log_pair)
    g = 1.0 - np.exp(-np.abs(u) / beta)
    # The force settles on F_i + J + k u: within 15 sigma of there, and of the first points.
    settled = np.median((F - k * u)[g > 0.99])
    starts, ends = (middle + 15.0 * sigma * np.linspace(-1.0, 1.0, 301) for middle in (F[0], settled))
    F_i, end = np.meshgrid(starts, ends)
    off = F - k * u * g - F_i[..., None] - (end - F_i)[..., None] * g
    total = stats.t.logpdf(off, nu, 0.0, sigma).sum(axis=-1) + stats.norm.logpdf(end - F_i, mean_J, sd_J)
    total += stats.norm.logpdf(F_i, F[0], float(data.span[0]))
    return float(np.logaddexp.reduce(total, axis=None) + 2.0 * np.log(0.1 * sigma))


def test_repeats_enter_as_in_the_model(records):
    """A mixture of weight 0 is the normal one, a t of many degrees of freedom nearly, and one of weight 1 is wider."""
    wide = {"log_sd_repeat": jnp.full((2, 3, 2), np.log(0.1)), "sd_log_sigma": jnp.full(2, 0.1)}

    def with_(**other) -> np.ndarray:
        return np.asarray(density(records, ModelSettings(), lambda e: known(e, **wide, **other))[1].log_density)

    usual = with_()
    assert with_(discordant_weight=jnp.full(2, 1e-12)) == pytest.approx(usual, abs=1e-9)
    assert with_(student_nu=jnp.full(2, 1e6)) == pytest.approx(usual, abs=0.1)
    # The data know k and beta far better than the scatter of 10 %: sixfold scatter costs twice log 6 at most.
    discordant = with_(discordant_weight=jnp.full(2, 1.0 - 1e-12))
    assert (usual - discordant <= 2.0 * np.log(6.0) + 0.1).all()
    assert (usual - discordant > 1.0).all()


def test_other_points_change_little(records):
    wide = {"log_sd_repeat": jnp.full((2, 3, 2), np.log(0.1)), "sd_log_sigma": jnp.full(2, 0.3)}
    of = (ModelSettings(), lambda estimates: known(estimates, **wide))
    found = [density(records, *of, seed, POINTS)[1].log_density for seed in (1, 2)]
    assert jax.tree.reduce(jnp.maximum, jnp.abs(found[0] - found[1])).max() < 0.2


@pytest.mark.parametrize(("repeats", "noise"), [("mixture", "ar1"), ("student", "ar1"), ("mixture", "student")])
def test_every_prior_that_acts_on_a_single_record_is_in_the_density(repeats, noise):
    """The model of a record is written here a second time: no prior that the model gains may be left out of it."""
    factors = find_factors(record_factors(simulate(Plan(configurations=("single",), points=20), 1)[0]))
    sites = [name for name in prior_sites(factors, repeats, noise) if not name.endswith("_group")]
    of_records = [name for name in sites if not name.startswith(("sd_log_k_", "sd_log_beta_"))]
    one = xr.DataArray(np.ones((1, 1)), dims=("chain", "draw"))
    posterior = xr.Dataset(dict.fromkeys((*of_records, "sd_log_k_repeat", "sd_log_beta_repeat"), one))
    of_cases = one.expand_dims(case=len(factors.cases))
    posterior = posterior.assign(k_case=of_cases, beta_case=of_cases)

    def populations(posterior: xr.Dataset) -> np.ndarray:
        leaves = jax.tree.leaves(hyperparameters(posterior, factors))
        return np.concatenate([np.ravel(leaf) for leaf in leaves])

    for name in of_records:
        assert (populations(posterior.assign({name: 2.0 * one})) != populations(posterior)).any(), name
