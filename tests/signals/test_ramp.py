"""The ramp of a load: found where a search through all residuals finds it, to the bit."""

import numpy as np
import pytest

from bayes_tyre.signals import ramp


def _by_residuals(time_s, blocks, before, after):
    """The same search without the ranking by sums: every ramp against every block."""
    best, least = (time_s[0], time_s[-1]), np.inf
    for length_s in np.geomspace(4e-3, 0.6, 40):
        starts = np.arange(time_s[0], time_s[-1] - length_s, 2e-3)
        share = np.clip((time_s - starts[:, None]) / length_s, 0.0, 1.0)
        misfit = np.sum((blocks - before - (after - before) * share) ** 2, axis=1)
        if len(starts) and misfit.min() < least:
            i = int(np.argmin(misfit))
            best, least = (float(starts[i]), float(starts[i] + length_s)), float(misfit[i])
    return best


@pytest.mark.parametrize("sd", [0.0, 1e-9, 0.4, 5.0])
@pytest.mark.parametrize("converter_kN", [None, 0.374])
@pytest.mark.parametrize("change_kN", [10.0, -7.0, 1e-3])
@pytest.mark.parametrize("first_s", [0.0, 3600.0])
def test_ranking_by_sums_finds_the_ramp_of_the_least_squares(sd, converter_kN, change_kN, first_s):
    rng = np.random.default_rng(0)
    time_s = first_s + (np.arange(400) + 0.5) * 2e-3
    load = 20.0 + change_kN * np.clip((time_s - first_s - 0.31) / 0.043, 0.0, 1.0) + sd * rng.standard_normal(400)
    if converter_kN:
        load = np.round(load / converter_kN) * converter_kN
    found = ramp._least_squares(time_s, load, 20.0, 20.0 + change_kN)
    assert found == _by_residuals(time_s, load, 20.0, 20.0 + change_kN)


def test_a_short_recording_is_one_ramp():
    time_s = np.array([1e-3, 3e-3])
    assert ramp._least_squares(time_s, np.array([0.0, 1.0]), 0.0, 1.0) == (1e-3, 3e-3)
