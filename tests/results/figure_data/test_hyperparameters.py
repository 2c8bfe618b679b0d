"""The parameters of populations that a posterior holds, and the few that a pair plot shows."""

import numpy as np
import pytest
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.results.figure_data.hyperparameters import (
    MOST_PAIRED,
    Hyperparameter,
    divergences,
    hyperparameters,
    paired,
)


def test_populations_are_the_cells_then_every_scalar_with_their_units():
    factor_table = grid()
    draws = scattered(factor_table, seed=21)
    found = {one.name: one for one in hyperparameters(posterior(draws, factor_table))}
    cells = [f"{c} {d}" for c in ("dual", "single") for d in ("loading", "unloading")]
    scalars = {name for name, values in draws.items() if values.ndim == 2}
    assert list(found)[:8] == [f"{p}_group[{cell}]" for p in ("k", "beta") for cell in cells]
    assert set(found) == {*list(found)[:8], *scalars}
    for i, cell in enumerate(cells):
        one = found[f"beta_group[{cell}]"]
        np.testing.assert_array_equal(one.draws, draws["beta_group"][..., i])
        assert (one.unit, one.configuration) == ("mm", cell.split()[0])
    assert (found["sd_J"].unit, found["sd_J"].configuration) == ("kN", None)
    assert found["sd_log_k_case"].unit == ""


@pytest.mark.parametrize("labels", [("a b", "c  d"), ("", "x")])
def test_a_cell_knows_its_configuration_whatever_its_label(labels):
    factor_table = grid(labels)
    found = hyperparameters(posterior(scattered(factor_table, seed=22), factor_table))
    assert {one.configuration for one in found if one.name.startswith("k_group")} == set(labels)


def test_without_words_the_one_cell_has_no_label():
    factor_table = grid()[["record"]]
    found = hyperparameters(posterior(scattered(factor_table, seed=23), factor_table))
    assert [(one.name, one.configuration) for one in found[:2]] == [("k_group", ""), ("beta_group", "")]


def test_a_pair_plot_shows_cells_of_both_parameters_and_the_scales_ten_at_most():
    factor_table = grid(("a", "b", "c"))
    shown = paired(hyperparameters(posterior(scattered(factor_table, seed=24), factor_table)))
    cells = ("a loading", "a unloading", "b loading", "b unloading")
    expected = [f"{p}_group[{cell}]" for p in ("k", "beta") for cell in cells]
    assert [one.name for one in shown] == [*expected, "sd_log_k_case", "sd_log_beta_case"]
    assert len(shown) == MOST_PAIRED


def test_what_does_not_vary_or_is_not_finite_is_no_part_of_a_pair_plot():
    rng = np.random.default_rng(25)
    still, broken = np.full((4, 50), 0.1), rng.normal(size=(4, 50))
    broken[1, 7] = np.nan
    given = {"k_group[a]": rng.normal(size=(4, 50)), "sd_log_k_case": still, "sd_log_beta_case": broken}
    shown = paired([Hyperparameter(name, "", None, draws) for name, draws in given.items()])
    assert [one.name for one in shown] == ["k_group[a]"]


def test_divergences_are_those_of_the_sampler():
    factor_table, marked = grid(), np.zeros((4, 250), dtype=bool)
    marked[1, [0, 249]] = True
    tree = posterior(scattered(factor_table, seed=26), factor_table, {"diverging": marked})
    np.testing.assert_array_equal(divergences(tree), marked)
