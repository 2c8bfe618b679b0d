"""The ring fitted to frequencies: against quadrature, known truths, what is not identified, and rings that are none."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from bayes_tyre.inference.flexible_ring import PARAMETERS, PRIORS, MeasuredModes, RingFit, fit_ring
from bayes_tyre.laws.flexible_ring import FlexibleRing

TRUTH = {"bending": 120.0, "tension": 3.4e4, "radial": 2.2e5, "tangential": 7e4}


def measured(mode, sd: float | None, frequency=None, noise: float = 0.0, **conditions) -> MeasuredModes:
    """Return modes of the truth with noise, Hz, or with the frequencies given."""
    n = np.asarray(mode, float)
    given = {"pressure_bar": None, "spin": np.zeros_like(n), "wave": np.zeros_like(n)} | conditions
    modes = MeasuredModes(n, n, None if sd is None else np.full(len(n), sd), **given)
    truth = np.asarray(modes.fitted(jnp.asarray([TRUTH[name] for name in PARAMETERS])))
    noisy = truth + noise * np.random.default_rng(3).standard_normal(len(n))
    return modes._replace(frequency_Hz=noisy if frequency is None else np.asarray(frequency, float))


def weighted_quantiles(values: np.ndarray, density: np.ndarray) -> np.ndarray:
    order = np.argsort(values, axis=None)
    cumulated = np.cumsum(density.ravel()[order])
    return np.interp([0.1, 0.5, 0.9], cumulated / cumulated[-1], values.ravel()[order])


def standard_grid(name: str, points: int = 1201) -> tuple[np.ndarray, np.ndarray]:
    """Return a grid of a parameter over its prior, and the log density of its logarithm."""
    location, scale = PRIORS[name].parameters
    z = np.linspace(-5, 5, points)
    return np.exp(location + scale * z), -(z**2) / 2


#: Monte Carlo error of a quantile's probability: 4000 draws leave 0.008; five of them in twelve comparisons.
MOST = 0.04


def probabilities(draws: np.ndarray, quantiles: np.ndarray) -> np.ndarray:
    return (draws[:, None] <= quantiles).mean(axis=0)


@pytest.mark.parametrize("sd", [0.2, 5.0])
def test_mode_1_gives_a_sum_of_two_stiffnesses_as_quadrature_has_it(sd):
    fit = fit_ring(measured([1], sd, frequency=[62.0]))
    (radial, first), (tangential, second) = standard_grid("radial"), standard_grid("tangential")
    frequency = np.sqrt((radial[:, None] + tangential) / 2) / (2 * np.pi)
    density = np.exp(first[:, None] + second + stats.norm.logpdf(62.0, frequency, sd))
    for name, values in (
        ("radial", radial[:, None] + 0 * tangential),
        ("tangential", tangential + 0 * radial[:, None]),
    ):
        found = probabilities(fit.draws[name], weighted_quantiles(values, density))
        np.testing.assert_allclose(found, [0.1, 0.5, 0.9], atol=MOST)
    assert (fit.rank, fit.verdict) == (1, "pass")
    for name in ("bending", "tension"):  # mode 1 does not know of them: the prior stays
        location, scale = PRIORS[name].parameters
        assert stats.kstest(np.log(fit.draws[name]), stats.norm(location, scale).cdf).pvalue > 1e-4
        assert "not identified: 1.0 times narrower" in fit.status[name]


def test_a_standard_deviation_that_is_not_given_is_estimated_as_quadrature_has_it():
    frequencies = np.array([41.0, 44.0, 42.5])
    fit = fit_ring(measured([0, 0, 0], None, frequency=frequencies))
    (tangential, first), (sigma, second) = standard_grid("tangential"), standard_grid("sigma")
    fitted = np.sqrt(tangential)[:, None, None] / (2 * np.pi)
    likelihood = stats.norm.logpdf(frequencies, fitted, sigma[:, None]).sum(axis=2)
    density = np.exp(first[:, None] + second + likelihood)
    for name, values in (("tangential", tangential[:, None] + 0 * sigma), ("sigma", sigma + 0 * tangential[:, None])):
        found = probabilities(fit.draws[name], weighted_quantiles(values, density))
        np.testing.assert_allclose(found, [0.1, 0.5, 0.9], atol=MOST)


def assert_covers(fit: RingFit, names: tuple[str, ...]) -> None:
    """Assert that 99.8 % intervals hold the truth: eight of them, one seed in sixty does not."""
    for name in names:
        lower, upper = np.quantile(fit.draws[name], [0.001, 0.999])
        assert lower < TRUTH[name] < upper, name


def test_many_good_modes_identify_all_four():
    fit = fit_ring(measured([0, 1, 2, 3, 4, 5, 6, 7], 0.3, noise=0.3))
    assert set(fit.status.values()) == {"ok"}
    assert (fit.rank, fit.verdict) == (4, "pass")
    assert_covers(fit, PARAMETERS)


def test_pressure_and_rotation_are_in_the_model():
    mode, pressure = [1, 2, 3, 4, 2, 2, 3, 4], np.array([0.5, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 1.5])
    spin, wave = np.array([0, 0, 0, 0, 0, 40.0, 40.0, 0]), np.array([0, 0, 0, 0, 0, 1.0, -1.0, 0])
    modes = measured(mode, 0.2, noise=0.2, pressure_bar=pressure, spin=spin, wave=wave)
    assert modes.priors["tension"].unit == "1/s^2/bar"
    fit = fit_ring(modes)
    assert fit.verdict == "pass"
    assert_covers(fit, ("tension", "radial", "tangential"))
    without = fit_ring(modes._replace(wave=-wave))  # the wrong wave: off by twice the split
    assert [check.name for check in without.checks if not check.passed] == ["ring"]


def test_frequencies_that_no_ring_has_fail_the_verdict_by_name_and_are_written():
    modes = measured([1, 2, 3, 4, 5, 6], 0.5, noise=0.5)
    off = modes.frequency_Hz.copy()
    off[3] += 10.0
    fit = fit_ring(modes._replace(frequency_Hz=off))
    assert fit.verdict == "fail"
    (check,) = (check for check in fit.checks if not check.passed)
    assert (check.name, check.kind, check.where) == ("ring", "model", "mode 4")
    assert check.value > check.limit == pytest.approx(stats.chi2.ppf(0.99, 2))


def test_frequencies_far_from_every_ring_fail_the_verdict_and_claim_nothing():
    for sd in (0.01, 1.0):
        fit = fit_ring(measured([1, 2, 3, 4, 5], sd, frequency=[180.0, 150.0, 100.0, 60.0, 20.0]))
        failed = {check.name for check in fit.checks if not check.passed}
        assert failed >= {"ring", "effective"}
        assert set(fit.status.values()) == {"not determined: the sampling failed"}
        assert all(np.isfinite(draws).all() and (draws > 0).all() for draws in fit.draws.values())


def test_without_standard_deviations_or_with_as_many_parameters_nothing_can_be_refuted():
    for modes in (measured([1, 2, 3, 4, 5, 6], None, noise=0.5), measured([1, 2, 3, 4], 0.5, noise=0.5)):
        assert "ring" not in {check.name for check in fit_ring(modes).checks}


def test_the_same_seed_gives_the_same_draws():
    modes = measured([1, 2], 0.5)
    one, same, other = (fit_ring(modes, seed) for seed in (1, 1, 2))
    assert all((one.draws[name] == same.draws[name]).all() for name in PARAMETERS)
    assert (one.draws["radial"] != other.draws["radial"]).any()


def test_fitted_frequencies_are_those_of_the_law():
    ring = FlexibleRing(**TRUTH)
    np.testing.assert_array_equal(measured([2, 3], 1.0).frequency_Hz, ring.frequencies(np.array([2.0, 3.0])))
