"""Truths are ranked among draws as they should be."""

import jax.numpy as jnp
import numpy as np
from helpers.quick_design import quick_design

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.repeat_distribution import MixtureAbout
from bayes_tyre.studies.calibration import log_likelihood, log_repeats, rank_truths
from bayes_tyre.studies.truths import draw_truths, noiseless_forces, study_priors


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
    truths, force = draw_truths(design, 5, 0, study_priors())
    z = (force - noiseless_forces(design, truths)) / truths["sigma"][..., None]
    expected = -0.5 * (z**2).sum((1, 2)) - design.u.shape[1] * np.log(truths["sigma"]).sum(1)
    expected -= 0.5 * design.u.size * np.log(2 * np.pi)
    np.testing.assert_allclose(log_likelihood(design, truths, force), expected)


def test_the_density_of_repeats_at_truths_is_that_of_the_model():
    design = quick_design()
    truths, _ = draw_truths(design, 3, 0, study_priors())
    case = design.factors.of_record
    speed = design.factors.speed.of_case[case]
    for i, found in enumerate(log_repeats(design.factors, truths)):
        both = ("k", "beta")
        records, cases = (
            np.stack([np.log(truths[name][i]) for name in both], axis=1),
            np.stack([np.log(truths[f"{name}_case"][i][case]) for name in both], axis=1),
        )
        scatter = np.stack([truths[f"sd_log_{name}_repeat_by_speed"][i][speed] for name in both], axis=1)
        weight = jnp.asarray(truths["discordant_weight"][i])
        about = MixtureAbout(jnp.asarray(cases), jnp.asarray(scatter), weight, DISCORDANT_WIDENING)
        np.testing.assert_allclose(found, jnp.sum(about.log_prob(jnp.asarray(records))), rtol=1e-9)


def test_draws_of_many_sets_are_weighed_as_truths_are():
    design = quick_design()
    truths, force = draw_truths(design, 4, 1, study_priors())
    draws = {name: np.stack([values, values], axis=1) for name, values in truths.items()}
    np.testing.assert_allclose(log_repeats(design.factors, draws)[:, 1], log_repeats(design.factors, truths))
    both = log_likelihood(design, draws, force[:, None])
    np.testing.assert_allclose(both[:, 0], log_likelihood(design, truths, force))
