"""What records share across cases, from the columns that say it."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.record_levels import NO_LEVELS, find_levels

#: Of each record: configuration, tyre, day and pressure; two rows each.
RECORDS = [
    ("r1", "single", "1", 3.0, 7.0),
    ("r2", "single", "2", 4.0, 8.0),
    ("r3", "dual", "1", 3.0, 9.0),
    ("r4", "dual", "1", 4.0, 8.0),
]
TABLE = pd.DataFrame(
    [row for row in RECORDS for _ in range(2)], columns=["record", "configuration", "tyre", "day", "pressure_bar"]
)
CONFIGURATIONS = [row[1] for row in RECORDS]
GROUPINGS = {"specimen": "tyre", "day": "day"}


def test_a_tyre_of_one_number_in_two_configurations_is_two_tyres():
    levels = find_levels(TABLE, CONFIGURATIONS, GROUPINGS, ["pressure_bar"])
    assert levels.labels == {
        "specimen": ("dual 1", "single 1", "single 2"),
        "day": ("3", "4"),
        "covariate": ("pressure_bar",),
    }
    assert levels.groupings["specimen"].of_record.tolist() == [1, 2, 0, 0]
    assert levels.groupings["day"].of_record.tolist() == [0, 1, 0, 1]


def test_the_offset_is_the_sum_of_what_each_adds():
    levels = find_levels(TABLE, CONFIGURATIONS, GROUPINGS, ["pressure_bar"])
    effects = {"specimen": np.array([0.1, 0.2, 0.3]), "day": np.array([0.01, 0.02]), "covariate": np.array([0.5])}
    # Pressures are 1, 0, 1 and 0 from their mean of 8 bar, with a standard deviation of root 1/2.
    slope = 0.5 * np.sqrt(2.0)
    expected = [0.2 + 0.01 - slope, 0.3 + 0.02, 0.1 + 0.01 + slope, 0.1 + 0.02]
    np.testing.assert_allclose(levels.offset(effects.__getitem__), expected, atol=1e-12)
    many = {name: np.stack([values, -values]) for name, values in effects.items()}
    np.testing.assert_allclose(levels.offset(many.__getitem__), [expected, -np.array(expected)], atol=1e-12)


def test_levels_of_some_records_keep_their_labels_and_their_unit():
    levels = find_levels(TABLE, CONFIGURATIONS, GROUPINGS, ["pressure_bar"])
    some = levels.only(np.array([False, True, True, False]))
    assert some.labels == levels.labels
    assert some.groupings["specimen"].of_record.tolist() == [2, 0]
    assert some.covariates is not None
    np.testing.assert_allclose(some.covariates.values[:, 0], [0.0, np.sqrt(2.0)], atol=1e-12)


def test_without_columns_there_are_none():
    assert find_levels(TABLE, CONFIGURATIONS, dict.fromkeys(GROUPINGS), []) == NO_LEVELS
    assert NO_LEVELS.names == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"specimen": "tire"}, "column tire: not in the record table; --specimen names one of its columns"),
        ({"specimen": "varying"}, "record 'r1', column varying: varies within the record"),
        ({"day": "holes"}, "record 'r2', column holes: is empty"),
        ({"day": "same"}, "column same: all records have 'x'; leave --day same out"),
        ({"covariates": ["tyre_name"]}, "column tyre_name: not a number in every record"),
        ({"covariates": ["level"]}, "column level: all records have 3; leave --covariate level out"),
    ],
)
def test_a_column_that_cannot_serve_is_named(change, said):
    table = TABLE.assign(
        varying=["a", "b"] * 4,
        holes=pd.Series(["a", "a", None, None, "a", "a", "b", "b"]),
        same="x",
        tyre_name=[f"tyre {name}" for name in TABLE["tyre"]],
        level=3.0,
    )
    covariates = change.pop("covariates", [])
    with pytest.raises(BadInput, match=f"^{said}".replace("(", r"\(")):
        find_levels(table, CONFIGURATIONS, {"specimen": None, "day": None} | change, covariates)


def test_long_numbers_are_labels_of_their_own():
    table = TABLE.assign(day=TABLE["day"].astype(float) + 20240100.0)
    levels = find_levels(table, CONFIGURATIONS, GROUPINGS, [])
    assert levels.labels["day"] == ("20240103", "20240104")
