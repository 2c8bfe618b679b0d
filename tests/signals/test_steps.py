"""The step: found wherever it is, up or down, at any rate, standing and rolling; and refused where it is not clear."""

import numpy as np
import pytest
from helpers.steps_made import RIGS, plain, simulated

from bayes_tyre.errors import BadInput
from bayes_tyre.signals.channels import find_channels
from bayes_tyre.signals.process import prepare
from bayes_tyre.signals.steps import find_step


@pytest.mark.parametrize("rate_Hz", [1000.0, 10_000.0])
@pytest.mark.parametrize("start_s", [0.5, 1.3, 4.4])
@pytest.mark.parametrize("change_kN", [-10.0, 5.0])
def test_a_step_is_found_wherever_it_is(rate_Hz, start_s, change_kN):
    step = find_step(plain(change_kN, start_s, 5.0, rate_Hz))
    assert step.onset / rate_Hz == pytest.approx(start_s, abs=2e-3)
    assert step.start <= step.onset
    assert step.ramp.start_s == pytest.approx(start_s, abs=6e-3)
    assert step.ramp.end_s == pytest.approx(start_s + 0.04, abs=6e-3)
    assert step.change_kN == pytest.approx(change_kN, abs=0.1)
    assert step.settled / rate_Hz == pytest.approx(start_s + 0.04, abs=5e-3)
    assert step.load_clarity > 20
    assert step.acceleration_clarity > 100


def test_no_step_is_refused_with_its_figures():
    """A false alarm needs means of some 50 blocks to differ by 5 of their standard deviations: none in 20 tries."""
    for seed in range(20):
        with pytest.raises(BadInput, match=r"load changes by .* times the noise .* a step needs 5"):
            find_step(plain(0.0, seed=seed))


def test_a_load_without_motion_is_refused_with_its_figures():
    signals = plain()
    still = signals._replace(acceleration_m_per_s2=np.roll(signals.acceleration_m_per_s2, 2000))
    with pytest.raises(BadInput, match=r"acceleration spikes by .* times the noise of its 5 ms means"):
        find_step(still)


@pytest.mark.parametrize("start_s", [0.2, 2.3])
def test_a_step_at_the_very_end_has_no_rest(start_s):
    with pytest.raises(BadInput, match="s of rest before and after"):
        find_step(plain(start_s=start_s))


@pytest.mark.parametrize("rate_Hz", [1000.0, 5000.0])
@pytest.mark.parametrize("file", ["DynamicS(0)30-20(1).lvm", "DynamicD(0)20-30(1).lvm", "DynamicS(0)10-3(2).lvm"])
def test_the_onset_is_within_ms_of_the_loads_step(file, rate_Hz):
    record, factors = simulated(file, rate_Hz)
    step = prepare(record.raw, RIGS[factors.case.configuration], factors).step
    late_s = step.onset / rate_Hz - float(str(record.row["step_start_s"]))
    assert -1e-3 <= late_s <= 5e-3


@pytest.mark.parametrize("file", ["DynamicS(35)10-15(1).lvm", "DynamicD(25)20-30(1).lvm", "DynamicS(15)30-25(1).lvm"])
def test_rolling_steps_stand_out_once_the_runout_is_removed(file):
    record, factors = simulated(file, 2000.0, 6.0, 3.5)
    rig = RIGS[factors.case.configuration]
    found = prepare(record.raw, rig, factors)
    quiet = found.step.pre_step
    raw = find_channels(record.raw, rig).acceleration_m_per_s2[:quiet]
    assert np.std(found.signals.acceleration_m_per_s2[:quiet]) < 0.75 * np.std(raw)
    late_s = found.step.onset / 2000.0 - float(str(record.row["step_start_s"]))
    assert -2e-3 <= late_s <= 15e-3


def test_a_load_that_goes_the_other_way_than_its_words_is_refused():
    record, factors = simulated("DynamicS(0)30-20(1).lvm")
    wrong = factors._replace(case=factors.case._replace(step_kN=10.0, direction="loading"))
    with pytest.raises(BadInput, match=r"changes by -.* kN where the factors say \+10 kN"):
        prepare(record.raw, RIGS["single"], wrong)
