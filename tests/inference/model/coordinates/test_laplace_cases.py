"""What records' estimates say of their cases: odd ones are seen, and move nothing."""

import jax.numpy as jnp
import numpy as np
import pandas as pd

from bayes_tyre.inference.model.coordinates.laplace_cases import case_estimates, find_kinds
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import Factors, find_factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS
from bayes_tyre.inference.model.terms import find_terms

CASES, SCATTER, SD = 40, 0.05, 0.01
SPEEDS, LOADS, STEPS = (0.0, 25.0, 35.0), (10.0, 15.0, 20.0, 25.0, 30.0, 35.0), (-10.0, -5.0, 5.0, 10.0)


def levels_of(repeats: int) -> Factors:
    return find_factors(pd.DataFrame({"configuration": np.repeat([f"case {i:02}" for i in range(CASES)], repeats)}))


def usual(repeats: int) -> np.ndarray:
    """Return logarithms of two parameters of repeats that scatter as usual."""
    random = np.random.default_rng(repeats)
    return np.repeat(random.normal(size=(CASES, 2)), repeats, axis=0) + random.normal(0, SCATTER, (CASES * repeats, 2))


def test_an_odd_record_is_seen_and_moves_no_case():
    values, factors = usual(3), levels_of(3)
    values[4] += [8 * SCATTER, -12 * SCATTER]
    found = case_estimates(values, np.full(values.shape, SD**2), factors)
    assert found.discordant[4]
    np.testing.assert_allclose(found.middle[:, 1], values[[3, 5]].mean(axis=0))
    # Of usual records 0.3 % look odd (simulated, 200,000 of them): more than 5 of 119 in 2e-6 of seeds.
    assert found.discordant.sum() <= 6
    np.testing.assert_allclose(np.exp(found.log_sd_repeat.value), SCATTER, rtol=0.4)


def test_records_that_say_little_are_not_called_odd():
    values, factors = usual(3), levels_of(3)
    values[4] += 0.5
    variances = np.full(values.shape, SD**2)
    variances[4] = 1.0
    assert not case_estimates(values, variances, factors).discordant[4]


def crossed(repeats: int) -> Factors:
    """Return 20 cases of one configuration at five loads and four speeds: 12 more than their effects can fit."""
    rows = [
        {"configuration": "x", "initial_load_kN": load, "speed_km_h": speed}
        for load in (10.0, 15.0, 20.0, 25.0, 30.0)
        for speed in (0.0, 15.0, 25.0, 35.0)
        for _ in range(repeats)
    ]
    return find_factors(pd.DataFrame(rows))


def additive(factors: Factors) -> np.ndarray:
    """Return logarithms of two parameters: effects of load and of speed, 3 % about these, and usual repeats."""
    random, cases = np.random.default_rng(3), factors.of_record
    effects = factors.design("k") @ random.normal(0.0, 0.3, (factors.design("k").shape[1], 2))
    case = effects + 0.03 * random.normal(size=effects.shape)
    return case[cases] + 0.02 * random.normal(size=(len(cases), 2))


def test_a_case_that_stands_apart_is_seen_in_the_parameter_in_which_it_does():
    factors = crossed(3)
    values = additive(factors)
    values[factors.of_record == 7, 0] += 0.4
    found = case_estimates(values, np.full(values.shape, SD**2), factors)
    assert found.apart[0, 7]
    # Of usual cases 0.7 % look as if they stood apart (simulated: more than 3 of 39 in 2 of 1000 seeds).
    assert int(found.apart.sum()) <= 4


def test_where_no_case_can_be_told_to_stand_apart_none_looks_so():
    factors = crossed(1)
    values = additive(factors)
    values[7, 0] += 0.4
    assert not case_estimates(values, np.full(values.shape, SD**2), factors).apart.any()
    assert not case_estimates(usual(3), np.full((3 * CASES, 2), SD**2), levels_of(3)).apart.any()


def test_of_two_that_both_look_odd_neither_is_left_out():
    values, factors = usual(2), levels_of(2)
    values[6:8] = [[-1.0, -1.0], [1.0, 1.0]]
    found = case_estimates(values, np.full(values.shape, SD**2), factors)
    assert found.discordant[6:8].all()
    np.testing.assert_allclose(found.middle[:, 3], [0.0, 0.0], atol=1e-12)


def test_kinds_give_the_normal_equations_of_the_cases():
    random = np.random.default_rng(0)
    rows = [
        {"configuration": configuration, "direction": "loading" if step > 0 else "unloading", "speed_km_h": speed}
        | {"initial_load_kN": load, "step_kN": step}
        for configuration in ("single", "dual")
        for speed in SPEEDS
        for load in LOADS
        for step in STEPS
        for _ in range(random.integers(1, 3))
    ]
    factors = find_factors(pd.DataFrame(rows))
    design = find_terms(factors, PARAMETERS, PRIORS).design
    kinds = find_kinds(design, factors)
    # Three speeds with one repeat, or with two.
    assert kinds.member.shape == (len(factors.cases), 6)
    # Variances alike at one speed with as many repeats, and estimates of the cases that are not.
    alike = np.unique(np.stack([factors.speed.of_case, factors.repeats]), axis=1, return_inverse=True)[1].ravel()
    variance = random.uniform(0.5, 2.0, (len(PARAMETERS), alike.max() + 1))[:, alike]
    values, at = random.standard_normal(variance.shape), random.standard_normal(design.shape[::2])
    estimate = kinds.estimate(values, jnp.asarray(variance))
    precision = np.einsum("pct,pc,pcv->ptv", design, 1.0 / variance, design)
    np.testing.assert_allclose(estimate.precision, precision, atol=1e-9)
    slope = np.einsum("pct,pc->pt", design, (values - np.einsum("pct,pt->pc", design, at)) / variance)
    np.testing.assert_allclose(estimate.slope_at(jnp.asarray(at)), slope, atol=1e-9)
    # With the others held, a term's estimate has its own element of the precision.
    alone = kinds.each_alone(jnp.asarray(at), jnp.asarray(variance))
    np.testing.assert_allclose(alone.precision, np.diagonal(precision, axis1=1, axis2=2), atol=1e-9)
    np.testing.assert_array_equal(alone.value, at)


def test_terms_are_least_squares_of_the_cases():
    random = np.random.default_rng(1)
    rows = [
        {"configuration": configuration, "direction": "loading", "speed_km_h": speed, "initial_load_kN": load}
        for configuration in ("single", "dual")
        for speed in SPEEDS
        for load in LOADS[: 6 if configuration == "dual" else 4]
    ]
    factors = find_factors(pd.DataFrame(rows))
    values = random.standard_normal((len(rows), len(PARAMETERS)))
    found = np.asarray(case_estimates(values, np.full(values.shape, SD**2), factors).terms)
    for parameter, of_one, terms in zip(PARAMETERS, values.T, found, strict=True):
        design = factors.design(parameter)
        expected = np.linalg.lstsq(design, of_one, rcond=None)[0]
        np.testing.assert_allclose(terms[: len(expected)], expected, atol=1e-6)
        assert not terms[len(expected) :].any()


def test_few_cases_keep_a_variance_each():
    rows = pd.DataFrame({"configuration": ["single"], "direction": "loading", "speed_km_h": 0.0, "step_kN": 10.0})
    factors = find_factors(pd.concat([rows.assign(initial_load_kN=load) for load in LOADS], ignore_index=True))
    kinds = find_kinds(find_terms(factors, PARAMETERS, PRIORS).design, factors)
    np.testing.assert_array_equal(kinds.member, np.eye(len(LOADS)))
