"""Truths are ranked among draws as they should be."""

import numpy as np

from bayes_tyre.studies.calibration import rank_truths


def test_elements_of_a_parameter_take_turns():
    rng = np.random.default_rng(0)
    truths = {"k": np.tile([[-9.0, 0.0, 9.0]], (6, 1)), "sd_J": np.zeros(6)}
    draws = {"k": rng.standard_normal((6, 39, 3)), "sd_J": rng.standard_normal((6, 39)), "odd": np.zeros((6, 39))}
    ranked = rank_truths(truths, draws, 0, rng)
    assert list(ranked.columns) == ["dataset", "k", "sd_J"]
    np.testing.assert_array_equal(ranked["k"].to_numpy()[[0, 2, 3, 5]], [0, 39, 0, 39])
    np.testing.assert_array_equal(rank_truths(truths, draws, 2, rng)["k"].to_numpy()[:2], [39, 0])
