"""RecordFactors from names and tables of cases, and what is refused."""

import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.record import Case
from bayes_tyre.signals.factors import RecordFactors, factors_from_name, factors_from_row

ROW = {"configuration": "wide", "speed_km_h": 12.5, "initial_load_kN": "8", "step_kN": -2.5, "repeat": 4.0}


@pytest.mark.parametrize(
    ("name", "record", "case", "repeat"),
    [
        ("DynamicS(0)30-20(1).lvm", "S(0)30-20(1)", Case("single", "unloading", 0, 30, -10), 1),
        ("DynamicD(35)10-3(3).tdms", "D(35)10-3(3)", Case("dual", "unloading", 35, 10, -7), 3),
        ("DynamicD(35)10-3(3).mf4", "D(35)10-3(3)", Case("dual", "unloading", 35, 10, -7), 3),
        ("dynamicd(2.5)10-15.5(12).LVM", "d(2.5)10-15.5(12)", Case("dual", "loading", 2.5, 10, 5.5), 12),
        ("S(15)20-30(2).csv", "S(15)20-30(2)", Case("single", "loading", 15, 20, 10), 2),
    ],
)
def test_a_name_says_what_was_tested(name, record, case, repeat):
    assert factors_from_name(name) == RecordFactors(record, case, repeat)


@pytest.mark.parametrize(
    "name", ["run 7.lvm", "DynamicX(0)30-20(1).lvm", "DynamicS(0)30-20.lvm", "DynamicS(0)30-20(1)b.lvm", "S().lvm"]
)
def test_another_name_is_refused_with_the_remedy(name):
    with pytest.raises(BadInput, match="--cases"):
        factors_from_name(name)


def test_a_step_of_nothing_is_refused():
    with pytest.raises(BadInput, match="30 to 30 kN"):
        factors_from_name("DynamicS(0)30-30(1).lvm")


def test_a_row_says_what_was_tested():
    assert factors_from_row(ROW, "run 7.lvm") == RecordFactors("run 7", Case("wide", "unloading", 12.5, 8.0, -2.5), 4)
    assert factors_from_row({**ROW, "record": "first"}, "run 7.lvm").record == "first"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"direction": "loading"}, "direction"),
        ({"configuration": float("nan")}, "configuration"),
        ({"step_kN": "ten"}, "'ten' is no number"),
        ({"repeat": 1.5}, "whole number"),
        ({"speed_km_h": None}, "speed_km_h"),
        ({"speed_km_h": -25}, "speed of -25 km/h; give 0 or more"),
        ({"speed_km_h": "1_5"}, "'1_5' is no number"),
    ],
)
def test_a_wrong_row_is_refused_by_its_column(change, said):
    with pytest.raises(BadInput, match=said):
        factors_from_row({**ROW, **change}, "run 7.lvm")
