"""A goal's weights give the numbers of contrasts.csv and cases.csv, and what is no goal is refused."""

import numpy as np
import pytest
from helpers.hand_made_posteriors import grid, posterior, scattered

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.sampling.datatree import draws_in_a_row, tree_cases
from bayes_tyre.record import Case
from bayes_tyre.results.contrasts import contrasts
from bayes_tyre.results.next_tests.goals import Goal, parse_goal

TREE = posterior(scattered(grid(), seed=5), grid())
POSTERIOR = TREE["posterior"].to_dataset()
CASES = tree_cases(POSTERIOR)


def parsed(text: str, new: tuple[Case, ...] = ()) -> Goal:
    return parse_goal(text, (*CASES, *new), len(CASES), ("k", "beta"))


def median(goal: Goal) -> float:
    return float(np.median(np.exp(np.log(draws_in_a_row(POSTERIOR[f"{goal.parameter}_case"])) @ goal.weights)))


@pytest.mark.parametrize(("text", "of"), [("k dual / single", "4 pairs"), ("beta  loading/unloading", "same span")])
def test_a_ratio_is_the_average_of_contrasts_csv(text, of):
    goal, table = parsed(text), contrasts(TREE, "pass")
    factors = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN"]
    whole = table[table[factors].isna().all(axis=1) & (table["parameter"] == goal.parameter)]
    assert median(goal) in [pytest.approx(value, rel=1e-9) for value in whole["median"]]
    assert of in goal.of


@pytest.mark.parametrize("text", ["k dual / single", "k loading / unloading"])
def test_a_ratio_the_other_way_round_has_the_opposite_weights(text):
    parameter, above, _, below = text.split()
    np.testing.assert_array_equal(parsed(f"{parameter} {below} / {above}").weights, -parsed(text).weights)


def test_directions_are_matched_from_one_load_where_no_spans_match():
    cases = [Case("a", "loading", 0.0, 20.0, 10.0), Case("a", "unloading", 0.0, 20.0, -10.0)]
    goal = parse_goal("k loading / unloading", cases, 2, ("k",))
    assert goal.weights.tolist() == [1.0, -1.0]
    assert "same initial load" in goal.of


@pytest.mark.parametrize("other", ["single", "315/80 R22.5", "a / b"])
def test_a_label_may_have_a_slash(other):
    cases = [Case(name, "loading", 0.0, 20.0, 10.0) for name in ("385/65 R22.5", other)]
    for slash in ("/", " / "):
        goal = parse_goal(f"k 385/65 R22.5{slash}{other}", cases, 2, ("k",))
        assert goal.weights.tolist() == [1.0, -1.0]
        assert parse_goal(f"k {other}{slash}385/65 R22.5", cases, 2, ("k",)).weights.tolist() == [-1.0, 1.0]
    with pytest.raises(BadInput, match="no ratio"):
        parse_goal("k 385/65 R22.5", cases, 2, ("k",))


def test_a_case_is_meant_by_its_label_new_or_not():
    new = Case("single", "loading", 25.0, 30.0, 10.0)
    assert parsed(f"k {CASES[2].label}").weights.tolist() == np.eye(len(CASES))[2].tolist()
    assert parsed(f"beta {new.label}", (new,)).weights.tolist() == [0.0] * len(CASES) + [1.0]


def test_a_new_case_does_not_change_what_a_ratio_is():
    new = tuple(Case(name, "loading", 25.0, 30.0, 10.0) for name in ("dual", "single"))
    assert parsed("k dual / single", new).weights.tolist() == [*parsed("k dual / single").weights.tolist(), 0.0, 0.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("energy_per_cycle dual / single", "bayes-tyre motion"),
        ("C dual / single", "the posterior has k, beta"),
        ("k dual / triple", "no ratio of configurations"),
        ("k", "no case"),
        ("", "no case"),
        ("k single / single", "no ratio"),
    ],
)
def test_what_is_no_goal_is_refused(text, said):
    with pytest.raises(BadInput, match=said):
        parsed(text)
