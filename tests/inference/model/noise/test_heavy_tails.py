"""Weights of points that are far off: the mean square that they leave, and estimates that outliers hardly move."""

import numpy as np
import pandas as pd
import pytest
from helpers.simulated_records import Plan, simulate
from scipy import integrate, stats

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.coordinates.laplace import estimate_records
from bayes_tyre.inference.model.noise.heavy_tails import estimated_heavy_tails, heavy_tails
from bayes_tyre.inference.model.prepared_records import prepare_records, record_batch
from bayes_tyre.inference.model.settings import ModelSettings
from bayes_tyre.record_table import check_record_table

PLAN = Plan(("x",), (0.0,), (20.0,), (5.0,), repeats=3, points=200, noise_kN=0.01)


@pytest.mark.parametrize("nu", [1.5, 4.0, 30.0])
def test_weighted_residuals_have_the_scale_as_their_standard_deviation(nu):
    residual = np.linspace(-60.0, 60.0, 20_001)
    present = np.ones((1, len(residual)), bool)
    weight = np.asarray(heavy_tails(0.2 * residual[None], present, np.array([0.2]), nu).weight)[0]
    square = integrate.trapezoid((weight * residual) ** 2 * stats.t.pdf(residual, nu), residual)
    # Beyond 60 scales the square is nu + 1 at most, and the t has 2.2e-3 of its probability there at nu = 1.5.
    assert square == pytest.approx(1.0, abs=(nu + 1.0) * 2.0 * stats.t.sf(60.0, nu) + 1e-4)


def test_points_far_off_hardly_move_the_estimate():
    table, _ = simulate(PLAN, seed=4)
    table = check_record_table(table)
    batch, clean = record_batch(table), estimate_records(record_batch(table))
    off = np.arange(len(table)) % 25 == 3
    spoilt = record_batch(table.assign(force_kN=table["force_kN"] + np.where(off, 0.5, 0.0)))
    by_squares = np.asarray(estimate_records(spoilt).centre - clean.centre)
    by_weights = estimate_records(spoilt, whitening=estimated_heavy_tails(spoilt, "equation_2"))
    moved = np.asarray(by_weights.centre - clean.centre)
    assert np.abs(moved).max(axis=0) == pytest.approx(0.0, abs=0.2 * np.abs(by_squares).max())
    # 0.5 kN in a 25th of the points are a standard deviation of 0.1 kN to least squares.
    assert np.exp(np.asarray(by_weights.log_sigma)) == pytest.approx(PLAN.noise_kN, rel=0.25)
    assert batch.records == spoilt.records


def test_errors_beside_that_noise_are_refused():
    table, model = check_record_table(simulate(PLAN, seed=4)[0]), ModelSettings(noise="student")
    prepare_records(table, model)
    stepped = table.assign(displacement_mm=0.01 * np.round(table["displacement_mm"] / 0.01))
    with pytest.raises(BadInput, match="displacement_sd 0"):
        prepare_records(stepped, model)
    prepare_records(stepped, ModelSettings(noise="student", displacement_sd=0.0))
    weighed = pd.DataFrame(table).assign(force_per_kg_kN=0.01, mass_sd_kg=2.0)
    with pytest.raises(BadInput, match="mass_sd_kg"):
        prepare_records(weighed, model)
