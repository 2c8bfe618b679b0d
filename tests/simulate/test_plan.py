"""The plans: the source's test table, its way of naming files, and the stiffness each case is given."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.record import Case
from bayes_tyre.simulate.plan import quick_plan, thesis_plan
from bayes_tyre.simulate.stiffness import case_stiffness


def test_the_thesis_plan_is_table_7_on_both_axles_three_times():
    plan = thesis_plan()
    table = pd.read_csv(data_path("published/table_07_step_load_tests.csv"))
    wanted = {
        (configuration, row.direction, row.speed_km_h, row.initial_load_kN, row.step_kN, repeat)
        for configuration in ("single", "dual")
        for row in table.itertuples()
        for repeat in (1, 2, 3)
    }
    assert {(*record.case, record.repeat) for record in plan} == wanted
    assert len(plan) == len({record.file for record in plan}) == 288
    assert {(record.duration_s, record.rate_Hz) for record in plan} == {(15.0, 10_000.0)}


def test_files_are_named_as_the_source_names_them():
    names = {record.file for record in thesis_plan()}
    assert {"DynamicS(0)30-20(1).lvm", "DynamicD(35)10-3(2).lvm", "DynamicD(15)20-25(3).lvm"} <= names


def test_the_quick_plan_is_24_stationary_records_with_2_s_around_the_step():
    plan = quick_plan(2000.0)
    assert len({record.file for record in plan}) == 24
    assert {record.case.speed_km_h for record in plan} == {0.0}
    assert {record.case.direction for record in plan} == {"loading", "unloading"}
    assert {record.case.configuration for record in plan} == {"single", "dual"}
    assert {record.rate_Hz for record in plan} == {2000.0}
    for record in plan:
        assert record.step_between_s[0] >= 2.0
        assert record.duration_s - record.step_between_s[1] >= 2.0


def test_stiffness_is_printed_or_follows_from_what_is():
    assert case_stiffness(Case("single", "unloading", 0.0, 30.0, -10.0)) == 1.725
    assert case_stiffness(Case("dual", "unloading", 35.0, 30.0, -5.0)) == 2.531
    ratio = np.mean([1.494 / 1.698, 1.479 / 1.647, 1.481 / 1.725, 1.527 / 1.746])
    assert case_stiffness(Case("single", "loading", 15.0, 20.0, 10.0)) == pytest.approx(1.938 * ratio)
    assert case_stiffness(Case("single", "unloading", 15.0, 10.0, -7.0)) == pytest.approx(1.710 * ratio)


@pytest.mark.parametrize("change", [{"speed_km_h": 50.0}, {"initial_load_kN": 25.0}, {"configuration": "triple"}])
def test_a_case_that_table_9_says_nothing_of_is_refused(change):
    with pytest.raises(BadInput, match="Table 9 says nothing"):
        case_stiffness(Case("single", "unloading", 15.0, 30.0, -10.0)._replace(**change))


def test_every_case_of_the_plan_has_a_stiffness():
    stiffness = np.array([case_stiffness(record.case) for record in thesis_plan()])
    assert stiffness.min() > 1.2
    assert stiffness.max() < 2.9
