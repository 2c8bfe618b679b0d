"""Posterior predictive: bands hold new points at the stated rate, and residuals show the noise that was there."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered
from scipy.stats import binom

from bayes_tyre.inference.diagnostics.residuals import autocorrelations, residuals
from bayes_tyre.results.figure_data import posterior_predictive

#: Probability that a correct band fails a coverage test, both sides together.
FALSE_ALARM = 1e-4


def curve(u: np.ndarray, F_i: float, J: float, k: float, beta: float) -> np.ndarray:
    return F_i + (J + k * u) * (1.0 - np.exp(-np.abs(u) / beta))


def path(points: int) -> np.ndarray:
    return 3.0 * (1.0 - np.cos(np.linspace(0.0, np.pi, points))) / 2.0


def ar1(rng: np.random.Generator, rho: float, points: int) -> np.ndarray:
    """Return stationary AR(1) noise of unit variance."""
    noise = rng.normal(size=points)
    for i in range(1, points):
        noise[i] = rho * noise[i - 1] + np.sqrt(1.0 - rho**2) * noise[i]
    return noise


def known(
    records: int, sigma: float = 0.03, *, spread: Mapping[str, np.ndarray] | None = None
) -> tuple[xr.DataTree, dict[str, float]]:
    """Return a posterior that is sure of the truth, or that has the draws given, and the truth."""
    truth = {"F_i": 20.0, "J": 0.4, "k": 1.8, "beta": 0.05, "sigma": sigma}
    draws = {name: fixed(np.full(records, value), draws=500) for name, value in truth.items()} | dict(spread or {})
    names = [f"r{i}" for i in range(records)]
    return posterior(draws, pd.DataFrame({"record": names})), truth


def table_of(forces: list[np.ndarray], displacements: list[np.ndarray]) -> pd.DataFrame:
    frames = [
        pd.DataFrame({"record": f"r{i}", "displacement_mm": d, "force_kN": F})
        for i, (d, F) in enumerate(zip(displacements, forces, strict=True))
    ]
    return pd.concat(frames, ignore_index=True)


def binomial_bounds(trials: int, rate: float) -> tuple[float, float]:
    """Return the shares of hits that a true `rate` leaves with probability `FALSE_ALARM`."""
    low, high = binom.ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2], trials, rate)
    return low / trials, high / trials


@pytest.mark.parametrize("interval", [0.95, 0.5])
def test_bands_hold_new_points_of_a_known_record_at_the_stated_rate(interval):
    tree, truth = known(1)
    d = 12.0 + path(4000)
    band = posterior_predictive.predictive_bands(tree, table_of([np.linspace(0, 1, 4000)], [d]), ["r0"], interval)
    F_i, J, k, beta, sigma = truth.values()
    new = curve(d - d[0], F_i, J, k, beta) + sigma * np.random.default_rng(11).normal(size=len(d))
    inside = np.mean((band["lower_kN"] < new) & (new < band["upper_kN"]))
    # Quantiles of 1000 draws cover 0.2 % less than they say on average; points are independent.
    low, high = binomial_bounds(len(d), interval)
    assert low - 0.002 <= inside <= high


@pytest.mark.parametrize("interval", [0.95, 0.5])
def test_bands_hold_new_points_at_the_stated_rate_when_parameters_are_uncertain(interval):
    records, rng = 1000, np.random.default_rng(12)
    spread = {"F_i": 0.03 * rng.normal(size=(2, 500, records)), "J": 0.05 * rng.normal(size=(2, 500, records))}
    shifted = {"F_i": 20.0 + spread["F_i"], "J": 0.4 + spread["J"]}
    tree, truth = known(records, sigma=0.03, spread=shifted)
    d, names = [path(8)] * records, [f"r{i}" for i in range(records)]
    band = posterior_predictive.predictive_bands(tree, table_of([np.linspace(0, 1, 8)] * records, d), names, interval)
    end = band.groupby("record", sort=False).last()
    F_i, J = 20.0 + 0.03 * rng.normal(size=records), 0.4 + 0.05 * rng.normal(size=records)
    new = F_i + (J + truth["k"] * 3.0) + truth["sigma"] * rng.normal(size=records)  # beta is far behind at 3 mm
    inside = np.mean((end["lower_kN"] < new) & (new < end["upper_kN"]))
    low, high = binomial_bounds(records, interval)  # one point a record: independent
    assert low - 0.002 <= inside <= high


def test_the_middle_of_a_band_is_equation_2_and_its_width_the_noise():
    tree, truth = known(1, sigma=0.001)
    d = 5.0 - path(60)  # unloading
    band = posterior_predictive.predictive_bands(tree, table_of([np.linspace(1, 0, 60)], [d]), ["r0"])
    F_i, J, k, beta, sigma = truth.values()
    np.testing.assert_allclose(band["median_kN"], curve(d - d[0], F_i, J, k, beta), atol=5 * sigma / np.sqrt(1000))
    np.testing.assert_allclose(band["upper_kN"] - band["lower_kN"], 2 * 1.96 * sigma, rtol=0.25)
    np.testing.assert_array_equal(band["displacement_mm"], d)
    assert list(band.columns) == ["record", "displacement_mm", "median_kN", "lower_kN", "upper_kN"]


def test_a_band_is_as_wide_as_the_tails_of_the_noise():
    tree, truth = known(1, sigma=0.001, spread={"noise_nu": fixed(2.0, draws=500)})
    d = path(60)
    band = posterior_predictive.predictive_bands(tree, table_of([np.linspace(0, 1, 60)], [d]), ["r0"])
    # The 97.5 % quantile of a t(2) is 4.30, of a normal 1.96; over 60 points of 1,000 draws 1.3 % of it is uncertain.
    width = (band["upper_kN"] - band["lower_kN"]).mean()
    assert width == pytest.approx(2 * 4.30 * truth["sigma"], rel=0.06)


def test_bands_stand_at_the_points_of_the_records_asked_for_whatever_their_length():
    tree, _ = known(4)
    lengths = [20, 31, 12, 40]
    table = table_of([np.linspace(0, 1, n) for n in lengths], [i + path(n) for i, n in enumerate(lengths)])
    band = posterior_predictive.predictive_bands(tree, table, ["r3", "r1"])
    assert band.groupby("record").size().to_dict() == {"r1": 31, "r3": 40}
    for record, rows in band.groupby("record"):
        mine = table.loc[table["record"] == record, "displacement_mm"]
        np.testing.assert_array_equal(rows["displacement_mm"], mine)


def test_a_record_gets_the_band_of_its_own_draws():
    level = np.stack([fixed(10.0, draws=500), fixed(30.0, draws=500)], axis=-1)
    tree, _ = known(2, spread={"F_i": level})
    band = posterior_predictive.predictive_bands(
        tree, table_of([np.linspace(0, 1, 20)] * 2, [path(20)] * 2), ["r0", "r1"]
    )
    first = band.groupby("record")["median_kN"].first()
    assert first.to_dict() == pytest.approx({"r0": 10.0, "r1": 30.0}, abs=0.01)


def test_the_same_posterior_gives_the_same_band():
    tree, _ = known(1)
    table = table_of([np.linspace(0, 1, 20)], [path(20)])
    one, same = (posterior_predictive.predictive_bands(tree, table, ["r0"]) for _ in range(2))
    pd.testing.assert_frame_equal(one, same, check_exact=True)


def test_the_autocorrelation_of_ragged_records_is_that_of_each_alone():
    rng = np.random.default_rng(14)
    lengths = [33, 90, 60, 47, 12]
    tree, truth = known(len(lengths))
    F_i, J, k, beta, sigma = truth.values()
    forces = [curve(path(n), F_i, J, k, beta) + sigma * ar1(rng, 0.99 if n == 90 else 0.5, n) for n in lengths]
    alone = []
    for force, n in zip(forces, lengths, strict=True):
        left = force - curve(path(n), F_i, J, k, beta)
        left -= left.mean()
        alone.append(np.sum(left[1:] * left[:-1]) / np.sum(left**2))
    found = autocorrelations(residuals(tree, table_of(forces, [7.0 + path(n) for n in lengths])))
    np.testing.assert_allclose(found, alone, rtol=1e-6)


def test_residual_tables_hold_the_records_asked_for_and_a_row_for_every_record():
    tree, truth = known(3)
    F_i, J, k, beta, _ = truth.values()
    lengths, rng = (20, 33, 12), np.random.default_rng(19)
    noise = [0.03 * rng.normal(size=n) for n in lengths]
    forces = [curve(path(n), F_i, J, k, beta) + e for n, e in zip(lengths, noise, strict=True)]
    table = table_of(forces, [5.0 + path(n) for n in lengths]).assign(configuration="a")
    found = residuals(tree, table)
    points, every = posterior_predictive.residual_tables(found, table, ["r0", "r2"])
    assert points.groupby("record").size().to_dict() == {"r0": 20, "r2": 12}
    for name, left in (("r0", noise[0]), ("r2", noise[2])):
        mine = points[points["record"] == name]
        np.testing.assert_allclose(mine["residual_kN"], left, atol=1e-12)
        np.testing.assert_array_equal(mine["displacement_mm"], table.loc[table["record"] == name, "displacement_mm"])
    assert every[["record", "configuration"]].to_numpy().tolist() == [[f"r{i}", "a"] for i in range(3)]
    np.testing.assert_allclose(every["sigma_kN"], 0.03)
    centred = [left - left.mean() for left in noise]
    alone = [np.sum(e[1:] * e[:-1]) / np.sum(e**2) for e in centred]
    np.testing.assert_allclose(every["autocorrelation"], alone, rtol=1e-9)


def test_a_factor_on_displacement_leaves_residuals_and_bands_as_they_are():
    tree, truth = known(2)
    rng = np.random.default_rng(20)
    factor = np.exp(0.05 * rng.normal(size=(2, 500)))
    spread = {"k": truth["k"] / factor[..., None] * np.ones(2), "beta": truth["beta"] * factor[..., None] * np.ones(2)}
    scaled, _ = known(2, spread=spread)
    dataset = scaled["posterior"].to_dataset().assign(displacement_scale=(("chain", "draw"), factor))
    scaled["posterior"] = xr.DataTree(dataset)
    F_i, J, k, beta, sigma = truth.values()
    forces = [curve(path(50), F_i, J, k, beta) + sigma * rng.normal(size=50) for _ in range(2)]
    table = table_of(forces, [3.0 + path(50)] * 2)
    plain, under_factor = (residuals(of, table) for of in (tree, scaled))
    np.testing.assert_allclose(under_factor.residual_kN, plain.residual_kN, atol=1e-12)
    bands = [posterior_predictive.predictive_bands(of, table, ["r0"]) for of in (tree, scaled)]
    np.testing.assert_allclose(bands[0]["upper_kN"], bands[1]["upper_kN"], atol=1e-12)


def test_one_record_of_each_configuration_and_direction_is_shown_and_the_most_discordant():
    factor_table = grid()
    draws = scattered(factor_table, seed=15)
    odd = {"single 25 unloading 2", "dual 0 unloading 3"}
    draws["outlier_probability"][..., factor_table["record"].isin(odd)] = 0.99
    shown = posterior_predictive.records_to_show(posterior(draws, factor_table))
    assert len(shown) == len(set(shown)) == posterior_predictive.SHOWN_RECORDS
    assert odd <= set(shown)
    cells = factor_table[factor_table["record"].isin(shown)].groupby(["configuration", "direction"]).size()
    assert len(cells) == 4


def test_of_many_cells_every_configuration_is_shown_before_a_second_direction():
    factor_table = grid(("a", "b", "c"))
    shown = posterior_predictive.records_to_show(posterior(scattered(factor_table, seed=18), factor_table))[:4]
    chosen = factor_table.set_index("record").loc[shown]
    assert set(chosen["configuration"]) == {"a", "b", "c"}
    assert chosen["direction"].tolist().count("loading") == 3


@pytest.mark.parametrize(("configurations", "repeats"), [(("single",), 1), (("a", "b", "c", "d", "e"), 3)])
def test_some_records_are_shown_whatever_the_campaign_and_never_more_than_six(configurations, repeats):
    factor_table = grid(configurations, repeats)
    shown = posterior_predictive.records_to_show(posterior(scattered(factor_table, seed=16), factor_table))
    assert 1 < len(shown) <= posterior_predictive.SHOWN_RECORDS
    assert set(shown) <= set(factor_table["record"])


@pytest.mark.parametrize("count", [1, 2, 9])
def test_records_without_words_are_shown_too(count):
    factor_table = grid(repeats=3)[["record"]][:count]
    shown = posterior_predictive.records_to_show(posterior(scattered(factor_table, seed=17), factor_table))
    assert 1 <= len(shown) <= min(count, posterior_predictive.SHOWN_RECORDS)
    assert set(shown) <= set(factor_table["record"])
