"""`calibrate`: the printed lines of appendix B1, a section that a rig file takes, and files that allow no line."""

import tomllib

import numpy as np
import pandas as pd
import pytest
from helpers.command_line import assert_refused, here, tree_of

from bayes_tyre.embedded import data_path
from bayes_tyre.rig.axle import load_rig

SAMPLE = data_path("sample/appendix_b1.lvm")
ROWS = np.arange(200) / 1000


def table(**changes: object) -> pd.DataFrame:
    volts = 3.4 + 0.001 * (np.arange(200) % 17)
    columns = {
        "X_Value": ROWS,
        "Raw Acc Voltage": volts,
        "Acc m/s^2": 10.0 * volts - 34.0,
        "Raw Load Voltage": volts - 3.4,
        "Load kN": 55.0 - 2000.0 * (volts - 3.4),
    }
    return pd.DataFrame({**columns, **changes})


@pytest.fixture(scope="module")
def of_the_sample(tmp_path_factory):
    out = tmp_path_factory.mktemp("calibration") / "lines.toml"
    return here("calibrate", SAMPLE, "--mend-signs", "--out", out), out


def test_the_lines_of_the_printed_sample_come_back_to_the_printed_digits(of_the_sample):
    done, out = of_the_sample
    assert done.exit_code == 0, done.stderr
    found = tomllib.loads(out.read_text())["calibration"]
    digits = {
        "acceleration_slope_m_per_s2_per_V": (10.0421, 5e-5),
        "acceleration_intercept_m_per_s2": (-35.0137, 5e-5),
        "displacement_slope_mm_per_V": (82.8704, 5e-5),
        "displacement_intercept_mm": (623.0990, 5e-5),
        "load_slope_kN_per_V": (-2449.02, 5e-3),
        "load_intercept_kN": (55.1127, 5e-5),
    }
    assert set(found) == set(digits)
    for key, (value, half_digit) in digits.items():
        assert found[key] == pytest.approx(value, abs=half_digit)
        assert getattr(load_rig("single").calibration, key) == value


def test_the_table_says_lines_residuals_steps_and_rows(of_the_sample):
    done, out = of_the_sample
    lines = {line.split()[0]: line for line in done.stdout.splitlines() if line.strip()}
    for part in ("10.04213 m/s^2/V", "-35.01369 m/s^2", "0.0001526", "0.001532 m/s^2", " 27 ", "Raw Acc Voltage"):
        assert part in lines["acceleration"]
    for part in ("82.87043 mm/V", "623.099 mm", "0.0001525", "0.01263 mm"):
        assert part in lines["displacement"]
    for part in ("-2449.017 kN/V", "55.11271 kN", "0.0006", "0.0001525", "0.3735 kN"):
        assert part in lines["load"]
    assert "7 minus signs restored" in done.stdout
    assert done.stdout.splitlines()[-1] == f"wrote {out}"


def test_signs_that_are_not_mended_show_in_the_residual(tmp_path):
    done = here("calibrate", SAMPLE, "--out", tmp_path / "lines.toml")
    assert done.exit_code == 0
    assert "0.011 m/s^2" in done.stdout
    (said,) = (line for line in done.stderr.splitlines() if "leaves" in line)
    assert "the line of the acceleration leaves 0.011 m/s^2, 18 steps of its converter; " in said
    assert "minus signs seem lost, with --mend-signs it leaves 2.5e-06 m/s^2" in said
    assert "restored" not in done.stdout
    slope = tomllib.loads((tmp_path / "lines.toml").read_text())["calibration"]["acceleration_slope_m_per_s2_per_V"]
    assert slope < 9


def test_what_is_written_is_a_section_that_a_rig_file_takes(of_the_sample, tmp_path):
    _, out = of_the_sample
    own = tmp_path / "own.toml"
    axle = 'name = "own"\n[axle]\naxle_load_kN = 0\neffective_mass_kg = 100\n'
    own.write_text(f"{axle}\n{out.read_text()}")
    assert load_rig(own).calibration.load_slope_kN_per_V == pytest.approx(-2449.02, abs=5e-3)


def test_a_missing_pair_is_said_and_the_others_are_fitted(tmp_path):
    table().to_csv(tmp_path / "raw.csv", index=False)
    done = here("calibrate", tmp_path / "raw.csv", "--out", tmp_path / "lines.toml")
    assert done.exit_code == 0
    (said,) = done.stderr.splitlines()
    assert "no line of the displacement: has no channel 'Raw Disp Voltage' and 'Disp mm'; " in said
    found = tomllib.loads((tmp_path / "lines.toml").read_text())["calibration"]
    assert len(found) == 4
    assert found["load_slope_kN_per_V"] == pytest.approx(-2000, rel=1e-9)
    assert found["acceleration_intercept_m_per_s2"] == pytest.approx(-34, rel=1e-9)


def test_channels_are_those_that_the_rig_names(tmp_path):
    table().rename(columns={"Load kN": "Force"}).to_csv(tmp_path / "raw.csv", index=False)
    rig = data_path("rigs/dual.toml").read_text().replace('load = "Load kN"', 'load = "Force"')
    (tmp_path / "own.toml").write_text(rig)
    done = here("calibrate", tmp_path / "raw.csv", "--rig", tmp_path / "own.toml")
    assert done.exit_code == 0
    assert "-2000 kN/V" in done.stdout
    assert "Raw Load Voltage -> Force" in done.stdout
    assert set(tree_of(tmp_path)) == {"raw.csv", "own.toml"}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"Raw Acc Voltage": 3.5}, "acceleration: all 200 readings of 'Raw Acc Voltage' lie within 0 V"),
        (
            {"Acc m/s^2": [1.0, *[np.nan] * 198, 1.0], "Raw Acc Voltage": [3.5, *[np.nan] * 199]},
            "acceleration: 1 of 1 rows",
        ),
        ({"Raw Acc Voltage": np.nan}, "acceleration: 0 of 0 rows have a reading of both"),
    ],
)
def test_still_or_empty_channels_are_said(changes, said, tmp_path):
    table(**changes).to_parquet(tmp_path / "raw.parquet")
    done = here("calibrate", tmp_path / "raw.parquet", "--mend-signs")
    assert done.exit_code == 0
    assert said in done.stderr
    assert "-2000 kN/V" in done.stdout


def test_rows_without_a_reading_are_left_out_and_counted(tmp_path):
    load = table()["Load kN"].where(np.arange(200) % 4 > 0)
    table(**{"Load kN": load}).to_parquet(tmp_path / "raw.parquet")
    done = here("calibrate", tmp_path / "raw.parquet")
    (row,) = (line for line in done.stdout.splitlines() if "load" in line)
    assert " 150 " in row
    assert "-2000 kN/V" in row


def test_a_file_without_any_line_is_refused_and_nothing_is_written(tmp_path):
    table()[["X_Value", "Load kN"]].to_csv(tmp_path / "raw.csv", index=False)
    before = tree_of(tmp_path)
    done = here("calibrate", tmp_path / "raw.csv", "--out", tmp_path / "new" / "lines.toml")
    assert_refused(done.exit_code, done.stderr, "raw.csv", "no line of the acceleration", "no other sensor has a line")
    assert tree_of(tmp_path) == before


def test_a_pair_that_does_not_belong_together_is_said(tmp_path):
    noise = np.random.default_rng(4).normal(size=200)
    table(**{"Load kN": 30 + noise}).to_csv(tmp_path / "raw.csv", index=False)
    done = here("calibrate", tmp_path / "raw.csv")
    assert done.exit_code == 0
    assert "look whether 'Load kN' belongs to 'Raw Load Voltage'" in done.stderr
    assert "line of the acceleration" not in done.stderr


def test_channels_by_number_in_a_workbook(tmp_path):
    table().to_excel(tmp_path / "raw.xlsx", index=False)
    rig = data_path("rigs/dual.toml").read_text()
    rig = rig.replace('load = "Load kN"', "load = 5").replace('load_voltage = "Raw Load Voltage"', "load_voltage = 4")
    (tmp_path / "own.toml").write_text(rig)
    done = here("calibrate", tmp_path / "raw.xlsx", "--rig", tmp_path / "own.toml")
    assert done.exit_code == 0, done.stderr
    assert "-2000 kN/V" in done.stdout
    assert "column 4 -> column 5" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([SAMPLE.parent], "is a folder; name a file in it"),
        (["none.lvm"], "no such file"),
        ([SAMPLE, "--rig", "none.toml"], "no such rig file"),
        ([SAMPLE, "--out", "lines.csv"], "is no .toml file"),
    ],
)
def test_what_is_of_no_use_is_refused(arguments, said):
    done = here("calibrate", *arguments)
    assert_refused(done.exit_code, done.stderr, said)
