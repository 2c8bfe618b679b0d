"""Noise of block means and of levels: what rounding adds where noise does not spread it."""

import numpy as np
import pytest

from bayes_tyre.inference.motion.record.model.block_noise import (
    block_sd,
    common_rounding_variance,
    converter_step,
    level,
)

STEP = 0.374


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.08, 0.2, 0.45])
def test_a_level_is_as_wrong_as_its_error_says_whatever_the_noise_is_beside_the_converter_s_step(noise):
    rng = np.random.default_rng(3)
    off, errors = [], []
    for true in rng.uniform(20.0, 30.0, 200):
        rest = STEP * np.round((true + noise * rng.standard_normal(4000)) / STEP)
        mean, error = level(rest, 1e-3, STEP)
        off.append(mean - true)
        errors.append(error)
    # The mean square of 200 is within 30 % of its expectation in all but 1e-5 of seeds if they are normal; rounding is
    # uniform, of smaller kurtosis, and the first term of its series has three quarters of the variance where there is
    # no noise. Of noise below half a step the readings say little, and errors are then up to twice too large; so is the
    # larger one of two standard errors.
    share = np.mean(np.square(off)) / np.mean(np.square(errors))
    assert 0.2 < share < (1.9 if noise < 0.05 else 1.3)


def test_a_block_of_a_channel_that_stands_on_one_level_has_the_error_of_the_step():
    rest = np.full(4000, 20 * STEP)
    assert converter_step(rest) == 0.0
    assert block_sd(rest, 5, STEP) == pytest.approx(STEP * np.sqrt(1 / 60 + 1 / (2 * np.pi**2)))
    assert common_rounding_variance(rest, 0.0) == 0.0
