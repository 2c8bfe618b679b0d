"""The parameters of populations that a posterior holds, and the few that a pair plot shows."""

import numpy as np
import pytest
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.results.hyperparameters import MOST_PAIRED, Population, divergences, paired, populations


def test_populations_are_the_cells_then_every_scalar_with_their_units():
    words = grid()
    draws = scattered(words, seed=21)
    found = {one.name: one for one in populations(posterior(draws, words))}
    cells = [f"{c} {d}" for c in ("dual", "single") for d in ("loading", "unloading")]
    scalars = {name for name, values in draws.items() if values.ndim == 2}
    assert list(found)[:8] == [f"{p}_cell[{cell}]" for p in ("k", "beta") for cell in cells]
    assert set(found) == {*list(found)[:8], *scalars}
    for i, cell in enumerate(cells):
        one = found[f"beta_cell[{cell}]"]
        np.testing.assert_array_equal(one.draws, draws["beta_cell"][..., i])
        assert (one.unit, one.configuration) == ("mm", cell.split()[0])
    assert (found["J_scale"].unit, found["J_scale"].configuration) == ("kN", None)
    assert found["log_k_case_scale"].unit == ""


@pytest.mark.parametrize("labels", [("a b", "c  d"), ("", "x")])
def test_a_cell_knows_its_configuration_whatever_its_label(labels):
    words = grid(labels)
    found = populations(posterior(scattered(words, seed=22), words))
    assert {one.configuration for one in found if one.name.startswith("k_cell")} == set(labels)


def test_without_words_the_one_cell_has_no_label():
    words = grid()[["record"]]
    found = populations(posterior(scattered(words, seed=23), words))
    assert [(one.name, one.configuration) for one in found[:2]] == [("k_cell", ""), ("beta_cell", "")]


def test_a_pair_plot_shows_cells_of_both_parameters_and_the_scales_ten_at_most():
    words = grid(("a", "b", "c"))
    shown = paired(populations(posterior(scattered(words, seed=24), words)))
    cells = ("a loading", "a unloading", "b loading", "b unloading")
    expected = [f"{p}_cell[{cell}]" for p in ("k", "beta") for cell in cells]
    assert [one.name for one in shown] == [*expected, "log_k_case_scale", "log_beta_case_scale"]
    assert len(shown) == MOST_PAIRED


def test_what_does_not_vary_or_is_not_finite_is_no_part_of_a_pair_plot():
    rng = np.random.default_rng(25)
    still, broken = np.full((4, 50), 0.1), rng.normal(size=(4, 50))
    broken[1, 7] = np.nan
    given = {"k_cell[a]": rng.normal(size=(4, 50)), "log_k_case_scale": still, "log_beta_case_scale": broken}
    shown = paired([Population(name, "", None, draws) for name, draws in given.items()])
    assert [one.name for one in shown] == ["k_cell[a]"]


def test_divergences_are_those_of_the_sampler():
    words, marked = grid(), np.zeros((4, 250), dtype=bool)
    marked[1, [0, 249]] = True
    tree = posterior(scattered(words, seed=26), words, {"diverging": marked})
    np.testing.assert_array_equal(divergences(tree), marked)
