"""A motion left out: its density against an integral done otherwise, and against what is known."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from helpers.synthetic_motions import make
from scipy import stats

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.diagnostics.leave_one_out.left_out import left_out
from bayes_tyre.inference.diagnostics.pareto_smoothing import PARETO_K_MOST
from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import MOTION_PARAMETERS
from bayes_tyre.inference.motion.hierarchy.leave_one_out import (
    densities,
    leave_one_motion_out,
    motions_in,
    with_motions,
)
from bayes_tyre.inference.motion.hierarchy.model import Readings
from bayes_tyre.inference.motion.record.evidence import log_average
from bayes_tyre.inference.sampling.datatree import to_datatree

DRAWS = 60


@pytest.fixture(scope="module")
def motions():
    made = make(2).motions
    n = len(made.factor_table)
    return replace(made, readings=Readings(np.linspace(100.0, 120.0, n), np.full(n, 200.0)))


def posterior_of(motions, kind="mixture") -> xr.DataTree:
    """Return draws of cases about the records' estimates, with scatters by speed."""
    rng, factors = np.random.default_rng(1), find_factors(motions.factor_table)
    cases = np.array([motions.log_mean[factors.of_record == i].mean(axis=0) for i in range(len(factors.cases))])
    draws = {}
    for i, name in enumerate(MOTION_PARAMETERS):
        draws[f"{name}_case"] = np.exp(cases[:, i] + 0.02 * rng.standard_normal((2, DRAWS, len(cases))))
        scatter = 0.05 * np.exp(0.1 * rng.standard_normal((2, DRAWS, len(factors.speed.labels))))
        draws[f"sd_log_{name}_repeat_by_speed"] = scatter
        draws[name] = np.exp(motions.log_mean[:, i]) * np.ones((2, DRAWS, 1))
    draws["discordant_weight"] = np.full((2, DRAWS), 0.05)
    draws["student_nu"] = np.full((2, DRAWS), 6.0)
    attributes = {"model": "motion", "repeats": kind, "law": "fancher"}
    return to_datatree(draws, {}, factors, motions.factor_table, attributes)


@pytest.mark.parametrize("kind", ["normal", "mixture", "student"])
def test_a_records_own_parameters_are_integrated_out(motions, kind):
    """Against plain Monte Carlo over them, for one draw."""
    tree, factors = posterior_of(motions), find_factors(motions.factor_table)
    posterior = tree["posterior"].to_dataset().isel(chain=[0], draw=[3])
    found = densities(posterior, motions, factors, kind)[0]
    rng, record = np.random.default_rng(0), 5
    case = factors.of_record[record]
    speed = factors.speed.of_case[case]
    mean = np.log([posterior[f"{p}_case"].to_numpy()[0, 0, case] for p in MOTION_PARAMETERS])
    scatter = np.array([posterior[f"sd_log_{p}_repeat_by_speed"].to_numpy()[0, 0, speed] for p in MOTION_PARAMETERS])
    n = 400_000
    wide = {
        "normal": np.ones(n),
        "mixture": np.where(rng.random(n) < 0.05, DISCORDANT_WIDENING, 1.0),
        "student": np.sqrt(6.0 / rng.chisquare(6.0, n)),
    }[kind]
    drawn = mean + wide[:, None] * scatter * rng.standard_normal((n, 5))
    height = np.exp(-0.5 * np.sum((drawn @ motions.rows[record].T - motions.target[record]) ** 2, axis=1))
    assert motions.readings is not None
    expected = np.log(height.mean()) + motions.readings.log_constant[record]
    error = height.std() / height.mean() / np.sqrt(n)
    # One seed, three kinds: beyond 5 standard errors in 2e-6; a t's 48 quantiles are off by 0.02 at most.
    assert abs(found[record] - expected) < 5 * error + (0.02 if kind == "student" else 0.0)


def test_averages_over_a_normal_are_those_of_one_more_normal():
    rng = np.random.default_rng(3)
    rows, off, sd = rng.standard_normal((4, 4)), rng.standard_normal(4), np.array([0.1, 1.0, 2.0, 0.5])
    total = np.eye(4) + rows @ np.diag(sd**2) @ rows.T
    expected = stats.multivariate_normal.logpdf(off, np.zeros(4), total) + 2 * np.log(2 * np.pi)  # pyright: ignore[reportArgumentType]
    assert log_average(rows, off, sd**2) == pytest.approx(expected, rel=1e-12)


def test_estimates_come_back_from_a_tree(motions):
    back = motions_in(with_motions(posterior_of(motions), motions))
    for name in ("rows", "target", "log_mean", "log_variance"):
        np.testing.assert_array_equal(getattr(back, name), getattr(motions, name))
    assert back.readings is not None
    assert motions.readings is not None
    np.testing.assert_array_equal(back.readings.log_constant, motions.readings.log_constant)
    assert back.factor_table.equals(motions.factor_table[list(back.factor_table)])
    assert back.law is motions.law


def test_a_tree_without_estimates_is_refused(motions):
    tree = posterior_of(motions)
    assert with_motions(tree, replace(motions, readings=None)) is tree
    with pytest.raises(BadInput, match="run motion again"):
        motions_in(tree)


def test_every_record_has_a_density_and_only_what_it_knew_is_taken_back(motions):
    tree = with_motions(posterior_of(motions), motions)
    found = leave_one_motion_out(tree)
    with_it = densities(tree["posterior"].to_dataset(), motions, find_factors(motions.factor_table), "mixture")
    # Weighing a draw by one over a density can only lower its mean (Jensen).
    assert (found.elpd.elpd_i.to_numpy() <= np.log(np.exp(with_it).mean(axis=0)) + 1e-9).all()
    assert list(found.effective_points) == [200.0] * len(motions.factor_table)
    assert not found.refitted.any()


def test_where_importance_sampling_fails_the_exact_answer_stands():
    rng = np.random.default_rng(0)
    by_chain = 0.1 * rng.standard_normal((2, 100, 3))
    by_chain[..., 1] = -8.0 * rng.exponential(size=(2, 100))
    asked = []
    found = left_out(
        by_chain, ("a", "b", "c"), np.full(3, 99.0), lambda record: np.full((2, 100), -50.0 - record), asked.append
    )
    assert asked == ["b"]
    assert found.elpd.elpd_i.to_numpy()[1] == pytest.approx(-51.0)
    assert list(found.refitted) == [False, True, False]
    assert found.pareto_k[1] > PARETO_K_MOST
    without = left_out(by_chain, ("a", "b", "c"), np.full(3, 99.0), None, asked.append)
    assert not without.refitted.any()
