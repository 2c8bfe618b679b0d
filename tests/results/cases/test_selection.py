"""Which cases are meant: labels, words, opposite directions, and what is said where nothing matches."""

import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Case
from bayes_tyre.results.cases.selection import (
    CaseQuery,
    Choice,
    case_list,
    choose,
    parse_query,
    sign_of,
    without_opposite,
)

#: Steps of 10 kN from 20 kN up and down, of 5 kN down alone, of two configurations.
CASES = [
    Case(configuration, direction, 0.0, 20.0, step)
    for configuration in ("single", "dual")
    for direction, step in (("loading", 10.0), ("unloading", -10.0), ("unloading", -5.0))
]


def chosen(texts: list[str], cases: list[Case] = CASES) -> Choice:
    return choose(parse_query(texts, cases), cases)


def labels(indices: tuple[int, ...]) -> list[str]:
    return [CASES[i].label for i in indices]


@pytest.mark.parametrize(
    ("texts", "wanted", "alone"),
    [
        (["single (0)20-10"], ["single (0)20-30", "single (0)20-10"], []),
        (["single (0)20-30"], ["single (0)20-30", "single (0)20-10"], []),
        ([" single (0)20-15 "], ["single (0)20-15"], ["single (0)20-15"]),
        (["(0)20-10"], ["single (0)20-30", "single (0)20-10", "dual (0)20-30", "dual (0)20-10"], []),
        (
            ["dual (0)20-10", "single (0)20-15"],
            ["single (0)20-15", "dual (0)20-30", "dual (0)20-10"],
            ["single (0)20-15"],
        ),
        (["configuration=dual,step_kN=-10"], ["dual (0)20-30", "dual (0)20-10"], []),
        (["configuration = dual", "step_kN=10.0"], ["dual (0)20-30", "dual (0)20-10"], []),
        (["configuration=dual,direction=unloading"], ["dual (0)20-10", "dual (0)20-15"], []),
        (
            ["step_kN=-5,step_kN=-10,direction=unloading,configuration=single"],
            ["single (0)20-10", "single (0)20-15"],
            [],
        ),
        (["configuration=single"], ["single (0)20-30", "single (0)20-10", "single (0)20-15"], ["single (0)20-15"]),
        (["step_kN=-5"], ["single (0)20-15", "dual (0)20-15"], ["single (0)20-15", "dual (0)20-15"]),
    ],
)
def test_a_label_or_words_name_cases_and_the_opposite_direction_comes_too(texts, wanted, alone):
    choice = chosen(texts)
    assert labels(choice.cases) == wanted
    assert labels(choice.alone) == alone


@pytest.mark.parametrize("label", ["a=b, c=d", "speed_km_h=5", "=cmd()", "../../x", "<b>ü\u202e", '"quoted"', "x,y"])
def test_any_label_is_found_as_it_stands(label):
    hostile = [*CASES, CASES[0]._replace(configuration=label)]
    assert chosen([f"{label} (0)20-30"], hostile).cases == (6,)


@pytest.mark.parametrize("label", ["a=b", "speed_km_h=5", "=cmd()", "x,y", "a, b (c)"])
def test_words_take_any_configuration_but_one_with_a_name_behind_a_comma(label):
    hostile = [*CASES, CASES[0]._replace(configuration=label)]
    assert chosen([f"configuration={label}"], hostile).cases == (6,)
    assert chosen([f"configuration={label},step_kN=10,direction=loading"], hostile).cases == (6,)


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["nonsense"], "no case matches nonsense"),
        (["single (0)20-10", "single (0)20-11"], "no case matches single (0)20-11"),
        (["speed_km_h=-35"], "no case matches speed_km_h=-35"),
        (["configuration=triple,speed_km_h=35"], "no case matches configuration=triple, speed_km_h=35"),
        (["direction=loading,step_kN=-10"], "no case matches direction=loading, step_kN=-10"),
    ],
)
def test_what_matches_no_case_is_told_what_cases_there_are(texts, said):
    with pytest.raises(BadInput) as refused:
        chosen(texts)
    assert said in str(refused.value)
    assert "there are 6: single (0)20-30, single (0)20-10" in str(refused.value)
    assert "; name one" in str(refused.value)


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["speed=0"], "'speed' is no factor"),
        (["configuration=single,repeat=1"], "'repeat' is no factor"),
        (["speed_km_h=fast"], "speed_km_h=fast"),
        (["speed_km_h="], "speed_km_h= is no finite number"),
        (["step_kN=nan"], "step_kN=nan"),
        (["direction=up"], "loading or unloading"),
        (["single (0)20-10", "speed_km_h=0"], "side by side"),
    ],
)
def test_words_that_cannot_be_are_refused(texts, said):
    with pytest.raises(BadInput, match=r".*;.*") as refused:
        parse_query(texts, CASES)
    assert said in str(refused.value)


def test_long_lists_are_cut_and_odd_characters_do_not_reach_the_terminal():
    assert case_list(["a", "b"]) == "a, b"
    assert case_list([str(i) for i in range(20)]) == "0, 1, 2, 3, 4, 5 and 14 more"
    assert case_list(["two\nlines\x1b[31m"]) == "two lines\\x1b[31m"
    assert len(case_list(["x" * 1000])) == 60


@pytest.mark.parametrize(
    ("case", "sign"),
    [
        (Case("a", "loading", 0.0, 20.0, 10.0), 1),
        (Case("a", "unloading", 0.0, 20.0, float("nan")), -1),
        (Case("a", "", 0.0, 20.0, -10.0), -1),
        (Case("a", "", 0.0, 20.0, 10.0), 1),
        (Case("a", "", 0.0, 20.0, float("nan")), 0),
    ],
)
def test_the_sign_of_a_case_is_its_direction_or_else_its_step(case, sign):
    assert sign_of(case) == sign


def test_steps_of_binary_fractions_are_still_opposite():
    up = Case("a", "loading", 0.0, 0.1 + 0.2, 10.1)
    down = Case("a", "unloading", 0.0, 0.3, -(30.3 - 20.2))
    assert up.step_kN != -down.step_kN
    assert choose(CaseQuery((up.label,), {}), [down, up]).cases == (1, 0)


@pytest.mark.parametrize(
    ("texts", "wanted"),
    [
        (["configuration=single,speed_km_h=35"], ["single (35)20-30", "single (35)20-15", "single (35)20-10"]),
        (["speed_km_h=35,step_kN=10"], ["dual (35)20-30", "dual (35)20-10", "single (35)20-30", "single (35)20-10"]),
        (["direction=unloading,step_kN=-8"], ["dual (0)20-12", "single (0)20-12"]),
        (["configuration=dual,initial_load_kN=25,step_kN=-7"], ["dual (0)25-32", "dual (0)25-18"]),
        (["configuration=dual,direction=loading,step_kN=7"], ["dual (0)20-27"]),
        (["configuration=dual,speed_km_h=0,speed_km_h=35,step_kN=10"], ["dual (35)20-30", "dual (35)20-10"]),
        (["configuration=dual", "speed_km_h=0"], []),
    ],
)
def test_numbers_for_which_there_is_no_case_make_cases_without_records(texts, wanted):
    choice = chosen(texts)
    assert [case.label for case in choice.untested] == wanted
    assert not set(choice.untested) & set(CASES)
    for case in choice.untested:
        assert (case.direction == "loading") is (case.step_kN > 0)


def test_numbers_that_there_are_and_numbers_that_there_are_not_are_both_chosen():
    choice = chosen(["configuration=dual,speed_km_h=0,speed_km_h=35,step_kN=10"])
    assert labels(choice.cases) == ["dual (0)20-30", "dual (0)20-10"]


def test_a_step_whose_other_direction_alone_was_tested_is_predicted_beside_that():
    tested = [Case("a", "loading", 0.0, 20.0, 10.0), Case("a", "unloading", 15.0, 20.0, -10.0)]
    choice = chosen(["speed_km_h=15,step_kN=10"], tested)
    assert choice.cases == (1,)
    assert choice.untested == (Case("a", "loading", 15.0, 20.0, 10.0),)


@pytest.mark.parametrize("asked", ["step_kN=0", "initial_load_kN=-5", "direction=unloading,step_kN=-21"])
def test_steps_that_no_rig_can_make_are_none(asked):
    with pytest.raises(BadInput, match="no case matches"):
        chosen([asked])


def test_cases_without_records_lack_their_opposite_where_neither_is_asked_for_nor_has_any():
    up, down = CASES[0]._replace(speed_km_h=9.0), CASES[1]._replace(speed_km_h=9.0)
    assert without_opposite([up, down], CASES) == []
    assert without_opposite([up], CASES) == [up]
    assert without_opposite([up], [*CASES, down]) == []


def test_a_number_that_no_case_has_is_none_of_theirs():
    without = [case._replace(speed_km_h=None) for case in CASES]  # pyright: ignore[reportArgumentType]
    with pytest.raises(BadInput, match="no case matches speed_km_h=35"):
        chosen(["speed_km_h=35"], without)
