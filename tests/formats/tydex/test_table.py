"""A vertical test in a TYDEX file as a table for `lsq`, `fit` and `load-deflection`."""

from pathlib import Path

import numpy as np
import pytest
from helpers.slow_tests import Tyre, on_flat_ground

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.tables.table_files import read_table
from bayes_tyre.formats.tydex.write import Constant, MeasuredChannel, Tydex, tydex_text
from bayes_tyre.inference.load_deflection.table import fit_tests
from bayes_tyre.record_table import check_record_table
from bayes_tyre.signals.load_deflection import check_load_deflection, with_deflection

TIME = MeasuredChannel("RUNTIME", "Running time", "s", np.array([0.0, 0.5, 1.0]))
FORCE = MeasuredChannel("FZW", "Vertical force", "N", np.array([20_000.0, 23_000.0, 26_000.0]))
DEFLECTION = MeasuredChannel("TYREDEFW", "Tyre deflection", "m", np.array([0.010, 0.0115, 0.013]))
HEIGHT = MeasuredChannel("DSTGRWHC", "Ground to wheel centre", "m", np.array([0.4900, 0.4885, 0.4870]))
CONSTANTS = [
    Constant("INFLPRES", "", "bar", "7.25"),
    Constant("INCLANGL", "", "deg", "0"),
    Constant("RIM", "", "-", "no"),
    Constant("TYRESIZE", "Size", "-", "315/80 R 22.5"),
]


def table_of(folder: Path, *channels: MeasuredChannel, header: str = "T 1"):
    path = folder / "Test12.TDX"
    path.write_text(tydex_text(Tydex({"MEASID": header}, channels, CONSTANTS)))
    return read_table(path)


def test_units_are_those_of_records_and_constants_are_columns(tmp_path):
    table = table_of(tmp_path, TIME, DEFLECTION, FORCE, HEIGHT)
    assert set(table["record"]) == set(table["test"]) == {"T 1"}
    np.testing.assert_allclose(table["displacement_mm"], [10.0, 11.5, 13.0])
    np.testing.assert_allclose(table["force_kN"], [20.0, 23.0, 26.0])
    assert table["load_kN"].equals(table["force_kN"].rename("load_kN"))
    assert table["time_s"].tolist() == [0.0, 0.5, 1.0]
    assert set(table["INFLPRES_bar"]) == {7.25}
    assert set(table["INCLANGL_deg"]) == {0.0}
    assert not [column for column in table if str(column).startswith("RIM")]
    assert len(check_record_table(table)) == len(check_load_deflection(table)) == 3


def test_without_deflection_it_is_how_far_the_wheel_centre_falls(tmp_path):
    table = table_of(tmp_path, HEIGHT._replace(unit="mm", values=1e3 * HEIGHT.values), FORCE, header="")
    np.testing.assert_allclose(table["displacement_mm"], [0.0, 1.5, 3.0])
    assert set(table["record"]) == {"Test12"}
    assert "time_s" not in table


def test_a_force_that_is_negative_has_its_sign_turned_and_one_about_zero_has_not(tmp_path):
    about_zero = FORCE._replace(values=np.array([-3.0, -1.0, 2.0]))
    assert table_of(tmp_path, DEFLECTION, about_zero)["force_kN"].tolist() == [-0.003, -0.001, 0.002]
    table = table_of(tmp_path, DEFLECTION, FORCE._replace(values=-FORCE.values))
    np.testing.assert_allclose(table["force_kN"], [20.0, 23.0, 26.0])


@pytest.mark.parametrize(
    ("channels", "said"),
    [
        ((DEFLECTION,), "has no channel FZW, but TYREDEFW"),
        ((FORCE, TIME), "has no channel TYREDEFW or DSTGRWHC, but FZW, RUNTIME"),
        ((FORCE._replace(unit="lbf"), DEFLECTION), "channel FZW is in 'lbf'; give it in one of n, kn"),
    ],
)
def test_a_test_of_another_kind_is_refused(channels, said, tmp_path):
    with pytest.raises(BadInput) as refused:
        table_of(tmp_path, *channels)
    assert said in str(refused.value)


def test_a_slow_test_through_the_format_gives_the_same_stiffness(tmp_path):
    test = on_flat_ground(Tyre(), noise_kN=0.01)
    mm, kN = (test[column].to_numpy(float) for column in ("displacement_mm", "load_kN"))
    table = table_of(tmp_path, DEFLECTION._replace(values=mm / 1e3), FORCE._replace(values=kN * 1e3))
    fits = [fit_tests(with_deflection(check_load_deflection(each), {"": None})) for each in (test, table)]
    for column in ("k_kN_per_mm", "C_kN", "x_less_k_beta_kN", "energy_per_cycle_J"):
        assert fits[0][column].item() == pytest.approx(fits[1][column].item(), rel=1e-5)
