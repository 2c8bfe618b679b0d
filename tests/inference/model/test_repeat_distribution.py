"""The density of records about their cases: that of SciPy, for any number of parameters."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.special import expit

from bayes_tyre.inference.model.default_priors import DISCORDANT_WIDENING
from bayes_tyre.inference.model.repeat_distribution import MixtureAbout, NormalAbout, repeats_about_cases


@pytest.mark.parametrize("parameters", [2, 5])
@pytest.mark.parametrize("kind", ["mixture", "student", "normal"])
def test_the_density_is_scipy_s(kind, parameters):
    rng = np.random.default_rng(1)
    deviation, scatter = rng.normal(size=(4, parameters)), rng.uniform(0.5, 2.0, (4, parameters))
    nu, weight = 5.0, 0.1
    about = made(kind, scatter, nu, weight)
    usual, odd = (
        stats.norm.logpdf(deviation, 0.0, wider * scatter).sum(axis=1) for wider in (1.0, DISCORDANT_WIDENING)
    )
    expected = {
        "normal": usual,
        "mixture": np.logaddexp(np.log(1 - weight) + usual, np.log(weight) + odd),
        "student": np.array([_student(*each, nu) for each in zip(deviation, scatter, strict=True)]),
    }[kind]
    np.testing.assert_allclose(about.log_prob(jnp.asarray(deviation)), expected, rtol=1e-12)
    if isinstance(about, MixtureAbout):
        odds = np.log(weight) + odd - np.log(1 - weight) - usual
        np.testing.assert_allclose(about.probability(jnp.asarray(deviation)), expit(odds), rtol=1e-9)


@pytest.mark.parametrize(("kind", "excess"), [("mixture", 0.1 * (DISCORDANT_WIDENING**2 - 1)), ("student", 2 / 8)])
def test_draws_scatter_as_widely_as_the_density_says(kind, excess):
    scatter = np.array([[0.5, 2.0], [1.0, 0.3]])
    drawn = np.asarray(made(kind, scatter, 10.0, 0.1).sample(jax.random.PRNGKey(0), (40_000,)))
    assert drawn.shape == (40_000, 2, 2)
    # Variances of 40,000 draws with a kurtosis below 30: a standard error of 2.7 %, 5 of them.
    np.testing.assert_allclose(drawn.var(axis=0), (1.0 + excess) * scatter**2, rtol=0.135)
    both = np.abs(drawn[:, 0, 0] / 0.5) > 3, np.abs(drawn[:, 0, 1] / 2.0) > 3
    assert np.mean(both[0] & both[1]) > 3 * np.mean(both[0]) * np.mean(both[1])  # a record's parameters widen together


def made(kind: str, scatter: np.ndarray, nu: float, weight: float) -> NormalAbout:
    hyperparameters = {"student_nu": jnp.asarray(nu), "discordant_weight": jnp.asarray(weight)}
    case = jnp.zeros(scatter.shape)
    return repeats_about_cases(kind, case, jnp.asarray(scatter), hyperparameters, DISCORDANT_WIDENING)


def _student(deviation: np.ndarray, scatter: np.ndarray, nu: Any) -> float:
    shape: Any = np.diag(scatter**2)  # SciPy's stubs say int, of both
    return float(stats.multivariate_t.logpdf(deviation, shape=shape, df=nu))
