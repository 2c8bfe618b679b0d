"""What each further law is known to be: Fancher's limit within Bouc-Wen's, Masing's rule, memory of turning points."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from bayes_tyre.laws.bouc_wen import BoucWen
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.kelvin_voigt import KelvinVoigt
from bayes_tyre.laws.loop_energy import loop_energy
from bayes_tyre.laws.maxwell_slip import MaxwellSlip, yields

K, C, SETTLED, BETA = 1.8, 10.0, 0.2, 0.05
PATH = np.cumsum(np.random.default_rng(0).normal(0.0, 0.1, 400))


@pytest.mark.parametrize("start", [-0.35, -0.1, 0.0, 0.15, 0.3])
def test_bouc_wen_with_n_1_is_fanchers_law_for_small_steps(start):
    """A line and a Dahl element with friction x - k beta, from within its branches and from beyond them."""
    F_start = K * PATH[0] + C + start
    fancher = Fancher(k=K, C=C, x=SETTLED + K * BETA, beta=BETA).force(PATH, F_start)
    np.testing.assert_allclose(
        BoucWen(k=K, C=C, settled=SETTLED, beta=BETA, n=1.0).force(PATH, F_start), fancher, rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("n", [1.5, 2.0, 3.0])
def test_bouc_wen_follows_its_differential_equation(n):
    d = np.linspace(0.0, 0.4, 40_001)
    h = np.asarray(BoucWen(k=K, C=C, settled=SETTLED, beta=BETA, n=n).force(d, C - 0.15)) - K * d - C
    y = h / SETTLED
    slope = np.gradient(h, d)[1:-1]
    expected = SETTLED / BETA * (1 - np.sign(y) * np.abs(y) ** n)[1:-1]
    np.testing.assert_allclose(slope, expected, rtol=0, atol=2e-5 * SETTLED / BETA)
    assert h[-1] == pytest.approx(SETTLED, rel=1e-3)


@jax.jit
def _one_and_many(n, length, start):
    law = BoucWen(k=K, C=C, settled=SETTLED, beta=BETA, n=n)
    points = jnp.linspace(0.0, length * BETA, 1001)
    return law.force(points[::1000], C + start)[-1], law.force(points, C + start)[-1]


@pytest.mark.parametrize(("n", "most"), [(0.5, 1.2e-2), (1.0, 1e-11), (2.0, 4e-4), (3.0, 4e-4)])
def test_one_move_of_bouc_wen_is_as_near_to_many_as_it_says(n, most):
    lengths, starts = np.array([0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0]), np.array([-0.2, -0.1, -0.01, 0.05, 0.15, 0.25])
    one, many = jax.vmap(jax.vmap(_one_and_many, (None, None, 0)), (None, 0, None))(n, lengths, starts)
    off = np.abs(np.asarray(one - many)) / SETTLED
    assert off.max() < most
    if n >= 2:
        assert off[lengths <= 0.5].max() < 3e-5


def test_a_sharp_bouc_wen_is_a_spring_that_sticks_before_it_slides():
    """A cycle of amplitude a then loses 4 settled (a - beta), as of one elastic and sliding element."""
    cycle = 0.1 * np.cos(np.linspace(-np.pi, np.pi, 2001))
    law = BoucWen(k=K, C=C, settled=SETTLED, beta=BETA, n=60.0)
    force = law.force(np.tile(cycle, 3), C - K * 0.1 - SETTLED)
    assert loop_energy(cycle, force[-len(cycle) :]) == pytest.approx(4 * SETTLED * (0.1 - BETA), rel=0.03)


def test_maxwell_slip_yields_by_its_rule_and_settles():
    law = MaxwellSlip(k=K, C=C, settled=SETTLED, beta=BETA)
    at = np.concatenate([[0.0], BETA * np.array(yields()), [1.0]])
    friction = np.asarray(law.force(at, C)) - K * at - C
    by_hand = [SETTLED / 5 * np.minimum(d / (BETA * np.array(yields())), 1.0).sum() for d in at]
    np.testing.assert_allclose(friction, by_hand, rtol=0, atol=1e-13)
    assert friction[-1] == pytest.approx(SETTLED, rel=1e-13)


def test_many_elements_of_the_rule_load_along_fanchers_exponential():
    """The largest gap between the curve of n elements and 1 - exp(-u) falls with n, and five are near."""
    u = np.linspace(0.0, 6.0, 601)

    def gap(elements: int) -> float:
        curve = np.mean(np.minimum(u[:, None] / np.array(yields(elements)), 1.0), axis=1)
        return float(np.abs(curve + np.expm1(-u)).max())

    assert gap(5) < 0.03
    assert gap(200) < gap(50) / 3 < gap(5) / 9


def test_after_a_turn_maxwell_slip_goes_by_masings_rule():
    """Twice the first loading's curve from where all elements slide: f_turn - f = 2 f_first(u / 2)."""
    law, u = MaxwellSlip(k=0.0, C=0.0, settled=SETTLED, beta=BETA), np.linspace(0.0, 0.8, 81)
    first = np.asarray(law.force(u / 2, 0.0))
    back = np.asarray(law.force(np.concatenate([[0.0], 1.0 - u]), 0.0))[1:]
    np.testing.assert_allclose(back[0] - back, 2 * first, rtol=0, atol=1e-13)


def test_maxwell_slip_wipes_out_a_small_cycle_and_bouc_wen_does_not():
    """Return-point memory: after a small detour the path goes on as if there had been none."""
    there, detour = np.array([0.0, 0.06]), np.array([0.0, 0.06, 0.045, 0.06])

    def shift(law) -> float:
        return abs(float(law.force(there, C)[-1] - law.force(detour, C)[-1]))

    assert shift(MaxwellSlip(k=K, C=C, settled=SETTLED, beta=BETA)) < 1e-13
    assert shift(BoucWen(k=K, C=C, settled=SETTLED, beta=BETA, n=1.5)) > 1e-3


def test_an_element_that_starts_beyond_its_friction_stays_until_the_path_turns():
    law = MaxwellSlip(k=0.0, C=0.0, settled=SETTLED, beta=BETA)
    force = np.asarray(law.force(np.array([0.0, 0.5, 0.4, -1.0]), 2 * SETTLED))
    assert force[1] == pytest.approx(2 * SETTLED)
    assert force[2] < 2 * SETTLED
    assert force[3] == pytest.approx(-SETTLED)


def test_a_spring_loses_nothing_and_keeps_its_distance_from_its_line():
    law = KelvinVoigt(k=K, C=C)
    force = law.force(PATH, K * PATH[0] + C + 0.3)
    np.testing.assert_allclose(force, K * PATH + C + 0.3, rtol=0, atol=1e-12)
    loop = jnp.cos(jnp.linspace(-jnp.pi, jnp.pi, 101))
    assert abs(float(loop_energy(loop, law.force(loop, C - K)))) < 1e-12
