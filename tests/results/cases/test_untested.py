"""Cases without records: the linear predictor, the effects of levels tested or not, the remainder, and the start."""

import numpy as np
import pytest
import xarray as xr
from helpers.hand_made_posteriors import fixed, grid, posterior, scattered

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.record import Case
from bayes_tyre.results.cases.draws import travel_mm
from bayes_tyre.results.cases.untested import log_values_of_untested, untested

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


def started(case: Case, **changed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return draws of F_i and J of a case without records."""
    values = untested(tree(**changed)["posterior"].to_dataset(), PRIORS, case, np.random.default_rng(1))
    assert np.isnan(values.start.d_i).all()
    assert np.isnan(values.mean().C).all()
    return values.start.F_i[:, 0], values.start.J[:, 0]


def of_records(name: str, direction: str = " loading ") -> np.ndarray:
    drawn = tree()["posterior"].to_dataset()
    alike = [i for i, label in enumerate(drawn["record"].to_numpy()) if direction in label]
    return drawn[name].to_numpy().reshape(-1, drawn.sizes["record"])[:, alike]


def test_a_step_from_a_load_that_was_tested_starts_as_its_records_did():
    for found, records in zip(started(of(15.0)), map(of_records, ("F_i", "J")), strict=True):
        # At each draw one of the twelve records, each as often.
        which = np.isclose(found[:, None], records)
        assert np.all(which.any(axis=1))
        assert which.mean(axis=0) == pytest.approx(1 / 12, abs=0.03)


def test_a_step_from_another_load_starts_on_the_line_through_those_of_the_nearest_two():
    """Loading from 20 kN alone: as much of the load; with records from 30 kN too: between both."""
    F_i, _ = started(of(15.0, load=25.0))
    np.testing.assert_allclose(F_i, 25.0 / 20.0 * of_records("F_i").mean(axis=1))
    drawn = tree()["posterior"].to_dataset()
    loads = np.where(np.arange(drawn.sizes["record"]) % 2, 20.0, 30.0)
    starts = np.broadcast_to(np.where(loads == 20.0, 15.0, 21.0), drawn["F_i"].shape)
    both = drawn.assign(F_i=(drawn["F_i"].dims, starts)).assign_coords(record_initial_load_kN=("record", loads))
    found = untested(both, PRIORS, of(15.0, load=22.5), np.random.default_rng(1)).start.F_i
    np.testing.assert_allclose(found, 16.5)
    np.testing.assert_allclose(untested(both, PRIORS, of(15.0, load=35.0), np.random.default_rng(1)).start.F_i, 24.0)


def test_records_that_start_from_0_alone_say_nothing_of_another_load():
    drawn = tree()["posterior"].to_dataset()
    drawn = drawn.assign_coords(record_initial_load_kN=("record", np.zeros(drawn.sizes["record"])))
    with pytest.raises(BadInput, match="starts from 0 kN, which does not say the force at another load"):
        untested(drawn, PRIORS, of(15.0, load=25.0), np.random.default_rng(1))


def test_a_case_without_records_goes_as_far_for_its_step_as_those_that_have_some():
    drawn = tree()["posterior"].to_dataset()
    travel = np.linspace(2.0, 4.0, drawn.sizes["record"])
    drawn = drawn.assign_coords(record_travel_mm=("record", travel))
    mine = travel[[i for i, label in enumerate(drawn["record"].to_numpy()) if " loading " in label]]
    assert travel_mm(drawn, of(15.0)._replace(step_kN=5.0)) == pytest.approx(np.median(mine) / 2.0)


@pytest.mark.parametrize("damage", ["no means", "another group"])
def test_a_posterior_without_the_mean_of_a_group_is_refused(damage):
    drawn = tree()["posterior"].to_dataset()
    damaged = drawn.drop_vars("k_group") if damage == "no means" else drawn.assign_coords(group=["a", "b"])
    with pytest.raises(BadInput, match="lacks k_group"):
        untested(damaged, PRIORS, of(15.0), np.random.default_rng(1))


def test_where_the_load_is_the_force_that_records_started_from_no_case_is_new():
    drawn = tree()["posterior"].to_dataset()
    slope = drawn.assign(log_k_load=(("chain", "draw", "load"), np.zeros((*drawn["k"].shape[:2], 1))))
    with pytest.raises(BadInput, match="--initial-load actual"):
        untested(slope, PRIORS, of(15.0), np.random.default_rng(1))
