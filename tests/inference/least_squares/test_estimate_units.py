"""Units, and where displacement and force are counted from, change no physics, whatever the record holds."""

import numpy as np
import pytest
from helpers.one_record import NAN, Fit, determined, fit_one, record, said, units
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.inference.least_squares.parameters import BETA, C, K

FITTED = [K, C, BETA]


@settings(max_examples=80)
@given(
    decade_d=st.floats(-6, 6),
    decade_F=st.floats(-6, 6),
    k=st.floats(0.5, 4),
    J=st.floats(0.05, 1),
    beta=st.floats(0.02, 0.6),
    sign=st.sampled_from([1, -1]),
)
@pytest.mark.slow
def test_exact_records_return_their_truth_on_any_scale(decade_d, decade_F, k, J, beta, sign):
    d, F, truth = record(k, J, beta, sign)
    mm, kN = 10.0**decade_d, 10.0**decade_F
    found = fit_one(mm * d, kN * F)
    assert found.converged
    assert determined(found)
    off = np.abs(found.value / units(mm, kN) - truth)
    assert np.all(off < 1e-9 * np.array([k, 14.0, beta, 10.0, 14.0]))  # C may be zero: it is told to 1e-9 of F_i
    assert np.sqrt(found.rss) < 1e-12 * kN * np.abs(F).max()


def last_digits(fit: Fit) -> float:
    """Relative tolerance of standard errors.

    The RSS is flat at an optimum, which rounding so leaves uncertain by a millionth of a standard error; the errors
    are those at that optimum, and follow a beta that is hardly determined.
    """
    return 1e-6 * max(1.0, fit.standard_error[BETA] / fit.value[BETA])


SCALED = given(
    decade_d=st.floats(-6, 6),
    decade_F=st.floats(-6, 6),
    k=st.just(0.0) | st.floats(-1, 4),
    J=st.floats(0.05, 1),
    decade_beta=st.floats(-6, 3),
    sign=st.sampled_from([1, -1]),
    noise=st.floats(0.003, 0.3),
    seed=st.integers(0, 9999),
)


@settings(max_examples=150)
@SCALED
@pytest.mark.slow
def test_estimates_scale_as_their_units_do_and_their_status_stays(
    decade_d, decade_F, k, J, decade_beta, sign, noise, seed
):
    """Also with k = 0, with betas that the record does not determine, and with more noise than signal."""
    d, F, _ = record(k, J, 10.0**decade_beta, sign, noise=noise, seed=seed)
    mm, kN = 10.0**decade_d, 10.0**decade_F
    here, there = fit_one(d, F), fit_one(mm * d, kN * F)
    assert said(there) == said(here)
    assert there.rss == pytest.approx(here.rss * kN**2, rel=1e-9)
    if determined(here):  # or the value of beta is any of many that fit alike
        off = np.abs(there.value / units(mm, kN) - here.value)[FITTED]
        assert np.all(off < 1e-6 * here.standard_error[FITTED])
        np.testing.assert_allclose(there.standard_error, here.standard_error * units(mm, kN), rtol=last_digits(here))


@settings(max_examples=60)
@given(
    d_0=st.floats(-1e6, 1e6),
    F_0=st.floats(-1e4, 1e4),
    k=st.just(0.0) | st.floats(0.5, 4),
    beta=st.floats(0.05, 0.6),
    seed=st.integers(0, 9999),
)
@pytest.mark.slow
def test_where_displacement_and_force_are_counted_from_does_not_matter(d_0, F_0, k, beta, seed):
    d, F, _ = record(k, beta=beta, d_i=0.0, noise=0.03, seed=seed)
    # In steps of 2^-12, so that a large offset rounds no displacement; and counted from its first point, C is the
    # line's force there: with that of another offset its errors give those of every C.
    d, d_0 = np.round(d * 4096) / 4096, np.round(d_0)
    here, one_off, there = fit_one(d, F), fit_one(d + 1.0, F), fit_one(d + d_0, F + F_0)
    assert said(there) == said(here)
    if not determined(here):
        return
    off = np.abs(there.value - here.value)[[K, BETA]]
    assert np.all(off < 1e-6 * here.standard_error[[K, BETA]])
    np.testing.assert_allclose(there.standard_error[[K, BETA]], here.standard_error[[K, BETA]], rtol=last_digits(here))
    k_var, line_var, one_off_var = (
        here.standard_error[K] ** 2,
        here.standard_error[C] ** 2,
        one_off.standard_error[C] ** 2,
    )
    C_var = line_var + d_0 * (one_off_var - line_var - k_var) + d_0**2 * k_var
    assert there.standard_error[C] == pytest.approx(np.sqrt(C_var), rel=last_digits(here))
    assert there.value[C] == pytest.approx(here.value[C] + F_0 - here.value[K] * d_0, abs=1e-6 * np.sqrt(C_var))


@pytest.mark.parametrize("k", [0.0, 1.6])
@pytest.mark.parametrize("beta", [0.05, 1.0])
def test_newtons_and_metres_give_the_same_physics(k, beta):
    d, F, _ = record(k, beta=beta, noise=0.03)
    here, there = fit_one(d, F), fit_one(1e-3 * d, 1e3 * F)
    factors = units(1e-3, 1e3)
    assert said(there) == said(here)
    assert np.all(np.abs(there.value / factors - here.value)[FITTED] < 1e-6 * here.standard_error[FITTED])
    np.testing.assert_allclose(there.standard_error, here.standard_error * factors, rtol=1e-6)


def test_a_bound_scales_with_its_units():
    d, F, _ = record(noise=0.03)
    bounds, factors = {"k": (-np.inf, 1.5), "beta": (0.05, 2.0)}, units(1e-3, 1e3)
    scaled = {"k": (-np.inf, 1.5 * factors[K]), "beta": (0.05 * factors[BETA], 2.0 * factors[BETA])}
    here, there = fit_one(d, F, bounds=bounds), fit_one(1e-3 * d, 1e3 * F, bounds=scaled)
    assert said(there) == said(here)
    assert here.at_bound.tolist() == [True, False, False, False, False]
    assert np.isnan(here.standard_error[K])
    np.testing.assert_allclose(there.value, here.value * factors, rtol=1e-6)
    np.testing.assert_allclose(
        there.standard_error, np.where(here.at_bound, NAN, here.standard_error * factors), rtol=1e-6
    )
