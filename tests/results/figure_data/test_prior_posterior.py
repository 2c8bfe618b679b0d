"""Prior and posterior of scales: densities on one axis, and what contraction means."""

import numpy as np
import pytest

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.results.figure_data.hyperparameters import Hyperparameter
from bayes_tyre.results.figure_data.prior_posterior import PriorPosterior, prior_posteriors

SCALARS = [name for name in PRIORS if not name.endswith("_group")]


def scale_of(name: str, draws: np.ndarray) -> PriorPosterior:
    (found,) = prior_posteriors([Hyperparameter(name, "kN", None, draws.reshape(4, -1))])
    return found


@pytest.mark.parametrize("name", SCALARS)
def test_a_posterior_that_is_the_prior_has_no_contraction_and_the_same_density(name):
    found = scale_of(name, PRIORS[name].scipy().rvs(8000, random_state=np.random.default_rng(1)))
    # A variance of 8000 draws has a relative standard error below 2.5 %, whatever the family here.
    assert found.contraction == pytest.approx(0.0, abs=4 * 0.025)
    inside = (found.at > found.at[-1] * 0.02) & (found.at < found.at[-1] * 0.98)
    np.testing.assert_allclose(found.posterior[inside], found.prior[inside], atol=0.12)
    assert found.log == (PRIORS[name].family.__name__ == "LogNormal")


@pytest.mark.parametrize("name", ["sigma_typical", "sd_log_k_case"])
def test_contraction_of_a_log_normal_scale_is_that_of_the_variance_of_its_logarithm(name):
    location, spread = PRIORS[name].parameters
    draws = np.exp(location + 0.1 * spread * np.random.default_rng(2).normal(size=20000))
    assert scale_of(name, draws).contraction == pytest.approx(1 - 0.1**2, abs=0.002)


def test_a_half_normal_scale_that_shrinks_towards_zero_contracts_on_its_own_scale():
    draws = np.abs(0.02 * np.random.default_rng(3).normal(size=20000))  # a tenth of its prior's width
    found = scale_of("sd_log_k_step", draws)
    assert found.contraction == pytest.approx(1 - 0.1**2, abs=0.002)
    assert not found.log
    assert found.at[0] == 0.0
    assert found.posterior[0] > 0.8  # highest at zero, not cut off there


def test_the_axis_holds_the_whole_posterior_and_all_but_the_prior_s_tails():
    draws = 40.0 + np.random.default_rng(4).normal(size=4000)  # far above its prior
    found = scale_of("sd_J", draws)
    assert found.at[-1] == draws.max()
    assert found.at[0] == 0.0
    assert np.all(np.diff(found.at) >= 0)
    assert found.prior.max() == 1.0
    assert found.posterior.max() == pytest.approx(1.0, abs=0.01)
    assert found.prior[np.searchsorted(found.at, 30.0)] < 1e-6
    narrow = scale_of("sigma_typical", 0.03 + 1e-5 * np.random.default_rng(5).normal(size=4000))
    low, high = PRIORS["sigma_typical"].scipy().ppf([0.005, 0.995])
    np.testing.assert_allclose(narrow.at[[0, -1]], [low, high])
    assert narrow.posterior.max() == pytest.approx(1.0, abs=0.02)


def test_only_scalars_with_a_prior_that_vary_are_scales():
    rng = np.random.default_rng(6)
    draws = np.abs(rng.normal(1, 0.1, (4, 100)))
    given = [
        Hyperparameter("k_group", "kN/mm", "", draws),
        Hyperparameter("displacement_scale", "", None, draws),
        Hyperparameter("sd_J", "kN", None, draws),
        Hyperparameter("sigma_typical", "kN", None, np.full((4, 100), 0.03)),
    ]
    assert [one.name for one in prior_posteriors(given)] == ["sd_J"]
