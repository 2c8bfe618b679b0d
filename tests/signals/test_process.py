"""The two methods on recordings of known truth."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers.steps_made import RIGS, simulated

from bayes_tyre.errors import BadInput
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.record import RawSignals
from bayes_tyre.rig.axle import Accuracy
from bayes_tyre.signals.process import METHODS, process
from bayes_tyre.signals.processed import Processed

FILES = ("DynamicS(0)30-20(1).lvm", "DynamicS(0)20-30(2).lvm", "DynamicD(0)20-10(1).lvm", "DynamicD(0)30-40(3).lvm")


def processed(file: str, method: str = "inertia", **options: Any) -> tuple[Processed, Any]:
    """Return a processed record, and what it was simulated from."""
    record, factors = simulated(file, **options)
    return process(record.raw, RIGS[factors.case.configuration], factors, method), record


def line_past(d, force, share=0.1):
    """Return the slope of force over displacement past so much of the travel, kN/mm."""
    late = np.abs(d - d[0]) > share * np.abs(d - d[0]).max()
    return np.polyfit(d[late], force[late], 1)[0]


@pytest.mark.parametrize("file", FILES)
def test_inertia_gives_the_tyres_own_path(file):
    found, record = processed(file)
    row = record.row
    d, force = found.displacement_mm, found.force_kN
    law = Fancher(*(row[name] for name in ("k_kN_per_mm", "C_kN", "x_kN", "beta_mm")))
    shift = row["d_i_mm"] - d[0]
    true = np.asarray(law.force(d + shift, row["F_i_kN"]))
    residual = force - true
    # Load noise of 0.45 kN a sample is 0.28 kN here: 0.02 in the mean of 300 samples; mass and damping add some 1 %.
    assert abs(residual.mean()) < 0.12
    assert residual[1:].std() == pytest.approx(np.median(found.force_sd_kN), rel=0.15)
    # The line's own standard error is some 1 % at 5 kHz.
    assert line_past(d, force) == pytest.approx(line_past(d, true), rel=0.05)
    assert abs(shift) < 1.5
    assert force[0] == pytest.approx(row["F_i_kN"], abs=0.1)
    assert found.force_sd_kN[0] < 0.1 * found.force_sd_kN[1]
    assert found.extras["mass_kg"] == pytest.approx(row["m_kg"], rel=0.08)


@pytest.mark.parametrize("file", FILES)
def test_inertia_goes_one_way_to_the_first_reversal(file):
    found, record = processed(file)
    sign = np.sign(found.factors.case.step_kN)
    moved = sign * np.diff(found.displacement_mm)
    assert moved.min() > -1e-3
    lever = record.motion.displacement_mm
    travel = np.abs(lever - lever[0]).max()
    assert abs(np.ptp(found.displacement_mm) / travel - 0.92) < 0.04  # Eq. 7
    assert np.all(np.diff(found.time_s) > 0)


def test_the_record_says_more_of_the_mass_than_the_rig_file():
    found, record = processed("DynamicS(0)30-20(1).lvm", rate_Hz=10_000.0)
    assert abs(record.row["m_kg"] - 285.0) > 40  # drawn two standard deviations off
    assert found.extras["mass_kg"] == pytest.approx(record.row["m_kg"], rel=0.04)
    assert float(found.extras["mass_sd_kg"]) < 10


def test_thesis_smooths_and_ends_at_the_overshoot():
    """A first maximum that overshoots by half makes loading look soft; a cut that is low makes unloading look stiff."""
    loading, record = processed("DynamicS(0)20-30(2).lvm", "thesis", rate_Hz=10_000.0)
    assert line_past(loading.displacement_mm, loading.force_kN, 0.2) < 0.9 * record.row["k_kN_per_mm"]
    unloading, record = processed("DynamicS(0)30-20(1).lvm", "thesis", rate_Hz=10_000.0)
    assert line_past(unloading.displacement_mm, unloading.force_kN, 0.2) > 1.1 * record.row["k_kN_per_mm"]
    # 40 ms before and after the response.
    assert len(unloading.time_s) == pytest.approx(10_000 * (0.08 + float(unloading.extras["response_s"])), abs=100)
    assert unloading.displacement_mm[0] == pytest.approx(661.5, abs=0.5)


@pytest.mark.parametrize("method", METHODS)
def test_columns_are_a_record_table_with_extras(method):
    columns = processed("DynamicS(0)30-20(1).lvm", method)[0].columns()
    assert {"record", "repeat", "time_s", "displacement_sd_mm", "force_sd_kN", "load_clarity", "method"} <= set(columns)
    arrays = [value for value in columns.values() if isinstance(value, np.ndarray)]
    assert len({len(values) for values in arrays}) == 1
    assert all(np.isfinite(values).all() for values in arrays)


@pytest.mark.parametrize("method", METHODS)
def test_records_say_how_accurate_the_rig_is_where_its_file_does(method):
    record, factors = simulated("DynamicS(0)30-20(1).lvm")
    rig = RIGS["single"].model_copy(update={"accuracy": Accuracy(load_relative_sd=0.01)})
    assert process(record.raw, rig, factors, method).columns()["force_scale_sd"] == 0.01
    rig = rig.model_copy(update={"accuracy": Accuracy(displacement_relative_sd=0.02)})
    columns = process(record.raw, rig, factors, method).columns()
    assert (columns["displacement_scale_sd"], "force_scale_sd" in columns) == (0.02, False)


def test_a_rolling_record_gives_k():
    found, record = processed("DynamicS(15)30-20(1).lvm", rate_Hz=5000.0, duration_s=6.0, start_s=4.0)
    assert line_past(found.displacement_mm, found.force_kN) == pytest.approx(record.row["k_kN_per_mm"], rel=0.12)


def test_a_record_that_asks_for_another_mass_is_rejected_with_both_masses():
    """Friction that the runout swings before the step makes the motion follow the load as a lighter axle would."""
    with pytest.raises(
        BadInput, match=r"as a mass of [\d.]+ kg would, [\d.]+ standard deviations .* 285 kg: the runout of"
    ):
        processed("DynamicS(35)20-15(1).lvm", rate_Hz=5000.0, duration_s=6.0, start_s=4.0)


def spoilt(name: str, factor: float) -> tuple[RawSignals, Any]:
    """Return a recording with one channel multiplied, and its words."""
    record, factors = simulated("DynamicD(0)20-10(1).lvm")
    channels = [
        replace(channel, values=channel.values * factor) if channel.name == name else channel
        for channel in record.raw.segments[0]
    ]
    return RawSignals((tuple(channels),)), factors


@pytest.mark.parametrize(("name", "factor"), [("Acc m/s^2", 1 / 9.81), ("Disp mm", -1.0), ("Disp mm", 1e-3)])
def test_a_sensor_in_another_unit_or_with_another_sign_parts_from_the_other(name, factor):
    raw, factors = spoilt(name, factor)
    with pytest.raises(BadInput, match=r"laser says .* mm of travel, accelerometer .* check units, signs"):
        process(raw, RIGS["dual"], factors, "inertia")


def test_a_load_of_another_gain_is_told_by_the_mass():
    """Standing, the mass comes from the record to some per cent: what is left is the calibration, or the rig file."""
    raw, factors = spoilt("Load kN", 0.62)
    with pytest.raises(BadInput, match="mend the calibration of accelerometer or load, or mend effective_mass_kg"):
        process(raw, RIGS["dual"], factors, "inertia")
