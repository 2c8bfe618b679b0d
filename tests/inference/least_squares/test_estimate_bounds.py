"""Bounds: the estimates of scipy's bounded solver, never outside, exact where they end on one."""

import numpy as np
import pytest
from helpers.one_record import Bounds, equation_2, fit_one, record
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize

from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, PARAMETERS, C, K

INF = np.inf
FITTED = (K, C, BETA)
#: The fit without bounds is near k 1.6, C -1.6 (loading) or -2.4 (unloading), beta 0.1, F_i 14.
CASES: dict[str, tuple[Bounds, str]] = {
    "k from above": ({"k": (-INF, 1.5)}, "k"),
    "k from below": ({"k": (1.7, INF)}, "k"),
    "k far off": ({"k": (-INF, 0.2)}, "k"),
    "k at zero": ({"k": (-1.0, 0.0)}, "k"),
    "k between, inactive": ({"k": (0.0, 3.0)}, ""),
    "k barely": ({"k": (-INF, 1.595)}, ""),
    "C from above": ({"C": (-INF, -3.0)}, "C"),
    "C from below": ({"C": (0.5, INF)}, "C"),
    "C between, inactive": ({"C": (-9.0, 9.0)}, ""),
    "beta from above": ({"beta": (-INF, 0.05)}, "beta"),
    "beta from below": ({"beta": (0.3, INF)}, "beta"),
    "beta between": ({"beta": (0.01, 0.08)}, "beta"),
    "beta inactive": ({"beta": (0.0, 1.0)}, ""),
    "k and beta": ({"k": (1.7, INF), "beta": (0.2, INF)}, "k beta"),
    "k and C": ({"k": (1.61, 2.0), "C": (-INF, -3.0)}, "C"),
    "all, none active": ({"k": (0.0, 3.0), "C": (-9.0, 9.0), "beta": (0.001, 1.0)}, ""),
    "all, in a corner": ({"k": (1.7, 1.8), "C": (-1.0, 0.0), "beta": (0.2, 0.3)}, "k C beta"),
    "F_i from above": ({"F_i": (-INF, 13.9)}, "F_i"),
    "F_i and k": ({"F_i": (14.1, 14.2), "k": (0.0, 1.5)}, "F_i k"),
    "F_i inactive": ({"F_i": (13.0, 15.0)}, ""),
}


def scipy_fit(d: np.ndarray, F: np.ndarray, free: tuple[int, ...], bounds: Bounds) -> tuple[np.ndarray, float]:
    """Values and RSS of scipy's trust region reflective solver from several betas, the best."""
    low, high = np.array([bounds.get(PARAMETERS[i], (-INF, INF)) for i in free]).T
    low[free.index(BETA)] = max(low[free.index(BETA)], 1e-9)
    base = np.array([0.0, 0.0, 1.0, d[0], F[0]])

    def residual(x: np.ndarray) -> np.ndarray:
        value = base.copy()
        value[list(free)] = x
        return equation_2(d, value) - F

    inside = 1e-6 * np.where(np.isfinite(high - low), high - low, 1.0)
    fits = []
    for beta in (0.02, 0.2, 2.0):
        start = np.array([1.6, 14.0 - 1.6 * d[0], beta, d[0], F[0]])[list(free)]
        x0 = np.clip(start, low + inside, high - inside)
        sharp = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 3000}
        fits.append(optimize.least_squares(residual, x0, bounds=(low, high), x_scale="jac", jac="3-point", **sharp))
    best = min(fits, key=lambda fit: fit.cost)
    return best.x, 2 * float(best.cost)


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("case", CASES)
def test_bounded_estimates_are_those_of_scipy(case, sign):
    bounds, _ = CASES[case]
    free = (*FITTED, F_I) if "F_i" in bounds else FITTED
    d, F, _ = record(sign=sign, noise=0.03)
    found = fit_one(d, F, free, bounds)
    x, rss = scipy_fit(d, F, free, bounds)
    assert found.converged
    assert found.rss == pytest.approx(rss, rel=1e-9)
    np.testing.assert_allclose(found.value[list(free)], x, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("case", CASES)
def test_who_ends_on_a_bound_has_its_value_to_the_digit_and_no_standard_error(case):
    bounds, active = CASES[case]
    free = (*FITTED, F_I) if "F_i" in bounds else FITTED
    found = fit_one(*record(noise=0.03)[:2], free, bounds)
    at_bound = [name for name, there in zip(PARAMETERS, found.at_bound, strict=True) if there]
    assert set(at_bound) == set(active.split())
    for name in at_bound:
        assert found.value[PARAMETERS.index(name)] in bounds[name]
    np.testing.assert_array_equal(np.isfinite(found.standard_error), np.isin(range(5), free) & ~found.at_bound)


@pytest.mark.parametrize("name", ["k", "C", "beta"])
def test_the_others_have_the_errors_of_a_fit_with_the_one_at_its_bound_fixed_there(name):
    d, F, truth = record(noise=0.03)
    i = PARAMETERS.index(name)
    bound = truth[i] * (1.2 if truth[i] > 0 else 0.8)
    bounded = fit_one(d, F, FITTED, {name: (bound, INF)})
    assert bounded.at_bound[i]
    others = [j for j in FITTED if j != i]
    steps = np.diag(1e-5 * np.abs(bounded.value))[others]
    at = bounded.value
    jacobian = np.stack([(equation_2(d, at + h) - equation_2(d, at - h)) / (2 * h.sum()) for h in steps], axis=1)
    variance = np.sum((F - equation_2(d, at)) ** 2) / (len(d) - 2)
    expected = np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    np.testing.assert_allclose(bounded.standard_error[others], expected, rtol=1e-6)
    assert np.isnan(bounded.standard_error[i])


def test_bounds_that_are_not_active_change_nothing():
    d, F, _ = record(noise=0.03)
    free, bounded = fit_one(d, F), fit_one(d, F, bounds={"k": (0.0, 5.0), "beta": (1e-6, 10.0)})
    assert not bounded.at_bound.any()
    off = np.abs(bounded.value - free.value)[list(FITTED)]
    assert np.all(off < 1e-6 * free.standard_error[list(FITTED)])
    np.testing.assert_allclose(bounded.standard_error, free.standard_error, rtol=1e-6)


def test_a_start_or_the_first_point_outside_is_brought_inside():
    d, F, _ = record(noise=0.03)
    found = fit_one(d, F, (*FITTED, D_I, F_I), {"d_i": (10.5, 11.0), "F_i": (20.0, 21.0)}, k=1.0)
    assert found.converged
    assert 10.5 <= found.value[D_I] <= 11.0
    assert 20.0 <= found.value[F_I] <= 21.0


SIDES = st.tuples(st.floats(-3, 3), st.floats(0.001, 3), st.sampled_from(["both", "low", "high", "none"]))


@settings(max_examples=120)
@given(
    sides=st.tuples(*[SIDES] * 4),
    k=st.just(0.0) | st.floats(-1, 4),
    decade_beta=st.floats(-4, 2),
    noise=st.floats(0.003, 0.3),
    seed=st.integers(0, 9999),
)
@pytest.mark.slow
def test_no_value_is_ever_outside_and_none_is_worse_than_the_record_s_truth_brought_inside(
    sides, k, decade_beta, noise, seed
):
    d, F, truth = record(k, beta=10.0**decade_beta, noise=noise, seed=seed)
    bounds = {}
    for name, (middle, width, which) in zip(("k", "C", "beta", "F_i"), sides, strict=True):
        low = truth[PARAMETERS.index(name)] + middle
        low = 10.0 ** (decade_beta + middle) if name == "beta" else low
        bounds[name] = (low if which in ("both", "low") else -INF, low + width if which in ("both", "high") else INF)
    low, high = np.array([bounds.get(name, (-INF, INF)) for name in PARAMETERS]).T
    found = fit_one(d, F, (*FITTED, F_I), bounds)
    fitted = [K, C, BETA, F_I]
    assert found.converged
    assert np.all((low <= found.value) & (found.value <= high))
    assert np.all((found.value == low)[found.at_bound] | (found.value == high)[found.at_bound])
    assert np.isnan(found.standard_error[found.at_bound]).all()
    inside = np.clip(truth, low, high)
    at_inside = np.sum((equation_2(d, inside) - F) ** 2)
    assert found.rss <= at_inside * (1 + 1e-9) or found.beta_open_above
    assert found.value[D_I] == d[0]
    assert np.isfinite(found.value[fitted]).all()


def test_a_beta_near_a_bound_far_below_the_travel_is_not_on_it():
    d, F, _ = record(beta=1e-6, noise=0.03)
    found = fit_one(d, F, bounds={"beta": (1e-12, 2e-12)}, beta=1.2e-12)
    assert 1e-12 <= found.value[BETA] <= 2e-12
    assert found.at_bound[BETA] == (found.value[BETA] in (1e-12, 2e-12))


def test_where_beta_is_bounded_to_a_side_it_is_not_open_to_it():
    d, F, _ = record(beta=1e-6, noise=0.03)
    assert fit_one(d, F).beta_open_below
    bounded = fit_one(d, F, bounds={"beta": (0.001, INF)})
    assert not bounded.beta_open_below
    assert bounded.value[BETA] >= 0.001
    assert np.isnan(bounded.standard_error[BETA]) == bounded.at_bound[BETA]
