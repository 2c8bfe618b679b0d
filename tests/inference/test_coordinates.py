"""The coordinates are an exact change of variables, and standard normal where the data are Gaussian."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.inference.coordinates import place, place_pair

scales = st.floats(1e-4, 1e3)
numbers = st.floats(-5.0, 5.0)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(z=numbers, estimate=numbers, above=numbers, precision=scales, scale=scales)
def test_a_placed_scalar_is_standard_normal_in_its_coordinate(z, estimate, above, precision, scale):
    def log_density(z):
        placed = place(z, jnp.array([estimate]), jnp.array([precision]), jnp.array([above]), jnp.array([scale]))
        data = -0.5 * precision * (placed.value - estimate) ** 2
        level = -0.5 * ((placed.value - above) / scale) ** 2 - jnp.log(scale)
        return jnp.sum(data + level + placed.log_volume)

    at, origin = jnp.array([z]), jnp.zeros(1)
    size = precision * (estimate - above) ** 2 + (estimate - above) ** 2 / scale**2
    assert float(log_density(at) - log_density(origin)) == pytest.approx(-0.5 * z**2, abs=1e-9 * (1.0 + size))


@settings(derandomize=True, deadline=None, max_examples=200)
@given(scale=scales, precision=scales)
def test_the_volume_of_a_placed_scalar_is_its_derivative(scale, precision):
    def value(z):
        return place(z[None], jnp.array([0.3]), jnp.array([precision]), jnp.array([-1.0]), jnp.array([scale])).value[0]

    placed = place(jnp.zeros(1), jnp.array([0.3]), jnp.array([precision]), jnp.array([-1.0]), jnp.array([scale]))
    assert float(jnp.log(jax.grad(value)(jnp.array(0.7)))) == pytest.approx(float(placed.log_volume[0]), abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_a_placed_pair_is_standard_normal_in_its_coordinates_with_the_volume_of_its_map(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2, 2)) * 10.0 ** rng.uniform(-1, 2)
    precision, estimate = jnp.asarray(root @ root.T), jnp.asarray(rng.normal(size=2))
    above, scale = jnp.asarray(rng.normal(size=2)), jnp.asarray(10.0 ** rng.uniform(-2, 1, size=2))

    def placed(z):
        return place_pair(z[None], estimate[None], precision[None], above[None], scale[None])

    def log_density(z):
        value = placed(z).value[0]
        data = -0.5 * (value - estimate) @ precision @ (value - estimate)
        return data - 0.5 * jnp.sum(((value - above) / scale) ** 2)

    z = jnp.asarray(rng.normal(size=2))
    assert float(log_density(z) - log_density(jnp.zeros(2))) == pytest.approx(-0.5 * float(z @ z), rel=1e-6)
    jacobian = jax.jacfwd(lambda z: placed(z).value[0])(z)
    assert float(jnp.linalg.slogdet(jacobian)[1]) == pytest.approx(float(placed(z).log_volume[0]), abs=1e-9)
