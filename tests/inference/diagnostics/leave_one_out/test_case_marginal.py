"""The density of all records of a case, against a quadrature over its k and beta of the densities of its records."""

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.simulated_records import Plan, simulate
from scipy import stats

from bayes_tyre.inference.diagnostics.leave_one_out.case_marginal import case_population, densities_of_cases
from bayes_tyre.inference.diagnostics.leave_one_out.record_marginal import (
    hyperparameters,
    record_density,
    standard_points,
    unknowns,
)
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.prepared_records import PreparedRecords, prepare_records
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.inference.sampling.datatree import to_datatree
from bayes_tyre.record_table import check_record_table

#: Eight cases of three repeats, one of them discordant; two loads.
PLAN = Plan(speeds=(0.0,), points=40, discordant=("single (0)20-30(2)",))
GROUP_K, GROUP_BETA, OF_LOAD = np.array([2.2, 2.2, 1.6, 1.6]), np.full(4, 0.05), np.array([0.03, -0.03])
REMAINDER, SCATTER = (0.08, 0.3), (0.04, 0.08)
#: Nodes along log k and log beta, and standard deviations of the normal that they are of.
NODES, ABOUT = 16, (0.06, 0.12)


@pytest.fixture(scope="module")
def records() -> PreparedRecords:
    return prepare_records(check_record_table(simulate(PLAN, seed=5)[0]), ModelSettings(noise="iid"))


def posterior_of(records: PreparedRecords, weight: float | None) -> xr.Dataset:
    """Return two draws of hyperparameters, the second with wider repeats."""
    cases = len(records.factors.cases)
    values = {
        **{"k_group": GROUP_K, "beta_group": GROUP_BETA, "log_k_load": OF_LOAD, "log_beta_load": -2 * OF_LOAD},
        **{"sd_log_k_case": REMAINDER[0], "sd_log_beta_case": REMAINDER[1]},
        **{"sd_log_k_repeat": SCATTER[0], "sd_log_beta_repeat": SCATTER[1]},
        **{"sd_J": 0.2, "J_group": np.array([0.4, -0.4, 0.4, -0.4]), "sigma_typical": 0.03, "sd_log_sigma": 0.1},
        **{"k_case": np.ones(cases), "beta_case": np.ones(cases)},
        **({} if weight is None else {"discordant_weight": weight}),
        **{f"log_{name}_configuration_load": np.zeros(4) for name in ("k", "beta")},
    }
    arrays = {}
    for name, value in values.items():
        of_draw = np.stack([value, value * (1.5 if name.endswith("_repeat") else 1.0)])
        dims = ("chain", "draw", *(["own"] if of_draw.ndim > 1 else []))
        arrays[name] = xr.DataArray(of_draw[None], dims=[dim if dim != "own" else f"of_{name}" for dim in dims])
    return xr.Dataset(arrays)


def test_the_linear_predictor_and_the_scales_are_the_posteriors(records):
    population, factors = case_population(posterior_of(records, None), records.factors), records.factors
    load = [OF_LOAD[factors.load.labels.index(case.initial_load_kN)] for case in factors.cases]
    group = [GROUP_K[0 if case.configuration == "dual" else 2] for case in factors.cases]
    np.testing.assert_allclose(population.mean[0, 0], np.log(group) + load, rtol=1e-12)
    np.testing.assert_allclose(population.mean[1, 1], np.log(0.05) - 2 * np.array(load), rtol=1e-12)
    np.testing.assert_allclose(population.remainder[:, :, 0], [REMAINDER, REMAINDER])
    np.testing.assert_allclose(population.sd_repeat[1, 1], 1.5 * SCATTER[1])
    assert not np.asarray(population.offset).any()


def test_levels_whose_effect_is_zero_by_construction_are_not_in_a_posterior(records):
    factors = find_factors(
        pd.DataFrame(
            [
                {"configuration": "a", "direction": direction, "initial_load_kN": load, "step_kN": way * step}
                for direction, way, steps in (("loading", 1.0, (5.0, 7.0)), ("unloading", -1.0, (5.0,)))
                for step in steps
                for load in (20.0, 30.0, 40.0)
            ]
        )
    )
    free = factors.direction_step.free
    assert not free.all()
    random, draws = np.random.default_rng(0), 3
    effects = {f"log_beta_{name}": factor for name, factor in factors.effects("beta").items()}
    sites = {name: random.normal(size=(1, draws, len(factor.labels))) for name, factor in effects.items()}
    sites |= {f"log_k_{name}": 0.0 * sites[f"log_beta_{name}"] for name in factors.effects("k")}
    sites |= {f"{name}_group": np.ones((1, draws, len(factors.group.labels))) for name in ("k", "beta")}
    sites |= {f"sd_log_{name}_repeat": np.full((1, draws), 0.05) for name in ("k", "beta")}
    tree = to_datatree(sites, {"diverging": np.zeros((1, draws), bool)}, factors, pd.DataFrame({"record": []}), {})
    population = case_population(tree["posterior"].to_dataset(), factors)
    expected = np.zeros((draws, len(factors.cases)))
    for name, factor in effects.items():
        zero_or_all = np.where(factor.free if name.endswith("direction_step") else True, sites[name][0], 0.0)
        expected += zero_or_all[:, factor.of_case]
    np.testing.assert_allclose(population.mean[:, 1], expected, atol=1e-12)


@pytest.mark.parametrize("weight", [None, 0.1])
def test_it_is_the_integral_over_the_case_of_the_densities_of_its_records(records, weight):
    posterior, model = posterior_of(records, weight), ModelSettings(noise="iid")
    found = densities_of_cases(posterior, records, model)
    assert np.asarray(found.effective_points).min() > 20
    expected = np.stack([by_quadrature(posterior, records, model, draw) for draw in range(2)])
    # 128 points whose weights vary by a few per cent, of case, noise and what is not quadratic: within 5 % of a density
    # that varies by factors of thousands from case to case. With a discordant repeat weights vary more.
    np.testing.assert_allclose(np.asarray(found.log_density), expected, atol=0.1)


def by_quadrature(posterior: xr.Dataset, records: PreparedRecords, model: ModelSettings, draw: int) -> np.ndarray:
    """Return the log density of each case at one draw, by Gauss-Hermite quadrature over log k and log beta."""
    of, factors = hyperparameters(posterior, records.factors), records.factors
    estimates = estimate_records(records.batch, model.correlation, records.whitening)
    own = np.asarray(estimates.centre[:, 2:])
    # The median of three repeats: a discordant one is not where the case is.
    middle = np.stack([np.median(own[factors.of_record == case], axis=0) for case in range(len(factors.cases))])
    x, w = np.polynomial.hermite_e.hermegauss(NODES)
    z = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    log_w = np.log(np.outer(w, w).ravel() / w.sum() ** 2)
    at = middle + z[:, None] * np.array(ABOUT)
    one = of._replace(**{
        name: jnp.broadcast_to(value[draw], (len(z), *value.shape[1:]))
        for name, value in of._asdict().items() if value is not None
    })  # fmt: skip
    one = one._replace(log_case=jnp.asarray(at[:, factors.of_record]))
    points = standard_points(unknowns(model.correlation), 1, 512)
    log_records = np.asarray(record_density(records.likelihood, records.data, estimates, one, points).log_density)
    log_cases = np.zeros((len(z), len(factors.cases)))
    np.add.at(log_cases.T, factors.of_record, log_records.T)
    population = case_population(posterior, factors)
    prior = stats.norm.logpdf(at, np.asarray(population.mean[draw]).T, REMAINDER).sum(axis=-1)
    proposal = stats.norm.logpdf(at, middle, ABOUT).sum(axis=-1)
    return np.logaddexp.reduce(log_w[:, None] + log_cases + prior - proposal, axis=0)
