"""A simulated record: the source's example, the same at any rate, order and restart, and what is refused."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest
from helpers.moving_axle import Spring

from bayes_tyre.errors import BadInput
from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.rig import geometry
from bayes_tyre.rig.axle import load_rig
from bayes_tyre.rig.motion import Body, Drive, Start, move, node_times
from bayes_tyre.simulate.draw import draw_truth
from bayes_tyre.simulate.drive import cylinder_load, runout
from bayes_tyre.simulate.plan import Planned, thesis_plan
from bayes_tyre.simulate.simulator import Simulated, simulate_record
from bayes_tyre.simulate.truth import Truth

RIGS = {name: load_rig(name) for name in ("single", "dual")}
RIG = RIGS["single"]


def planned(file: str, rate_Hz: float = 2000.0, duration_s: float = 2.0) -> Planned:
    """Return a record of the test plan, cut short, with the step between 0.5 and 0.6 s."""
    record = next(record for record in thesis_plan(rate_Hz) if record.file == file)
    return record._replace(duration_s=duration_s, step_between_s=(0.5, 0.6))


def truth_of(file: str, seed: int = 0, rate_Hz: float = 2000.0, duration_s: float = 2.0) -> Truth:
    record = planned(file, rate_Hz, duration_s)
    return draw_truth(record, RIGS[record.case.configuration], seed)


def values(simulated: Simulated, name: str) -> np.ndarray:
    return next(channel.values for channel in simulated.raw.segments[0] if channel.name == name)


@pytest.mark.parametrize("seed", range(4))
def test_the_sources_example_responds_in_40_ms_by_2_9_mm(seed):
    """Single, 30 to 20 kN, standing: 39.6 and 40.6 ms, 2.928 mm at the measurement point.

    On the rig's own estimate of the mass and on exact loads; k, friction, damping and start as drawn.
    """
    drawn = truth_of("DynamicS(0)30-20(1).lvm", seed, rate_Hz=10_000.0, duration_s=4.0)
    truth = replace(drawn, m_kg=285.0, load_before_kN=30.0, load_after_kN=20.0, rise_time_s=0.036)
    simulated = simulate_record(truth, RIG)
    up = (simulated.motion.displacement_mm[0] - simulated.motion.displacement_mm) * 950 / 1300
    settled = up[-5000:].mean()
    assert settled == pytest.approx(2.928, rel=0.07)
    response_s = simulated.time_s[np.argmax(up >= settled)] - truth.step_start_s
    assert response_s == pytest.approx(0.040, abs=0.002)
    # The file shows it: the laser by its means, the load cell by its own.
    laser = values(simulated, "Disp mm")
    assert laser[:5000].mean() - laser[-5000:].mean() == pytest.approx(settled, abs=0.002)
    load = values(simulated, "Load kN")
    assert load[:5000].mean() - load[-5000:].mean() == pytest.approx(10.0, abs=0.05)


def test_a_standing_axle_stays_at_rest_until_the_step():
    truth = truth_of("DynamicD(0)10-20(2).lvm")
    simulated = simulate_record(truth, RIGS["dual"])
    before = simulated.time_s < truth.step_start_s
    d = simulated.motion.displacement_mm[before]
    np.testing.assert_allclose(d, d[0], rtol=0, atol=1e-11)
    assert np.abs(simulated.motion.acceleration_m_per_s2[before]).max() < 1e-9
    at_rest = geometry.tyre_load(RIGS["dual"], truth.load_before_kN)
    np.testing.assert_allclose(simulated.motion.tyre_force_kN[before], at_rest, rtol=1e-12)
    assert simulated.row["start_friction_kN"] == pytest.approx(truth.rest_friction_kN, abs=1e-9)


@pytest.mark.parametrize("file", ["DynamicS(0)20-30(1).lvm", "DynamicS(35)20-25(3).lvm"])
def test_the_motion_is_the_same_at_1_and_10_kHz(file):
    slow = simulate_record(truth_of(file, rate_Hz=1000.0), RIG)
    fast = simulate_record(truth_of(file, rate_Hz=10_000.0), RIG)
    np.testing.assert_allclose(slow.time_s, fast.time_s[::10], atol=1e-12)
    np.testing.assert_allclose(slow.motion.displacement_mm, fast.motion.displacement_mm[::10], rtol=0, atol=5e-6)
    keys = ("k_kN_per_mm", "start_displacement_mm", "start_friction_kN")
    for key in keys:
        assert slow.row[key] == pytest.approx(fast.row[key], abs=2e-5)


def test_a_record_does_not_depend_on_those_before_it():
    files = ["DynamicS(25)30-20(1).lvm", "DynamicS(0)10-3(2).lvm", "DynamicS(25)30-20(2).lvm"]

    def made(order):
        return {file: simulate_record(truth_of(file, 7), RIG) for file in order}

    one, two = made(files), made(files[::-1])
    for file in files:
        assert one[file].row == two[file].row
        for a, b in zip(one[file].raw.segments[0], two[file].raw.segments[0], strict=True):
            np.testing.assert_array_equal(a.values, b.values)
    assert not np.array_equal(values(one[files[0]], "Disp mm"), values(one[files[2]], "Disp mm"))
    other = simulate_record(truth_of(files[0], 8), RIG)
    assert not np.array_equal(values(other, "Disp mm"), values(one[files[0]], "Disp mm"))


def test_the_row_holds_all_that_the_motion_needs_to_start_anew_at_the_first_sample():
    truth = truth_of("DynamicS(35)30-20(1).lvm", rate_Hz=5000.0, duration_s=1.0)
    simulated = simulate_record(truth, RIG)
    row = {name: value for name, value in simulated.row.items() if isinstance(value, float)}
    nodes = node_times(simulated.time_s, 1)
    law = Fancher(k=row["k_kN_per_mm"], C=row["C_kN"], x=row["x_kN"], beta=row["beta_mm"])
    start = Start(row["start_displacement_mm"], row["start_velocity_mm_per_s"], row["start_tyre_force_kN"])
    drive = Drive(nodes, geometry.tyre_load(RIG, cylinder_load(truth, nodes)), runout(truth, nodes))
    body = Body(law, row["m_kg"], row["c_kN_s_per_mm"])
    again = jax.jit(lambda drive: move(RIG, body, drive, start).at_samples(1))(drive)
    np.testing.assert_allclose(again.displacement_mm, simulated.motion.displacement_mm, rtol=0, atol=1e-6)
    assert abs(row["start_velocity_mm_per_s"]) > 1e-3
    assert abs(row["start_friction_kN"]) <= row["x_kN"]


def test_rolling_has_forgotten_how_it_began():
    truth = truth_of("DynamicS(15)30-20(1).lvm")
    other = replace(truth, rest_friction_kN=-truth.rest_friction_kN)
    one, two = (simulate_record(one, RIG).motion.acceleration_m_per_s2[:1000] for one in (truth, other))
    np.testing.assert_allclose(one, two, rtol=0, atol=0.02 * float(one.std()))


def test_the_step_starts_on_the_flat_ground_point_of_the_row():
    truth = truth_of("DynamicS(0)30-20(1).lvm")
    row: dict[str, Any] = simulate_record(truth, RIG).row
    expected = truth.k_kN_per_mm * row["d_i_mm"] + truth.C_kN + truth.rest_friction_kN
    assert row["F_i_kN"] == pytest.approx(expected, rel=1e-9)
    assert row["origin"] == "simulated"


def test_another_law_moves_the_same_axle():
    truth = truth_of("DynamicS(0)30-20(1).lvm")
    truth = replace(truth, C_kN=0.0, rest_friction_kN=0.0)
    spring = simulate_record(truth, RIG, law=Spring(truth.k_kN_per_mm)).motion.displacement_mm
    usual = simulate_record(truth, RIG).motion.displacement_mm
    assert spring[0] == pytest.approx(usual[0])
    # Without friction it rings on: a second after the step only the damping has been at work.
    assert np.ptp(spring[-400:]) > 2 * np.ptp(usual[-400:])


@pytest.mark.parametrize(("change", "said"), [({"x_kN": 0.05}, "makes energy"), ({"load_after_kN": -6.0}, "lifts off")])
def test_what_cannot_be_a_tyre_on_its_rollers_is_refused(change, said):
    with pytest.raises(BadInput, match=said) as caught:
        simulate_record(replace(truth_of("DynamicS(0)30-20(1).lvm"), **change), RIG)
    assert "single (0)30-20(1)" in str(caught.value)
    assert "\n" not in str(caught.value)
