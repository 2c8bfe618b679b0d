"""The coordinates are an exact change of variables, and standard normal where the data are Gaussian."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.inference.model.coordinates.reparameterisation import (
    Gaussian,
    inverse_root,
    reparameterise,
    reparameterise_by_slope,
    reparameterise_jointly,
    reparameterise_whitened,
)
from bayes_tyre.inference.model.normal_posterior import QuadraticApproximation

scales = st.floats(1e-4, 1e3)
numbers = st.floats(-5.0, 5.0)


@settings(max_examples=200)
@given(z=numbers, estimate=numbers, above=numbers, precision=scales, scale=scales)
def test_a_placed_scalar_is_standard_normal_in_its_coordinate(z, estimate, above, precision, scale):
    def log_density(z):
        placed = reparameterise(
            z, Gaussian(jnp.array([estimate]), jnp.array([precision])), jnp.array([above]), jnp.array([scale])
        )
        data = -0.5 * precision * (placed.value - estimate) ** 2
        level = -0.5 * ((placed.value - above) / scale) ** 2 - jnp.log(scale)
        return jnp.sum(data + level + placed.log_volume)

    at, origin = jnp.array([z]), jnp.zeros(1)
    size = precision * (estimate - above) ** 2 + (estimate - above) ** 2 / scale**2
    assert float(log_density(at) - log_density(origin)) == pytest.approx(-0.5 * z**2, abs=1e-9 * (1.0 + size))


@settings(max_examples=200)
@given(scale=scales, precision=scales)
def test_the_volume_of_a_placed_scalar_is_its_derivative(scale, precision):
    estimate = Gaussian(jnp.array([0.3]), jnp.array([precision]))

    def value(z):
        return reparameterise(z[None], estimate, jnp.array([-1.0]), jnp.array([scale])).value[0]

    placed = reparameterise(jnp.zeros(1), estimate, jnp.array([-1.0]), jnp.array([scale]))
    assert float(jnp.log(jax.grad(value)(jnp.array(0.7)))) == pytest.approx(float(placed.log_volume[0]), abs=1e-12)


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("seed", range(8))
def test_a_few_placed_are_standard_normal_in_their_coordinates_with_the_volume_of_their_map(seed, count):
    rng = np.random.default_rng(seed)
    rows = jnp.asarray(rng.normal(size=(count, count)) * 10.0 ** rng.uniform(-1, 2))
    precision, estimate = rows.T @ rows, jnp.asarray(rng.normal(size=count))
    above, scale = jnp.asarray(rng.normal(size=count)), jnp.asarray(10.0 ** rng.uniform(-2, 1, size=count))

    def placed(z):
        slope = precision @ (estimate - above)
        return reparameterise_by_slope(z[None], slope[None], precision[None], above[None], scale[None])

    def log_density(z):
        value = placed(z).value[0]
        data = -0.5 * (value - estimate) @ precision @ (value - estimate)
        return data - 0.5 * jnp.sum(((value - above) / scale) ** 2)

    z = jnp.asarray(rng.normal(size=count))
    assert float(log_density(z) - log_density(jnp.zeros(count))) == pytest.approx(-0.5 * float(z @ z), rel=1e-6)
    jacobian = jax.jacfwd(lambda z: placed(z).value[0])(z)
    assert float(jnp.linalg.slogdet(jacobian)[1]) == pytest.approx(float(placed(z).log_volume[0]), abs=1e-9)
    whitened = reparameterise_whitened(z[None], rows[None], (rows @ estimate)[None], above[None], scale[None])
    for one, other in zip(whitened, placed(z), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-10)


def test_of_a_few_that_nothing_is_said_of_each_is_at_its_level_and_as_wide_as_that():
    z, above, scale = jnp.array([[1.0, -2.0, 0.5]]), jnp.array([[3.0, 4.0, 5.0]]), jnp.array([[0.1, 1e-200, 10.0]])
    placed = reparameterise_whitened(z, jnp.zeros((1, 3, 3)), jnp.zeros((1, 3)), above, scale)
    np.testing.assert_allclose(placed.deviation, scale * z)
    assert float(placed.log_volume[0]) == pytest.approx(float(jnp.sum(jnp.log(scale))))


def of_terms(design, values, precision):
    """Return what normal estimates of design @ terms say of the terms."""
    weighted = design * precision[..., None]
    slope = jnp.einsum("...ut,...u->...t", weighted, values)
    return QuadraticApproximation(jnp.zeros_like(slope), slope, weighted.mT @ design)


@pytest.mark.parametrize("seed", range(8))
def test_terms_placed_jointly_are_standard_normal_in_their_coordinates_with_the_volume_of_their_map(seed):
    rng = np.random.default_rng(seed)
    units, terms = 7, 4
    design = jnp.asarray(rng.normal(size=(units, terms))).at[:, 3].set(1.0)
    design = design.at[:, 2].set(design[:, 0] + 1e-3 * design[:, 1])  # two columns that say nearly the same
    estimate = Gaussian(jnp.asarray(rng.normal(size=units)), jnp.asarray(10.0 ** rng.uniform(-2, 4, size=units)))
    above, scale = jnp.asarray(rng.normal(size=terms)), jnp.asarray(10.0 ** rng.uniform(-3, 1, size=terms))

    def placed(z):
        return reparameterise_jointly(z, of_terms(design, *estimate), above, scale)

    def log_density(z):
        found = placed(z)
        data = -0.5 * jnp.sum(estimate.precision * (design @ found.value - estimate.value) ** 2)
        return data - 0.5 * jnp.sum((found.deviation / scale) ** 2)

    z = jnp.asarray(rng.normal(size=terms))
    difference = float(log_density(z) - log_density(jnp.zeros(terms)))
    size = abs(float(log_density(z)))
    assert difference == pytest.approx(-0.5 * float(z @ z), abs=1e-8 * (1.0 + size))
    jacobian = jax.jacfwd(lambda z: placed(z).value)(z)
    assert float(jnp.linalg.slogdet(jacobian)[1]) == pytest.approx(float(placed(z).log_volume), abs=1e-8)


def test_terms_whose_scale_vanishes_stay_where_they_belong():
    design, above = jnp.eye(2), jnp.array([0.5, -0.5])
    estimate = Gaussian(jnp.array([3.0, 3.0]), jnp.array([10.0, 10.0]))
    placed = reparameterise_jointly(jnp.ones(2), of_terms(design, *estimate), above, jnp.array([1e-200, 1.0]))
    assert float(placed.deviation[0]) == pytest.approx(1e-200)
    assert float(placed.value[0]) == 0.5
    assert bool(jnp.isfinite(placed.log_volume))


def test_terms_without_weight_in_the_design_are_idle_and_move_no_other():
    rng = np.random.default_rng(3)
    design = jnp.asarray(rng.normal(size=(2, 6, 3))).at[1, :, 2].set(0.0)
    estimate = of_terms(design, jnp.zeros((2, 6)), jnp.ones((2, 6)))
    z, scale, above = jnp.asarray(rng.normal(size=(2, 3))), jnp.full((2, 3), 0.7).at[1, 2].set(1.0), jnp.zeros((2, 3))
    placed = reparameterise_jointly(z.at[1, 2].set(0.0), estimate, above, scale)
    for of_one, terms in ((0, 3), (1, 2)):
        own = of_terms(design[of_one, :, :terms], jnp.zeros(6), jnp.ones(6))
        alone = reparameterise_jointly(z[of_one, :terms], own, above[of_one, :terms], scale[of_one, :terms])
        np.testing.assert_allclose(placed.value[of_one, :terms], alone.value, rtol=1e-12)
        assert float(placed.log_volume[of_one]) == pytest.approx(float(alone.log_volume), abs=1e-12)
    assert float(placed.value[1, 2]) == 0.0


@pytest.mark.parametrize("size", [1, 5, 50])
def test_the_inverse_root_and_its_derivative_are_those_of_choleskys_factor(size):
    rng = np.random.default_rng(size)
    tall = rng.normal(size=(2, size + 3, size)) * 10.0 ** rng.uniform(-1, 1, size=size)
    matrix = jnp.eye(size) + jnp.asarray(tall.mT @ tall)
    weight, change = jnp.asarray(rng.normal(size=matrix.shape)), jnp.asarray(tall.mT @ tall)

    def inverted(step):
        return jnp.linalg.inv(jnp.linalg.cholesky(matrix + step * change)).mT

    np.testing.assert_allclose(inverse_root(matrix), inverted(0.0), rtol=1e-7, atol=1e-12)
    _, forward = jax.jvp(lambda step: inverse_root(matrix + step * change), (0.0,), (1.0,))
    backward = jax.grad(lambda step: jnp.sum(weight * inverse_root(matrix + step * change)))(0.0)
    numerical = (inverted(1e-5) - inverted(-1e-5)) / 2e-5
    np.testing.assert_allclose(forward, numerical, rtol=1e-5, atol=1e-8)
    assert float(backward) == pytest.approx(float(jnp.sum(weight * forward)), rel=1e-10)
