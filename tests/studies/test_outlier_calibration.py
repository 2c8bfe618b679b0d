"""Probabilities of being discordant are held against how many records are."""

import numpy as np
import pytest
from helpers.quick_design import quick_design

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.hyperparameters import prior_sites
from bayes_tyre.studies.outlier_calibration import EDGES, draw_discordant, outlier_calibration
from bayes_tyre.studies.ranked_quantities import Hierarchy
from bayes_tyre.studies.truths import draw_truths, study_priors


def test_right_probabilities_are_inside_their_bands_and_wrong_ones_are_not():
    rng = np.random.default_rng(0)
    predicted = rng.beta(0.3, 2.0, (300, 24))
    discordant = rng.random(predicted.shape) < predicted
    right = outlier_calibration(predicted, discordant)
    # Independent records: all rows together are inside in 95 % of seeds, and the seed is fixed.
    assert right["inside"].all()
    assert right["records"].sum() == predicted.size
    assert ((right["from"] <= right["predicted"]) & (right["predicted"] <= right["to"])).all()
    np.testing.assert_allclose(np.sum(right["discordant"] * right["records"]), discordant.sum())
    # Probabilities that are too sure, the odds squared.
    odds = (predicted / (1.0 - predicted)) ** 2
    assert not outlier_calibration(odds / (1.0 + odds), discordant)["inside"].all()


def test_only_rows_with_records_are_there():
    table = outlier_calibration(np.array([[0.0, 0.015, 1.0]]), np.array([[False, False, True]]))
    assert table["from"].tolist() == [0.0, 0.01, 0.95]
    assert table["records"].tolist() == [1, 1, 1]
    assert table["to"].iloc[-1] == EDGES[-1] == 1.0
    assert outlier_calibration(np.zeros((5, 0)), np.zeros((5, 0), dtype=bool)).empty


def test_records_drawn_discordant_are_as_many_and_as_far_off_as_the_prior_says():
    design, sets = quick_design(), 4000
    truths, _ = draw_truths(design, sets, 3, study_priors())
    hierarchy = Hierarchy(design.factors, study_priors(), prior_sites(design.factors))
    discordant = draw_discordant(hierarchy, truths, np.random.default_rng(4))
    weight = truths["discordant_weight"]
    # Given the weights, a sum of independent choices: within 4 standard deviations but for 6 in 100 000 seeds.
    expected, variance = 12 * weight.sum(), 12 * np.sum(weight * (1.0 - weight))
    assert abs(discordant.sum() - expected) < 4.0 * np.sqrt(variance)
    scatter = truths["sd_log_k_repeat_by_speed"][:, design.factors.speed.of_case[design.factors.of_record]]
    off = np.log(truths["k"] / truths["k_case"][:, design.factors.of_record]) / scatter
    # Some 2 400 normals six times as wide and 45 000 usual ones: a standard deviation is known to 1.5 and 0.4 %.
    assert np.std(off[discordant]) == pytest.approx(DISCORDANT_WIDENING, rel=0.06)
    assert np.std(off[~discordant]) == pytest.approx(1.0, rel=0.016)
