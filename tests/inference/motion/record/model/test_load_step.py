"""The family of load steps holds the shapes that hydraulic cylinders have."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from bayes_tyre.inference.motion.laws import FANCHER
from bayes_tyre.inference.motion.record.model.load_step import SHAPE_TERMS, load_share
from bayes_tyre.inference.motion.record.model.parameters import parameter_names
from bayes_tyre.simulate.drive import SHAPES

NAMES = parameter_names(FANCHER)

TIME_S = np.linspace(0.0, 0.04, 201)


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_that_cylinders_have_are_in_the_family_and_two_stages_are_not(name):
    wanted = SHAPES[name](TIME_S / 0.04)
    share = jax.jit(lambda shape: load_share(jnp.asarray(TIME_S), 0.0, 0.04, shape))
    found = least_squares(lambda shape: np.asarray(share(shape)) - wanted, np.zeros(SHAPE_TERMS))
    farthest = np.abs(found.fun).max()
    if name == "two stages":
        # A solver that stalled would leave as much as the raised cosine that it starts from does.
        assert 0.01 < farthest < 0.9 * np.abs(SHAPES["raised cosine"](TIME_S / 0.04) - wanted).max()
    else:
        assert farthest < 5e-3
    if name == "raised cosine":
        np.testing.assert_allclose(found.x, 0.0, atol=1e-6)


def test_there_is_an_unknown_for_every_number_of_the_shape():
    assert sum(name.startswith("shape_") for name in NAMES) == SHAPE_TERMS


def test_a_step_is_0_before_it_and_1_after_it():
    share = np.asarray(load_share(jnp.asarray([-1.0, 0.0, 0.04, 1.0]), 0.0, 0.04, jnp.zeros(SHAPE_TERMS)))
    np.testing.assert_allclose(share, [0, 0, 1, 1], atol=1e-12)
