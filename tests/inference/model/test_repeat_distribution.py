"""The density of records about their cases: that of SciPy, for any number of parameters."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from numpyro.handlers import trace
from scipy import stats

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.repeat_distribution import add_repeat_density


@pytest.mark.parametrize("parameters", [2, 5])
@pytest.mark.parametrize("kind", ["mixture", "student", "normal"])
def test_the_density_is_scipy_s(kind, parameters):
    rng = np.random.default_rng(1)
    deviation, scatter = rng.normal(size=(4, parameters)), rng.uniform(0.5, 2.0, (4, parameters))
    nu, weight = 5.0, 0.1
    with trace() as sites:
        hyperparameters = {"student_nu": jnp.asarray(nu), "discordant_weight": jnp.asarray(weight)}
        add_repeat_density(jnp.asarray(deviation), jnp.asarray(scatter), kind, hyperparameters)
    usual, odd = (
        stats.norm.logpdf(deviation, 0.0, wider * scatter).sum(axis=1) for wider in (1.0, DISCORDANT_WIDENING)
    )
    expected = {
        "normal": usual,
        "mixture": np.logaddexp(np.log(1 - weight) + usual, np.log(weight) + odd),
        "student": np.array([_student(*each, nu) for each in zip(deviation, scatter, strict=True)]),
    }[kind]
    np.testing.assert_allclose(sites["repeats"]["fn"].log_factor, expected, rtol=1e-12)


def _student(deviation: np.ndarray, scatter: np.ndarray, nu: Any) -> float:
    shape: Any = np.diag(scatter**2)  # SciPy's stubs say int, of both
    return float(stats.multivariate_t.logpdf(deviation, shape=shape, df=nu))
