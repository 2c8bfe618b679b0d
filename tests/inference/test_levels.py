"""Words become cases and groupings; a word with one level has no term."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.inference.levels import find_levels
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
def test_a_basis_is_orthonormal_and_sums_to_zero_in_each_group(name):
    factor = getattr(find_levels(tables.case_means()[list(CASE_WORDS)]), name)
    basis = factor.basis
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-14)
    groups = np.eye(factor.group.max() + 1)[:, factor.group]
    np.testing.assert_allclose(groups @ basis, 0.0, atol=1e-14)
    assert basis.shape[1] == len(factor.labels) - len(set(factor.group.tolist()))
