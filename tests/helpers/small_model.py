"""A small hierarchical model for tests of the sampler, and draws compared bit for bit."""

import jax
import numpy as np
import numpyro
from numpyro import distributions as dist

from bayes_tyre.inference.sampling.run import Draws, SamplerSettings

STARTS = {"mu": 1.0, "tau": 1.0}
SETTINGS = SamplerSettings(chains=2, warmup=130, draws=110, seed=3)


def model(y: jax.Array) -> None:
    mu = numpyro.sample("mu", dist.Normal(0.0, 5.0))
    tau = numpyro.sample("tau", dist.HalfNormal(2.0))
    x = numpyro.sample("x", dist.Normal(mu, tau).expand([20]).to_event(1))
    numpyro.deterministic("twice", 2.0 * np.asarray(1.0) * x)
    numpyro.deterministic("squares", tau * x**2)
    numpyro.sample("y", dist.Normal(x, 0.5).to_event(1), obs=y)


DATA = {"y": jax.numpy.asarray(np.random.default_rng(0).normal(1.0, 1.5, 20))}


def assert_same(one: Draws, other: Draws) -> None:
    for left, right in ((one.sites, other.sites), (one.statistics, other.statistics)):
        assert left.keys() == right.keys()
        for name in left:
            np.testing.assert_array_equal(left[name], right[name], err_msg=name)
