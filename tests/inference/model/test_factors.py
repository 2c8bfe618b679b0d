"""Words become cases and groupings; a word with one level has no term."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.inference.model.factors import find_levels
from bayes_tyre.published import tables
from bayes_tyre.record import CASE_WORDS


def words(**columns) -> pd.DataFrame:
    return pd.DataFrame(columns)


def test_the_published_cases_have_their_levels():
    levels = find_levels(tables.case_means()[list(CASE_WORDS)])
    assert len(levels.cases) == 48
    assert levels.cell.labels == ("dual loading", "dual unloading", "single loading", "single unloading")
    assert levels.speed.labels == (0.0, 15.0, 25.0, 35.0)
    assert levels.load.labels == (10.0, 20.0, 30.0)
    assert set(levels.step.labels) == {"5", "7", "10"}
    assert set(levels.factors("k")) == {"speed", "load", "step"}
    assert set(levels.factors("beta")) == {"speed", "load", "step", "direction_step"}


def test_records_with_the_same_words_are_repeats_of_one_case():
    levels = find_levels(words(record=["a", "b", "c"], configuration=["x", "y", "x"], step_kN=[5.0, 5.0, 5.0]))
    assert levels.of_record.tolist() == [0, 1, 0]
    assert levels.repeats.tolist() == [2, 1]


def test_a_table_without_words_is_one_case_and_has_no_terms():
    levels = find_levels(words(record=["a", "b"]))
    assert len(levels.cases) == 1
    assert levels.repeats.tolist() == [2]
    assert levels.factors("k") == {}
    assert levels.factors("beta") == {}


def test_one_direction_has_no_direction_by_step():
    levels = find_levels(words(record=["a", "b"], direction=["loading"] * 2, step_kN=[5.0, 10.0]))
    assert set(levels.factors("beta")) == {"step"}


@pytest.mark.parametrize("name", ["speed", "load", "step", "direction_step"])
def test_a_basis_is_orthonormal_and_sums_to_zero(name):
    basis = getattr(find_levels(tables.case_means()[list(CASE_WORDS)]), name).basis
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-14)
    np.testing.assert_allclose(basis.sum(axis=0), 0.0, atol=1e-14)


def test_direction_by_step_says_only_what_direction_and_step_do_not():
    levels = find_levels(tables.case_means()[list(CASE_WORDS)])
    directions = np.array([case.direction == "loading" for case in levels.cases], dtype=float)
    main = np.column_stack([np.ones_like(directions), directions, levels.step.basis[levels.step.of_case]])
    both = np.column_stack([main, levels.direction_step.basis[levels.direction_step.of_case]])
    # Five combinations are met: two directions, two contrasts of three steps, one interaction.
    assert np.linalg.matrix_rank(main) == 4
    assert both.shape[1] == 5
    assert np.linalg.matrix_rank(both) == 5


def test_levels_without_freedom_have_no_interaction():
    crossed = words(record=["a", "b"], direction=["loading", "unloading"], step_kN=[5.0, -10.0])
    assert set(find_levels(crossed).factors("beta")) == {"step"}


def test_a_remainder_needs_repeats_and_more_cases_than_terms():
    assert not find_levels(tables.case_means()[list(CASE_WORDS)]).has_remainder("k")
    twice = pd.concat([tables.case_means()[list(CASE_WORDS)]] * 2)
    assert find_levels(twice).has_remainder("k")
    assert not find_levels(words(record=["a", "b"], configuration=["x", "x"])).has_remainder("k")
    two_cells = words(record=list("abcd"), configuration=["x", "x", "y", "y"])
    assert not find_levels(two_cells).has_remainder("beta")


def test_words_that_say_the_same_twice_do_not_hide_a_remainder():
    # Loading only standing, unloading only rolling, as in the source: four terms of which three are independent.
    aliased = words(
        record=list("abcdefgh"),
        direction=["loading", "loading", "unloading", "unloading"] * 2,
        speed_km_h=[0.0, 0.0, 25.0, 25.0] * 2,
        initial_load_kN=[10.0, 20.0, 10.0, 20.0] * 2,
    )
    levels = find_levels(aliased)
    assert levels.design("k").shape == (4, 4)
    assert levels.has_remainder("k")
