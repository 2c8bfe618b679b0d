"""Half-normal scales in coordinates of their own: the same law, and no wall for NUTS to meet."""

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpyro import distributions as dist
from numpyro.distributions import biject_to
from scipy import stats

from bayes_tyre.inference.model.half_normal import HalfNormal
from bayes_tyre.inference.sampling.run import SamplerSettings, sample

SCALES = st.floats(1e-3, 1e3)


def log_density(family: type[dist.HalfNormal], scale: float, z: jax.Array) -> jax.Array:
    """Return the log density of the coordinate that NUTS walks in."""
    law = family(scale)
    to_value = biject_to(law.support)
    value = to_value(z)
    return law.log_prob(value) + to_value.log_abs_det_jacobian(z, value)


@settings(deadline=None)
@given(scale=SCALES, share=st.floats(1e-6, 8.0))
def test_its_density_is_scipys_and_its_coordinates_go_there_and_back(scale, share):
    law, value = HalfNormal(scale), share * scale
    assert law.log_prob(value) == pytest.approx(stats.halfnorm.logpdf(value, scale=scale), rel=1e-12, abs=1e-12)
    to_value = biject_to(law.support)
    z = to_value.inv(jnp.asarray(value))
    assert float(to_value(z)) == pytest.approx(value, rel=1e-9)
    assert bool(law.support(value))
    assert not bool(law.support(-value))


@settings(deadline=None)
@given(scale=SCALES, z=st.floats(-20.0, 10.0))
def test_the_volume_of_its_coordinates_is_their_derivative(scale, z):
    to_value = biject_to(HalfNormal(scale).support)
    value, slope = jax.value_and_grad(lambda at: jnp.asarray(to_value(at)))(z)
    assert float(to_value.log_abs_det_jacobian(jnp.asarray(z), value)) == pytest.approx(np.log(float(slope)), abs=1e-9)


def test_nowhere_is_it_steeper_than_a_normal_where_the_logarithm_meets_a_wall():
    z = jnp.linspace(-20.0, 5.0, 401)

    def steepest(family: type[dist.HalfNormal]) -> float:
        return float(jnp.max(-jax.vmap(jax.grad(jax.grad(lambda at: log_density(family, 0.7, at))))(z)))

    assert steepest(HalfNormal) <= 1.2
    assert steepest(dist.HalfNormal) > 1e3


def test_supports_are_equal_where_their_scales_are():
    assert HalfNormal(np.array([0.2, 3.0])).support == HalfNormal(np.array([0.2, 3.0])).support
    assert HalfNormal(0.2).support != HalfNormal(0.3).support
    assert HalfNormal(0.2).support != dist.HalfNormal(0.2).support


def test_draws_are_of_the_law_that_was_asked_for():
    def model() -> None:
        numpyro.sample("scale", HalfNormal(np.array([0.2, 3.0])))

    drawn = sample(model, {}, SamplerSettings(chains=2, warmup=300, draws=2000, seed=1))
    for reparameterise, scale in enumerate((0.2, 3.0)):
        draws = drawn.sites["scale"][..., reparameterise].ravel()[::10]  # so thinned they are all but independent
        # Kolmogorov and Smirnov's test of two scales at a level of 1e-4 each: a false alarm in 5000 seeds; it is fixed.
        assert stats.kstest(draws, stats.halfnorm(scale=scale).cdf).pvalue > 1e-4
    assert not drawn.statistics["diverging"].any()
