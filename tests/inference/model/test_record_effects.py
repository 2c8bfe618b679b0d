"""Records about their cases: the density is put right from the one choice sampled to all of them."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.hand_made_posteriors import grid
from helpers.repeats_by_hand import Numbers, by_hand
from jaxtyping import Array, Float
from numpyro import handlers
from numpyro.infer import init_to_uniform

from bayes_tyre.inference.model import record_effects
from bayes_tyre.inference.model.factors import find_factors
from bayes_tyre.inference.model.hyperparameters import prior_sites, sample_hyperparameters
from bayes_tyre.inference.model.coordinates.laplace_cases import case_estimates
from bayes_tyre.inference.model.record_effects import sample_repeats
from bayes_tyre.inference.model.coordinates.reparameterisation import Reparameterised

LEVELS = find_factors(grid(repeats=3))
ODD = (4, 9, 10)


def traced(looks: tuple[int, ...], repeats: str, seed: int) -> dict[str, Any]:
    """Return the sites of records whose values are given, of which some look discordant."""
    random, count = np.random.default_rng(seed), len(LEVELS.of_record)
    values = jnp.asarray(random.normal(0.0, 0.2, (count, 2)))
    estimates = case_estimates(np.asarray(values), np.full((count, 2), 0.01), LEVELS)
    estimates = estimates._replace(discordant=jnp.asarray(np.isin(np.arange(count), looks)))

    def reparameterise(above: Float[Array, "records 2"], scale: Float[Array, "records 2"]) -> Reparameterised:
        return Reparameterised(values, values - above, jnp.zeros(count))

    def model() -> None:
        hyperparameters = sample_hyperparameters(prior_sites(LEVELS, repeats))
        sample_repeats(reparameterise, LEVELS, estimates, repeats, hyperparameters)

    seeded = handlers.substitute(handlers.seed(model, seed), substitute_fn=init_to_uniform())
    return handlers.trace(seeded).get_trace()


@pytest.mark.parametrize("looks", [(), ODD])
@pytest.mark.parametrize("seed", [1, 2])
def test_density_is_that_of_all_choices_whichever_was_sampled(monkeypatch, looks, seed):
    took, marginalise = [], record_effects.marginalise
    monkeypatch.setattr(record_effects, "marginalise", lambda *given: took.append(given[:5]) or marginalise(*given))
    added = float(traced(looks, "mixture", seed)["other_choices"]["fn"].log_factor)
    numbers = Numbers(*map(np.asarray, took[0]))
    expected = 0.0
    for case in range(len(LEVELS.cases)):
        joint = by_hand(numbers, LEVELS, case)
        choice = tuple(bool(record in looks) for record in np.flatnonzero(LEVELS.of_record == case))
        prior = sum(np.log(numbers.weight) if odd else np.log1p(-numbers.weight) for odd in choice)
        expected += np.logaddexp.reduce(list(joint.values())) - (joint[choice] - prior)
    assert added == pytest.approx(expected, rel=1e-9)


def test_repeats_that_look_discordant_are_sampled_as_such():
    usual, odd = (traced(looks, "mixture", 1)["repeats"]["fn"].log_factor for looks in ((), ODD))
    same = np.delete(np.arange(len(usual)), ODD)
    np.testing.assert_allclose(usual[same], odd[same])
    assert (np.asarray(odd)[list(ODD)] != np.asarray(usual)[list(ODD)]).all()


@pytest.mark.parametrize(("repeats", "site"), [("mixture", "stand_in_z"), ("student", "case_z"), ("normal", "case_z")])
def test_cases_are_sampled_where_they_are_not_summed_out(repeats, site):
    sites = traced((), repeats, 1)
    assert site in sites
    assert ("other_choices" in sites) == (repeats == "mixture")
    assert sites["k_case"]["value"].shape == (len(LEVELS.cases),)
