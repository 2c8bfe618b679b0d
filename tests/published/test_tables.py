"""The published tables: complete, typed, with their digits, and adding up to their own averages."""

import numpy as np
import pandas as pd
import pytest

from bayes_tyre.embedded import data_path
from bayes_tyre.published import tables
from bayes_tyre.record import CASE_FACTORS

NAMES = sorted(path.stem for path in data_path("published").glob("*.csv"))


@pytest.mark.parametrize(
    ("text", "half"), [("1.440", 0.0005), ("0.02403", 5e-6), ("-9.052", 0.0005), ("2191", 0.5), ("+3.0", 0.05)]
)
def test_half_a_unit_of_the_last_digit(text, half):
    assert tables.printed_digits(text) == half


@pytest.mark.parametrize("text", ["1.3e-5", "", "abc", "nan", "inf"])
def test_what_is_no_printed_number(text):
    with pytest.raises(ValueError, match=r"."):
        tables.printed_digits(text)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "errata"])
def test_every_row_says_where_it_comes_from(name):
    table = tables.as_printed(name)
    assert len(table) > 0
    assert (table["source"].str.len() > 0).all()
    if name.startswith("table_"):
        assert (table["source"] == f"Table {int(name[6:8])}").all()


def test_eleven_tables():
    assert {name[6:8] for name in NAMES if name.startswith("table_")} == {f"{i:02d}" for i in range(1, 12)}


@pytest.mark.parametrize(
    ("table", "value"), [(tables.stiffness(), "k_kN_per_mm"), (tables.characteristic_deflection(), "beta_mm")]
)
def test_48_cases_that_average_to_the_printed_means(table, value):
    assert len(table) == 48
    assert not table.duplicated(list(CASE_FACTORS)).any()
    assert ((table["direction"] == "loading") == (table["step_kN"] > 0)).all()
    means = table.groupby(["configuration", "direction"])[value].mean()
    printed = tables.means(value).set_index(["configuration", "direction"])
    assert len(printed) == 4
    assert ((means - printed[value]).abs() - printed["half_digit"] <= 0).all()
    counts = table.groupby(["configuration", "direction"]).size()
    assert counts.to_dict() == {
        ("dual", "loading"): 6,
        ("dual", "unloading"): 18,
        ("single", "loading"): 6,
        ("single", "unloading"): 18,
    }


def test_digits_are_kept():
    assert "1.440" in set(tables.as_printed("table_09_stiffness")["k_kN_per_mm"])
    assert (tables.stiffness()["half_digit"] == 0.0005).all()
    assert (tables.characteristic_deflection()["half_digit"] == 5e-6).all()


def test_single_cells_stand_where_they_are_printed():
    cells = {tuple(row[:5]): tuple(row[5:]) for row in tables.case_means().itertuples(index=False)}
    assert len(cells) == 48
    assert cells["single", "unloading", 0.0, 10.0, -7.0] == (1.710, 0.07202)
    assert cells["dual", "unloading", 35.0, 20.0, -10.0] == (1.497, 0.11015)
    assert cells["dual", "loading", 0.0, 30.0, 10.0] == (2.815, 0.04552)


def test_table_10_averages_table_9_by_speed():
    keys = ["configuration", "direction", "speed_km_h"]
    means = tables.stiffness().groupby(keys)["k_kN_per_mm"].mean()
    model = tables.model_and_tests().query("kind == 'model'").set_index(keys)
    assert len(model) == 10
    assert ((means - model["k_kN_per_mm"]).abs() - model["half_digit"] <= 1e-6).all()
    assert tables.tests_stiffness("dual", "unloading", 25.0) == 1.789
    with pytest.raises(KeyError):
        tables.tests_stiffness("dual", "loading", 25.0)


def test_table_8_has_three_repeats_of_four_cases():
    table = tables.repeat_displacement()
    assert table.groupby(list(CASE_FACTORS))["repeat"].agg(sorted).to_list() == [[1, 2, 3]] * 4
    assert table["displacement_mm"].sum() == pytest.approx(28.541)


def test_tables_come_afresh():
    table = tables.stiffness()
    table.loc[0, "k_kN_per_mm"] = 0.0
    assert tables.stiffness().loc[0, "k_kN_per_mm"] == 1.703


def test_seven_signs_of_the_sample_are_mended():
    printed, mended = tables.raw_sample(mended=False), tables.raw_sample()
    assert len(printed) == 27
    changed = printed["Acc m/s^2"] != mended["Acc m/s^2"]
    volts = printed.loc[changed, "Raw Acc Voltage"]
    assert sorted(volts) == [3.483779, 3.483932, 3.484542, 3.485305, 3.485915, 3.486068, 3.486068]
    np.testing.assert_array_equal(mended["Acc m/s^2"].abs(), printed["Acc m/s^2"])
    pd.testing.assert_frame_equal(printed.drop(columns="Acc m/s^2"), mended.drop(columns="Acc m/s^2"))
