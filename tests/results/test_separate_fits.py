"""Tables of fits as they lie in a folder: names and units of columns, what is missing, what is no such table."""

import math

import pandas as pd
import pytest
from helpers.command_line import written

from bayes_tyre.errors import BadInput
from bayes_tyre.results.separate_fits import read_separate_fits

K = "k_kN_per_mm"


def fits(**columns) -> pd.DataFrame:
    numbers = {K: [1.5, None], f"{K}_se": [0.1, None], "C_kN": 1.0, "beta_mm": 0.1, "rmse_kN": 0.01, "points": 9}
    return pd.DataFrame({"record": ["1", "2"], **numbers, "status": ["ok", "no travel"], **columns})


def test_columns_have_names_units_and_standard_errors(tmp_path):
    written(fits(origin="measured"), tmp_path / "least_squares.csv")
    (table,) = read_separate_fits(tmp_path)
    assert [(column.name, column.unit, column.is_text) for column in table.columns] == [
        *(("record", "", True), ("k", "kN/mm", False), ("C", "kN", False), ("beta", "mm", False)),
        *(("rmse", "kN", False), ("points", "", False)),
    ]
    k = table.columns[1]
    assert k.values[0] == 1.5
    assert math.isnan(k.values[1])
    assert k.errors[0] == 0.1
    assert table.columns[2].errors.isna().all()
    assert (list(table.status), table.not_ok, table.origin) == (["ok", "no travel"], 1, "measured")


def test_units_within_a_name_are_taken_out_of_it(tmp_path):
    names = [f"{K}_{part}" for part in ("tests", "steps", "combined")]
    shared = pd.DataFrame({"configuration": ["a"], "speed_km_h": 0.0, **dict.fromkeys(names, 1.0), "tension": 2.0})
    written(shared.assign(status="ok"), tmp_path / "shared_stiffness.csv")
    (table,) = read_separate_fits(tmp_path)
    assert [(column.name, column.unit) for column in table.columns[1:4]] == [
        *(("speed", "km/h"), ("k tests", "kN/mm"), ("k steps", "kN/mm")),
    ]
    assert table.origin == "origin not stated"


def test_which_folders_hold_them(tmp_path):
    assert read_separate_fits(tmp_path) == []
    written(fits(), tmp_path / "least_squares.csv")
    assert len(read_separate_fits(tmp_path)) == 1
    (tmp_path / "run.json").touch()  # a posterior's folder
    assert read_separate_fits(tmp_path) == []


def test_another_table_of_the_name_is_refused(tmp_path):
    written(fits().drop(columns="beta_mm"), tmp_path / "least_squares.csv")
    with pytest.raises(BadInput, match=r"least_squares\.csv: is not what lsq .* no column beta_mm; run it again"):
        read_separate_fits(tmp_path)
