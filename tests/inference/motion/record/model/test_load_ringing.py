"""A load that rings: what its two terms are together, and which parameters a record has with it."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.recorded_motions import RIG, recorded
from scipy.signal import TransferFunction, lsim

from bayes_tyre.inference.motion.record.model.forward_model import cylinder_load, node_times
from bayes_tyre.inference.motion.record.model.load_ringing import Ringing, ringing_share
from bayes_tyre.inference.motion.record.model.load_step import SHAPE_TERMS, load_share
from bayes_tyre.inference.motion.record.model.window import make_window
from bayes_tyre.simulate.plan import quick_plan

DT_S, ZETA, OMEGA = 2.5e-4, 0.1, 2 * np.pi * 18.0
TIME_S = np.arange(0, 0.6, DT_S)
SHARE = load_share(jnp.asarray(TIME_S), 0.05, 0.04, jnp.zeros(SHAPE_TERMS))


@pytest.fixture(scope="module")
def window():
    plan = next(plan for plan in quick_plan() if plan.case.configuration == "single")
    return make_window(RIG, recorded(plan, seed=7)[1])


def rings(of_acceleration: float, of_speed: float) -> Ringing:
    return Ringing(*map(jnp.asarray, (18.0, ZETA, of_acceleration, of_speed)))


@pytest.mark.parametrize(("of_acceleration", "of_speed"), [(1.0, 2 * ZETA), (0.1, 0.05), (-0.05, 0.1)])
def test_share_is_a_response_of_second_order_that_ends_where_it_is_asked_to(of_acceleration, of_speed):
    """With the first pair the load lags: omega^2 over s^2 + 2 zeta omega s + omega^2, no more."""
    found = np.asarray(SHARE + ringing_share(rings(of_acceleration, of_speed), SHARE, DT_S))
    numerator = np.trim_zeros([1 - of_acceleration, (2 * ZETA - of_speed) * OMEGA, OMEGA**2], "f")
    _, expected, _ = lsim(TransferFunction(numerator, [1, 2 * ZETA * OMEGA, OMEGA**2]), np.asarray(SHARE), TIME_S)
    # The trapezoidal rule, as in `test_oscillator`.
    np.testing.assert_allclose(found, expected, atol=3e-3)
    assert found[0] == 0
    assert found[-1] == pytest.approx(1, abs=5e-3)  # 55 radians later, exp(-5.5) is left
    assert found.max() > 1.02


def test_the_number_of_parameters_says_what_a_record_has(window):
    for extended, has_ringing, has_mode in (
        (window, False, False),
        (window.with_ringing(), True, False),
        (window.with_mode(60.0), False, True),
        (window.with_ringing().with_mode(60.0), True, True),
        (window.with_mode(60.0).with_ringing(), True, True),
    ):
        parameters = extended.in_units(RIG, jnp.zeros(extended.prior.shape[1]))
        assert (parameters.ringing is not None, parameters.mode is not None) == (has_ringing, has_mode)
        assert len(extended.ringing_at) == 4 * has_ringing
        # What a rig is has the frequency of its prior, in whichever order the two came.
        assert parameters.mode is None or parameters.mode.frequency_Hz == pytest.approx(60.0)
        assert parameters.ringing is None or parameters.ringing.frequency_Hz == pytest.approx(18.0)


def test_a_load_without_either_term_is_its_step(window):
    silent = window.with_ringing()
    standard = jnp.asarray(np.random.default_rng(2).normal(0, 0.5, window.prior.shape[1]))
    padded = jnp.pad(standard, (0, 4))  # both terms at their means, 0
    loads = [
        cylinder_load(each.in_units(RIG, at), node_times(each)) for each, at in ((window, standard), (silent, padded))
    ]
    np.testing.assert_array_equal(loads[0], loads[1])
    padded = padded.at[-2].set(0.5)
    assert np.abs(cylinder_load(silent.in_units(RIG, padded), node_times(window)) - loads[0]).max() > 0.05
