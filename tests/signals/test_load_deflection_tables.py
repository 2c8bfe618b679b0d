"""Tables of slow tests: which readings are on which branch, what is refused and in what words, and averages."""

import numpy as np
import pandas as pd
import pytest
from helpers.slow_tests import Tyre, campaign, on_flat_ground, path

from bayes_tyre.errors import BadInput
from bayes_tyre.record_table import suspicious_units
from bayes_tyre.signals.load_deflection import averaged, check_load_deflection, with_deflection

CYCLE = [0.0, 5.0, 10.0, 5.0, 0.0]
#: What `suspicious_units` looks at: the name of a test, its loads, and what they are called.
COLUMNS = ("test", "load_kN", "load")


def readings(loads=CYCLE, **columns) -> pd.DataFrame:
    d = np.asarray(loads, float) / 1.5
    return pd.DataFrame({"test": "a", "load_kN": loads, "displacement_mm": d, **columns})


def on_lines(table: pd.DataFrame) -> list[str]:
    checked = check_load_deflection(table)
    assert checked["direction"].isin(["loading", "unloading"]).all()
    both = zip(checked["on_loading_line"], checked["on_unloading_line"], strict=True)
    return ["both" if up and down else "up" if up else "down" for up, down in both]


def test_the_greatest_load_ends_the_loading_and_begins_the_unloading():
    assert on_lines(readings()) == ["up", "up", "both", "down", "down"]
    assert check_load_deflection(readings())["direction"].to_list() == ["loading"] * 3 + ["unloading"] * 2
    assert on_lines(readings([0.0, 10.0, 10.0, 0.0])) == ["up", "both", "down", "down"]
    # Noise at a set load is no turn.
    assert on_lines(readings([0.0, 5.0, 4.9, 10.0, 5.0, 0.0])) == ["up", "up", "up", "both", "down", "down"]
    assert on_lines(readings([0.0, 5.0, 10.0])) == ["up"] * 3
    assert on_lines(readings([10.0, 5.0, 0.0])) == ["both", "down", "down"]


def test_directions_given_are_followed_to_the_letter():
    factors = ["loading"] * 3 + ["unloading"] * 2
    assert on_lines(readings(direction=factors)) == ["up", "up", "up", "down", "down"]
    twice = [0.0, 9.9, 10.0, 0.0]
    assert on_lines(readings(twice, direction=["loading"] * 2 + ["unloading"] * 2)) == ["up", "up", "down", "down"]
    assert on_lines(readings([10.0, 5.0], direction=["unloading"] * 2)) == ["down", "down"]


def test_a_curve_of_several_cycles_is_cut_into_tests_of_one():
    table = pd.concat([readings([*CYCLE, *CYCLE[1:]], note="x"), readings(note="y").assign(test="b")])
    checked = check_load_deflection(table)
    assert checked.groupby("test", sort=False).size().to_dict() == {"a, cycle 1": 5, "a, cycle 2": 5, "b": 5}
    assert list(checked["load_kN"]) == [*CYCLE, *CYCLE, *CYCLE]
    cycle = ["loading"] * 3 + ["unloading"] * 2
    assert list(checked["direction"]) == [*cycle, "unloading", *cycle[1:], *cycle]
    # The reading between the cycles was reached by unloading, and is on both lines of the second.
    assert checked["on_loading_line"].to_list()[5]
    assert [checked["on_unloading_line"].to_list()[row] for row in (0, 5)] == [False, True]
    assert list(checked.index) == list(range(15))


def test_what_belongs_to_no_closed_cycle_is_left_out_and_said():
    with pytest.warns(UserWarning, match=r"slow\.csv: test 'a': cut into closed cycles \(2\); 4 of its 13 readings"):
        checked = check_load_deflection(readings([10.0, 5.0, *CYCLE, *CYCLE[1:], 5.0, 8.0]), "slow.csv")
    assert list(checked["load_kN"]) == [*CYCLE, *CYCLE]
    with pytest.warns(UserWarning, match=r"\(1\); 1 of its 6 readings"):
        checked = check_load_deflection(readings([*CYCLE, 10.0]))
    assert checked["test"].unique().tolist() == ["a, cycle 1"]


def test_a_small_cycle_among_large_ones_may_run_back_by_the_noise_of_these():
    table = readings([0.0, 5.0, 15.0, 13.0, 15.0, 0.0, 30.0, 100.0, 50.0, 0.0])
    assert check_load_deflection(table)["test"].nunique() == 2


def with_cell(column: str, cell: str | float, row: int = 2) -> pd.DataFrame:
    factors = {"configuration": "single", "speed_km_h": 0.0, "repeat": 1, "origin": "simulated"}
    table = readings(**factors, direction=["loading"] * 3 + ["unloading"] * 2).astype({column: object})
    table.loc[row - 1, column] = cell
    return table


FAULTS = {
    "no load": (readings().drop(columns="load_kN"), ["missing column load_kN", "test, load_kN, displacement_mm"]),
    "no rows": (readings().iloc[:0], ["no rows below the header"]),
    "text in a number": (with_cell("load_kN", "5 kN"), ["row 2 (line 3), test 'a', column load_kN", "'5 kN'"]),
    "empty number": (with_cell("displacement_mm", ""), ["row 2", "column displacement_mm", "is empty"]),
    "infinite": (with_cell("displacement_mm", np.inf), ["row 2", "column displacement_mm", "not a finite number"]),
    "half a repeat": (with_cell("repeat", 1.5), ["row 2", "column repeat", "not a whole number"]),
    "no name": (with_cell("test", " "), ["row 2", "column test is empty"]),
    "unknown direction": (with_cell("direction", "up"), ["row 2", "column direction", "'up'", "loading, unloading"]),
    "unknown origin": (with_cell("origin", "dreamt"), ["row 2", "column origin", "'dreamt'", "measured"]),
    "two speeds": (with_cell("speed_km_h", 15.0), ["test 'a', column speed_km_h", "contradicts itself (0.0 and 15.0)"]),
    "loading again": (with_cell("direction", "loading", 5), ["row 5", "loading after unloading", "name of its own"]),
    "no closed cycle": (
        readings([0.0, 10.0, 5.0, 20.0, 15.0, 40.0]),
        ["row 3", "falls while loading (to 5 kN)", "name of its own"],
    ),
    "from the top": (readings([10.0, 0.0, 10.0]), ["row 3", "rises while unloading (to 10 kN)"]),
    "a fault behind cycles": (
        pd.concat([readings([*CYCLE, *CYCLE[1:]]), readings([9.0, 0.0, 9.0]).assign(test="b")]),
        ["row 12 (line 13), test 'b'", "rises while unloading"],
    ),
    "a name that a cycle gets": (
        pd.concat([readings([*CYCLE, *CYCLE[1:]]), readings().assign(test="a, cycle 2")]),
        ["'a, cycle 1'", "rename one"],
    ),
    "sorted by load": (
        readings(sorted(CYCLE), direction=["loading", "unloading", "loading", "unloading", "loading"]),
        ["row 3", "loading after unloading"],
    ),
    "a branch the wrong way": (
        readings(CYCLE[::-1], direction=["loading"] * 3 + ["unloading"] * 2).assign(load_kN=[9.0, 5.0, 0.0, 5.0, 9.0]),
        ["row 2", "falls while loading (to 5 kN)"],
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_what_cannot_be_right_is_refused_in_one_line_with_row_and_column(name):
    table, said = FAULTS[name]
    with pytest.raises(BadInput) as refused:
        check_load_deflection(table, "slow.csv")
    message = str(refused.value)
    assert message.startswith("slow.csv: ")
    assert message.isprintable()
    assert ";" in message
    for part in said:
        assert part in message


def test_a_column_that_stands_twice_is_refused():
    table = pd.concat([readings(), readings()[["load_kN"]]], axis=1)
    with pytest.raises(BadInput, match="column load_kN stands twice; keep one"):
        check_load_deflection(table)


def test_newtons_and_metres_are_suspected():
    assert suspicious_units(check_load_deflection(readings()), *COLUMNS) == []
    newtons = check_load_deflection(readings().assign(load_kN=lambda t: 1000 * t["load_kN"]))
    assert [said.split(":")[0] for said in suspicious_units(newtons, *COLUMNS)] == ["column load_kN"]
    metres = check_load_deflection(readings().assign(displacement_mm=lambda t: t["displacement_mm"] / 1000))
    assert "multiply by 1000" in suspicious_units(metres, *COLUMNS)[0]


def test_repeats_are_averaged_reading_by_reading_and_those_read_elsewhere_are_not():
    table = check_load_deflection(campaign(noise_kN=0.2))
    placed = with_deflection(table, dict.fromkeys(("single", "dual")))
    means, warnings = averaged(placed)
    assert warnings == []
    assert means["test"].unique().tolist() == [
        f"{name}, {speed} km/h, mean of 3" for name in ("single", "dual") for speed in (0, 25)
    ]
    mine = means[means["test"] == "dual, 25 km/h, mean of 3"]
    each = placed[(placed["configuration"] == "dual") & (placed["speed_km_h"] == 25)]
    expected = each["flat_ground_kN"].to_numpy().reshape(3, -1).mean(axis=0)
    np.testing.assert_allclose(mine["flat_ground_kN"], expected)
    assert set(means["repeats"]) == {3}
    assert set(means["origin"]) == {"simulated"}
    shifted = placed.copy()
    shifted.loc[shifted["test"] == "dual (25) slow 2", "load_kN"] += 12.0
    means, warnings = averaged(shifted)
    assert means["test"].nunique() == 3
    assert warnings == ["dual, 25 km/h: its 3 tests were not read at the same loads, so no average of them"]


def test_tests_without_words_are_no_repeats_of_each_other():
    table = check_load_deflection(on_flat_ground(Tyre(), d=path()))
    means, warnings = averaged(with_deflection(table, {"": None}))
    assert means.empty
    assert warnings == []
