"""Cases without records: the linear predictor, the effects of levels tested or not, the remainder, and the start."""

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.record import Case
from bayes_tyre.results.untested_cases import log_values_of_untested, untested

SPEEDS, DRAWS = (0.0, 10.0, 20.0, 40.0), 1000
#: Effects of the four speeds on log k, along a curve.
EFFECTS = np.array([-0.08, -0.02, 0.02, 0.08])
REST = 0.01


def tree(**changed: np.ndarray) -> xr.DataTree:
    """Return a posterior that is sure of everything but its remainder, which is small."""
    factor_table = grid(("single",), speeds=SPEEDS)
    exact = {"log_k_speed": fixed(EFFECTS, draws=DRAWS), "sd_log_k_speed": fixed(0.06, draws=DRAWS)}
    exact |= {"k_group": fixed(np.full(2, 2.0), draws=DRAWS), "beta_group": fixed(np.full(2, 0.05), draws=DRAWS)}
    exact |= {"sd_log_k_case": fixed(REST, draws=DRAWS), "sd_log_beta_case": fixed(REST, draws=DRAWS)}
    drawn = scattered(factor_table, seed=2, chains=exact["sd_log_k_case"].shape[0], draws=DRAWS)
    return posterior(drawn | exact | changed, factor_table)


def of(speed: float, load: float = 20.0) -> Case:
    return Case("single", "loading", speed, load, 10.0)


def log_k(case: Case, **changed: np.ndarray) -> np.ndarray:
    drawn = tree(**changed)["posterior"].to_dataset()
    return log_values_of_untested(drawn, PRIORS, "k", [case], np.random.default_rng(1))[:, 0]


@pytest.mark.parametrize(("speed", "effect"), list(zip(SPEEDS, EFFECTS, strict=True)))
def test_at_levels_tested_it_is_the_linear_predictor_and_the_remainder(speed, effect):
    """Some thousands of draws: a mean is known to 2 % of the remainder's standard deviation."""
    drawn = log_k(of(speed))
    assert drawn.mean() == pytest.approx(np.log(2.0) + effect, abs=0.1 * REST)
    assert drawn.std() == pytest.approx(REST, rel=0.06)


def test_a_speed_between_two_has_an_effect_between_theirs_and_one_far_away_has_any():
    between, far = log_k(of(15.0)), log_k(of(200.0))
    assert EFFECTS[1] < np.median(between) - np.log(2.0) < EFFECTS[2]
    assert 3.0 * REST < between.std() < 0.06
    assert far.std() > 0.06


def test_a_factor_that_did_not_vary_has_an_effect_of_its_priors_size():
    scale = PRIORS["sd_log_k_load"].parameters[0]
    drawn = log_k(of(10.0, load=25.0)) - log_k(of(10.0))
    # The load of a step has two levels, 20 and 30 kN, but the direction says which: the model has no term for it.
    assert drawn.std() == pytest.approx(np.sqrt(1.5) * scale, rel=0.1)


def test_a_step_starts_from_the_load_asked_for_as_those_that_were_measured_did():
    values = untested(tree()["posterior"].to_dataset(), PRIORS, of(15.0, load=25.0), np.random.default_rng(1))
    start = values.start
    drawn = tree()["posterior"].to_dataset()
    alike = [i for i, label in enumerate(drawn["record"].to_numpy()) if " loading " in label]
    for found, measured, off in ((start.F_i, drawn["F_i"], 5.0), (start.J, drawn["J"], 0.0)):
        records = measured.to_numpy().reshape(-1, measured.sizes["record"])[:, alike] + off
        # At each draw one of the twelve records, each as often.
        which = np.isclose(found, records)
        assert np.all(which.any(axis=1))
        assert which.mean(axis=0) == pytest.approx(1 / 12, abs=0.03)
    assert np.isnan(start.d_i).all()
    assert np.isnan(values.mean().C).all()


def test_where_the_load_is_the_force_that_records_started_from_no_case_is_new():
    drawn = tree()["posterior"].to_dataset()
    slope = drawn.assign(log_k_load=(("chain", "draw", "load"), np.zeros((*drawn["k"].shape[:2], 1))))
    with pytest.raises(BadInput, match="--initial-load actual"):
        untested(slope, PRIORS, of(15.0), np.random.default_rng(1))
