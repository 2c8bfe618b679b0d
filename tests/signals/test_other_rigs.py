"""Machines without rollers or lever: a record simulated on each, processed with the same rig file."""

from typing import Any

import numpy as np
import pytest
from helpers.readme_rigs import readme_rig
from helpers.steps_made import planned

from bayes_tyre.errors import BadInput
from bayes_tyre.record import RawSignals
from bayes_tyre.rig.axle import Rig
from bayes_tyre.signals.factors import RecordFactors, record_name
from bayes_tyre.signals.process import process
from bayes_tyre.signals.runout import nominal_bodies
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.simulator import Simulated, simulate_record

STANDING, ROLLING = "DynamicS(0)30-20(1).lvm", "DynamicS(15)30-20(1).lvm"


def simulated(rig: Rig, file: str = STANDING, **options: Any) -> tuple[Any, RecordFactors]:
    plan = planned(file, **options)
    return simulate_record(draw_truth(plan, rig, 0), rig), RecordFactors(record_name(file), plan.case, plan.repeat)


def slope(d: np.ndarray, force: np.ndarray) -> float:
    late = np.abs(d - d[0]) > 0.1 * np.abs(d - d[0]).max()
    return float(np.polyfit(d[late], force[late], 1)[0])


@pytest.fixture(scope="module", params=["flat_ground", "direct_acting"])
def standing(request) -> tuple[Rig, Simulated, RecordFactors]:
    rig = readme_rig(request.param)
    return rig, *simulated(rig)


def test_inertia_brings_k_back(standing):
    """The line past the friction's bend, within 5 %: its standard error from noise is some 1 %, from the mass 1 %."""
    rig, record, factors = standing
    found = process(record.raw, rig, factors, "inertia")
    assert slope(found.displacement_mm, found.force_kN) == pytest.approx(record.row["k_kN_per_mm"], rel=0.05)
    assert found.force_kN[0] == pytest.approx(record.row["F_i_kN"], abs=0.1)
    assert abs(found.displacement_mm[0] - record.row["d_i_mm"]) < 1.0  # C and friction, over k
    assert found.extras["mass_kg"] == pytest.approx(record.row["m_kg"], rel=0.1)


def test_the_sources_method_works_on_them_too(standing):
    """Its loads at rest before and after are those of the tyre; its k it does not get right on any rig."""
    rig, record, factors = standing
    found = process(record.raw, rig, factors, "thesis")
    forces = record.motion.tyre_force_kN
    assert found.force_kN[0] == pytest.approx(forces[0], abs=0.1)
    assert found.force_kN[-1] == pytest.approx(forces[-500:].mean(), abs=0.2)
    assert np.isfinite(found.displacement_mm).all()


def test_channels_are_those_that_the_rig_names(standing):
    rig, record, _ = standing
    names = [channel.name for channel in record.raw.segments[0]]
    units = {channel.name: channel.unit for channel in record.raw.segments[0]}
    if rig.name == "flat_ground":
        assert names == ["Acc m/s^2", "Disp mm", "Load kN", "Time Elapsed"]
        assert [units[name] for name in names[:3]] == ["m/s^2", "mm", "kN"]
    else:
        assert names == ["Acc m/s^2", "Stroke mm", "Raw Load Voltage", "Load kN", "Time Elapsed"]


def test_volts_alone_serve_the_sensor_that_has_a_line():
    rig = readme_rig("direct_acting")
    record, factors = simulated(rig)
    volts_alone = tuple(channel for channel in record.raw.segments[0] if channel.name != "Load kN")
    both = process(record.raw, rig, factors, "inertia")
    alone = process(RawSignals((volts_alone,)), rig, factors, "inertia")
    np.testing.assert_allclose(alone.force_kN, both.force_kN, rtol=0, atol=1e-9)
    no_acceleration = tuple(channel for channel in record.raw.segments[0] if channel.name != "Acc m/s^2")
    with pytest.raises(BadInput, match=r"no channel 'Acc m/s\^2'.*'Raw Acc Voltage' in \[calibration\]"):
        process(RawSignals((no_acceleration,)), rig, factors, "inertia")


def test_a_wheel_that_rolls_on_flat_ground_turns_alone():
    rig = readme_rig("flat_ground")
    assert len(nominal_bodies(rig, 15.0)) == 1
    record, factors = simulated(rig, ROLLING, duration_s=6.0, start_s=4.0)
    assert record.row["roller_turn_Hz"] == 0.0
    found = process(record.raw, rig, factors, "inertia")
    # As for the rollers' rolling record: road noise that no sine removes leaves some per cent.
    assert slope(found.displacement_mm, found.force_kN) == pytest.approx(record.row["k_kN_per_mm"], rel=0.12)
    # The wheel's three harmonics at the measurement point, a lever of 1000 / 1200 in; the axle follows them slowly.
    turn = record.row["wheel_turn_Hz"]
    sines = [record.row[f"wheel_runout_{n}_mm"] * (2 * np.pi * n * turn) ** 2 / 1.2e3 for n in (1, 2, 3)]
    assert found.extras["runout_rms_m_per_s2"] == pytest.approx(np.sqrt(np.square(sines).sum() / 2), rel=0.1)


def test_a_rolling_tyre_of_unknown_radius_is_refused_by_key():
    direct = readme_rig("direct_acting")
    record, factors = simulated(readme_rig("flat_ground"), ROLLING, duration_s=3.0, start_s=1.2)
    unnamed = direct.model_copy(update={"channels": readme_rig("flat_ground").channels, "signs": type(direct.signs)()})
    with pytest.raises(BadInput, match=r"rig 'direct_acting', key tyre: is missing; add it"):
        process(record.raw, unnamed, factors, "inertia")
    with pytest.raises(BadInput, match="key tyre: is missing"):
        draw_truth(planned(ROLLING), direct, 0)


def test_the_rig_files_mass_counts_as_much_as_it_says(standing):
    """Known to nothing, the record's own mass is taken; known exactly, the file's, a little wrong or not."""
    rig, record, factors = standing

    def mass(kg: float, relative_sd: float) -> tuple[float, float]:
        axle = rig.axle.model_copy(update={"effective_mass_kg": kg, "effective_mass_relative_sd": relative_sd})
        extras = process(record.raw, rig.model_copy(update={"axle": axle}), factors, "inertia").extras
        return float(extras["mass_kg"]), float(extras["mass_from_record_kg"])

    near = 1.05 * float(record.row["m_kg"])
    assert mass(near, 0.0)[0] == pytest.approx(near, rel=1e-6)
    wrong = 1.5 * rig.axle.effective_mass_kg
    free, alone = mass(wrong, 10.0)
    assert free == pytest.approx(alone, rel=0.02)
    half, alone = mass(wrong, 0.3)
    assert min(alone, wrong) < half < max(alone, wrong)
