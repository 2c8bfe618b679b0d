"""Energy around a loop: lost above x = k beta, made below, and in closed form for the limit's steady loop."""

from decimal import Decimal, localcontext

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.loop_energy import dissipated_energy_per_cycle, loop_energy

K, C, BETA = 1.8, 10.0, 0.05


def steady_loop(x: float, amplitude: float, points: int = 20_001) -> tuple[jax.Array, jax.Array]:
    """A cycle of the law with friction x about d = 2 mm, started on its steady loop."""
    phase = np.linspace(-np.pi, np.pi, 2 * points - 1)
    d = jnp.asarray(2.0 + amplitude * np.cos(phase))
    turn = (x - K * BETA) * jnp.tanh(amplitude / BETA)
    return d, Fancher(k=K, C=C, x=x, beta=BETA).force(d, K * d[0] + C - turn)


def exact_energy(k: float, x: float, beta: float, amplitude: float) -> float:
    """4 (x - k beta) (a - beta tanh(a / beta)) from the same doubles, in 80 digits."""
    with localcontext() as context:
        context.prec = 80
        K, X, B, A = map(Decimal, (k, x, beta, amplitude))
        decay = (-2 * A / B).exp()
        return float(4 * (X - K * B) * (A - B * (1 - decay) / (1 + decay)))


def test_energy_is_the_area_enclosed():
    square = jnp.array([0.0, 0.0, 2.0, 2.0]), jnp.array([1.0, 4.0, 4.0, 1.0])
    assert loop_energy(*square) == 6.0
    assert loop_energy(square[0][::-1], square[1][::-1]) == -6.0
    closed = tuple(jnp.append(values, values[0]) for values in square)
    assert loop_energy(*closed) == 6.0


@pytest.mark.parametrize("ratio", [0.01, 0.1, 1.0, 10.0, 100.0])
@pytest.mark.parametrize("x", [0.0, 0.02, 0.3])
def test_closed_form_is_the_area_of_a_finely_sampled_loop(ratio, x):
    amplitude = BETA / ratio
    d, F = steady_loop(x, amplitude)
    assert F[-1] == pytest.approx(float(F[0]), rel=1e-12)
    expected = dissipated_energy_per_cycle(k=K, x=x, beta=BETA, amplitude=amplitude)
    # Relative to the loop's own energy, and to the rounding of forces of 10 kN over the stroke.
    assert loop_energy(d, F) == pytest.approx(float(expected), rel=2e-5, abs=1e-13 * C * amplitude)


def test_any_start_ends_on_the_steady_loop():
    law, amplitude = Fancher(k=K, C=C, x=0.3, beta=BETA), 0.06
    cycle = amplitude * np.cos(np.linspace(-np.pi, np.pi, 4001))
    force = law.force(jnp.asarray(np.tile(cycle, 8)), 13.0)
    last = loop_energy(jnp.asarray(cycle), force[-len(cycle) :])
    expected = dissipated_energy_per_cycle(k=K, x=0.3, beta=BETA, amplitude=amplitude)
    assert last == pytest.approx(float(expected), rel=1e-5)


@pytest.mark.parametrize("amplitude", [0.01, 0.1, 2.0])
def test_friction_decides_whether_a_loop_loses_or_makes_energy(amplitude):
    def energy(x: float) -> float:
        return float(loop_energy(*steady_loop(x, amplitude)))

    threshold = K * BETA
    assert energy(1.05 * threshold) > 0
    assert energy(0.95 * threshold) < 0
    assert energy(threshold) == pytest.approx(0.0, abs=1e-3 * energy(1.05 * threshold))


@pytest.mark.parametrize("beta", np.logspace(-6, 3, 10))
@pytest.mark.parametrize("amplitude", [1e-6, 1e-3, 0.07, 1.0, 25.0])
def test_closed_form_keeps_its_digits(beta, amplitude):
    value = dissipated_energy_per_cycle(k=K, x=0.3, beta=beta, amplitude=amplitude)
    assert value == pytest.approx(exact_energy(K, 0.3, beta, amplitude), rel=1e-13, abs=0.0)


def test_closed_form_has_the_known_extremes():
    stiff = dissipated_energy_per_cycle(k=K, x=0.3, beta=1e-6, amplitude=1.5)
    assert stiff == pytest.approx(4 * 0.3 * 1.5, rel=1e-5)
    soft = dissipated_energy_per_cycle(k=K, x=0.3, beta=1e3, amplitude=0.5)
    assert soft == pytest.approx(4 / 3 * (0.3 - K * 1e3) * 0.5**3 / 1e3**2, rel=1e-6)
    assert dissipated_energy_per_cycle(k=K, x=0.3, beta=BETA, amplitude=0.0) == 0.0


def test_closed_form_has_the_gradient_of_its_formula():
    def gradient_by_hand(k, x, beta, a):
        y = a / beta
        loop, net = a - beta * np.tanh(y), x - k * beta
        by_beta = -4 * k * loop + 4 * net * (y / np.cosh(y) ** 2 - np.tanh(y))
        return -4 * beta * loop, 4 * loop, by_beta, 4 * net * np.tanh(y) ** 2

    def energy(k, x, beta, a):
        return dissipated_energy_per_cycle(k=k, x=x, beta=beta, amplitude=a)

    for beta in np.logspace(-6, 3, 28):
        for amplitude in [0.0, 1e-4, 0.07, 1.0, 25.0]:
            gradient = np.array(jax.grad(energy, argnums=(0, 1, 2, 3))(K, 0.3, beta, amplitude))
            assert np.all(np.isfinite(gradient))
            if 1e-2 < amplitude / beta < 300:  # by hand, small y cancels and large y overflows cosh
                by_hand = gradient_by_hand(K, 0.3, beta, amplitude)
                np.testing.assert_allclose(gradient, by_hand, rtol=1e-9, atol=1e-12)
