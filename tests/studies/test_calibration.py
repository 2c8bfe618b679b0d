"""Truths are ranked among draws as they should be."""

import jax.numpy as jnp
import numpy as np

from bayes_tyre.inference.model.repeat_distribution import repeat_density
from bayes_tyre.studies.calibration import log_likelihood, log_repeats, rank_truths
from bayes_tyre.studies.design import quick_design
from bayes_tyre.studies.truths import Planted, draw_truths, simulate_forces, study_priors


def test_elements_of_a_parameter_take_turns():
    rng = np.random.default_rng(0)
    truths = {"k": np.tile([[-9.0, 0.0, 9.0]], (6, 1)), "sd_J": np.zeros(6)}
    draws = {"k": rng.standard_normal((6, 39, 3)), "sd_J": rng.standard_normal((6, 39)), "odd": np.zeros((6, 39))}
    ranked = rank_truths(truths, draws, 0, rng)
    assert list(ranked.columns) == ["dataset", "k", "sd_J"]
    np.testing.assert_array_equal(ranked["k"].to_numpy()[[0, 2, 3, 5]], [0, 39, 0, 39])
    np.testing.assert_array_equal(rank_truths(truths, draws, 2, rng)["k"].to_numpy()[:2], [39, 0])


def test_the_log_likelihood_of_truths_is_that_of_their_noise():
    design = quick_design()
    truths = draw_truths(design, 5, np.random.default_rng(0), study_priors(), Planted())
    force = simulate_forces(design, truths, np.random.default_rng(1))
    z = (force - simulate_forces(design, truths, np.random.default_rng(1), Planted(noise=0.0))) / truths["sigma"][
        ..., None
    ]
    expected = -0.5 * (z**2).sum((1, 2)) - design.u.shape[1] * np.log(truths["sigma"]).sum(1)
    expected -= 0.5 * design.u.size * np.log(2 * np.pi)
    np.testing.assert_allclose(log_likelihood(design, truths, force), expected)


def test_the_density_of_repeats_at_truths_is_that_of_the_model():
    design = quick_design()
    truths = draw_truths(design, 3, np.random.default_rng(0), study_priors(), Planted())
    case = design.factors.of_record
    speed = design.factors.speed.of_case[case]
    for i, found in enumerate(log_repeats(design, truths)):
        both = ("k", "beta")
        deviation = np.stack([np.log(truths[name][i] / truths[f"{name}_case"][i][case]) for name in both], axis=1)
        scatter = np.stack([truths[f"sd_log_{name}_repeat_by_speed"][i][speed] for name in both], axis=1)
        hyperparameters = {"discordant_weight": jnp.asarray(truths["discordant_weight"][i])}
        of_model = repeat_density(jnp.asarray(deviation), jnp.asarray(scatter), "mixture", hyperparameters)
        np.testing.assert_allclose(found, jnp.sum(of_model.log_density), rtol=1e-9)
