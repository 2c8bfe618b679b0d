"""The axis of cases: its name states what its labels hold, and no more."""

import pandas as pd
import pytest

from bayes_tyre.report.figures.page.case_axis import case_axis_name


@pytest.mark.parametrize(
    ("factors", "name"),
    [
        ({"speed_km_h": [0.0], "initial_load_kN": [20.0], "step_kN": [5.0]}, "(speed, km/h)\nfirst load-last load, kN"),
        ({"initial_load_kN": [20.0], "step_kN": [5.0]}, "first load-last load, kN"),
        ({"initial_load_kN": [20.0]}, "initial load, kN"),
        ({"step_kN": [5.0], "speed_km_h": [float("nan")]}, "step, kN"),
        ({"speed_km_h": [30.0]}, "(speed, km/h)"),
    ],
)
def test_the_axis_names_the_factors_that_cases_have(factors, name):
    assert case_axis_name(pd.DataFrame(factors)) == f"case: {name}"


def test_cases_without_factors_are_named_as_cases_alone():
    assert case_axis_name(pd.DataFrame({"configuration": ["A"]})) == "case"
