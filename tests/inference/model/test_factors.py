"""Words become cases and groupings; a word with one level has no term."""

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.inference.model.factors import INTERACTIONS, find_factors
from bayes_tyre.inference.model.hyperparameters import PARAMETERS, apart_weight, prior_sites
from bayes_tyre.inference.model.repeat_distribution import judgeable
from bayes_tyre.published import tables
from bayes_tyre.record import CASE_FACTORS


def factor_table(**columns) -> pd.DataFrame:
    return pd.DataFrame(columns)


def test_the_published_cases_have_their_levels():
    factors = find_factors(tables.case_means()[list(CASE_FACTORS)])
    assert len(factors.cases) == 48
    assert factors.group.labels == ("dual loading", "dual unloading", "single loading", "single unloading")
    assert factors.speed.labels == (0.0, 15.0, 25.0, 35.0)
    assert factors.load.labels == (10.0, 20.0, 30.0)
    assert set(factors.step.labels) == {"5", "7", "10"}
    of_both = {"speed", "load", "step", "configuration_speed", "configuration_load"}
    assert set(factors.effects("k")) == of_both
    assert set(factors.effects("beta")) == {*of_both, "direction_step"}
    assert set(factors.effects("m")) == {"speed", "load", "step"}


def test_records_with_the_same_words_are_repeats_of_one_case():
    factors = find_factors(factor_table(record=["a", "b", "c"], configuration=["x", "y", "x"], step_kN=[5.0, 5.0, 5.0]))
    assert factors.of_record.tolist() == [0, 1, 0]
    assert factors.repeats.tolist() == [2, 1]


@pytest.mark.parametrize("repeats", [2, 3])
def test_some_of_the_records_have_the_model_of_all(repeats):
    """Of the case that alone has so many repeats one is left out: whether repeats are discordant stays a question."""
    speeds = [0.0] * repeats + [15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0]
    loads = [10.0] * repeats + [10.0, 20.0] * 4
    factors = find_factors(factor_table(record=range(len(speeds)), speed_km_h=speeds, initial_load_kN=loads))
    factors = replace(factors, speed=replace(factors.speed, basis=factors.speed.basis[:, :0]))  # cases to spare
    rest = factors.only(np.arange(len(speeds)) > 0)
    assert rest.repeats.max() == repeats - 1
    assert prior_sites(rest) == prior_sites(factors)
    assert ("discordant_weight" in prior_sites(factors)) == (repeats == 3)
    assert apart_weight(rest, PARAMETERS, PRIORS) == apart_weight(factors, PARAMETERS, PRIORS) > 0
    assert judgeable("mixture", rest) == judgeable("mixture", factors)


def test_a_table_without_words_is_one_case_and_has_no_terms():
    factors = find_factors(factor_table(record=["a", "b"]))
    assert len(factors.cases) == 1
    assert factors.repeats.tolist() == [2]
    assert factors.effects("k") == {}
    assert factors.effects("beta") == {}


def test_one_direction_has_no_direction_by_step():
    factors = find_factors(factor_table(record=["a", "b"], direction=["loading"] * 2, step_kN=[5.0, 10.0]))
    assert set(factors.effects("beta")) == {"step"}


@pytest.mark.parametrize("name", ["speed", "load", "step", *INTERACTIONS])
def test_a_basis_is_orthonormal_and_sums_to_zero(name):
    basis = getattr(find_factors(tables.case_means()[list(CASE_FACTORS)]), name).basis
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-14)
    np.testing.assert_allclose(basis.sum(axis=0), 0.0, atol=1e-14)


def test_direction_by_step_says_only_what_direction_and_step_do_not():
    factors = find_factors(tables.case_means()[list(CASE_FACTORS)])
    directions = np.array([case.direction == "loading" for case in factors.cases], dtype=float)
    main = np.column_stack([np.ones_like(directions), directions, factors.step.basis[factors.step.of_case]])
    both = np.column_stack([main, factors.direction_step.basis[factors.direction_step.of_case]])
    # Five combinations are met: two directions, two contrasts of three steps, one interaction.
    assert np.linalg.matrix_rank(main) == 4
    assert both.shape[1] == 5
    assert np.linalg.matrix_rank(both) == 5


def test_levels_without_freedom_have_no_interaction():
    crossed = factor_table(record=["a", "b"], direction=["loading", "unloading"], step_kN=[5.0, -10.0])
    assert set(find_factors(crossed).effects("beta")) == {"step"}


def test_a_size_of_step_of_one_direction_has_no_interaction_to_be_known():
    factors = find_factors(tables.case_means()[list(CASE_FACTORS)])
    of_step = dict(zip(factors.direction_step.labels, factors.direction_step.free, strict=True))
    assert [label for label, free in of_step.items() if not free] == ["unloading 7"]
    for name in ("speed", "load", "step", "configuration_speed", "configuration_load"):
        assert getattr(factors, name).free.all()


def crossed(*cases: tuple[str, float, float], direction: str = "loading") -> pd.DataFrame:
    table = pd.DataFrame(cases, columns=["configuration", "speed_km_h", "initial_load_kN"])
    return table.assign(record=[str(i) for i in range(len(table))], direction=direction)


def test_configuration_by_speed_says_only_what_neither_says():
    factors = find_factors(tables.case_means()[list(CASE_FACTORS)])
    dual = np.array([case.configuration == "dual" for case in factors.cases], dtype=float)
    for name, main in (("configuration_speed", factors.speed), ("configuration_load", factors.load)):
        alone = np.column_stack([np.ones_like(dual), dual, main.matrix])
        both = np.column_stack([alone, getattr(factors, name).matrix])
        # Two configurations at so many levels: a mean of each combination.
        assert both.shape[1] == np.linalg.matrix_rank(both) == 2 * len(main.labels)
        assert set(getattr(factors, name).labels) >= {f"dual {main.labels[0]:g}", f"single {main.labels[0]:g}"}


@pytest.mark.parametrize(
    ("cases", "named"),
    [
        (product("a", (0.0, 25.0), (10.0, 20.0)), set()),  # one configuration
        ([("a", 0.0, 10.0), ("a", 25.0, 10.0), ("b", 0.0, 10.0), ("b", 0.0, 20.0), ("a", 0.0, 20.0)], set()),
        (product("ab", (0.0, 25.0), (10.0,)), set()),  # four cases, of which the interaction is all that is left
        (product("ab", (0.0, 25.0), (10.0, 20.0)), {"configuration_speed", "configuration_load"}),
        (product("ab", (0.0,), (10.0, 20.0, 30.0)), set()),
    ],
)
def test_configuration_by_speed_or_load_needs_both_crossed_and_a_remainder_beside(cases, named):
    factors = find_factors(crossed(*cases))
    assert set(factors.effects("k")) & set(INTERACTIONS) == named
    assert factors.has_remainder("k")


def test_a_slope_over_the_load_differs_by_configuration_where_each_has_a_range():
    table = crossed(*product("abc", (0.0, 25.0), (10.0, 20.0)))
    load = table["initial_load_kN"].to_numpy()
    force = np.where(table["configuration"] == "b", 15.0, load + np.linspace(0.0, 1.0, len(load)))
    factor = find_factors(table, force).configuration_load
    assert factor.labels == ("a per 10 kN", "b per 10 kN", "c per 10 kN")
    assert factor.free.tolist() == [True, False, True]
    np.testing.assert_allclose(np.abs(factor.basis[:, 0]), np.sqrt([0.5, 0.0, 0.5]))
    np.testing.assert_allclose(factor.weight, (force - force.mean()) / 10.0)


def test_a_remainder_needs_more_cases_than_terms_with_one_repeat_or_more():
    once = tables.case_means()[list(CASE_FACTORS)]
    for table in (once, pd.concat([once] * 2)):
        assert find_factors(table).has_remainder("k")
    assert not find_factors(factor_table(record=["a", "b"], configuration=["x", "x"])).has_remainder("k")
    two_cells = factor_table(record=list("abcd"), configuration=["x", "x", "y", "y"])
    assert not find_factors(two_cells).has_remainder("beta")


def test_words_that_say_the_same_twice_do_not_hide_a_remainder():
    # Loading only standing, unloading only rolling, as in the source: four terms of which three are independent.
    aliased = factor_table(
        record=list("abcdefgh"),
        direction=["loading", "loading", "unloading", "unloading"] * 2,
        speed_km_h=[0.0, 0.0, 25.0, 25.0] * 2,
        initial_load_kN=[10.0, 20.0, 10.0, 20.0] * 2,
    )
    factors = find_factors(aliased)
    assert factors.design("k").shape == (4, 4)
    assert factors.has_remainder("k")
