"""Starting points of a fit: where rig or tyre differ from the model, all lead to one optimum, if not to the highest."""

import numpy as np
import pytest
from helpers.mismatched_motions import simulated

from bayes_tyre.inference.motion.record.disturbance.load_departure import load_departure, with_load_departure
from bayes_tyre.inference.motion.record.map_fit import ROUGH_TOLERANCE, rough_map, starting_points
from bayes_tyre.inference.motion.record.model.window import make_window

pytestmark = pytest.mark.usefixtures("fully_compiled")


@pytest.mark.slow
@pytest.mark.parametrize("mismatch", ["load in two stages", "three together"])
def test_starting_points_lead_to_one_optimum(mismatch):
    _, rig, recorded = simulated(mismatch, 2)
    window = make_window(rig, recorded)
    starts, departure = starting_points(rig, window), load_departure(rig, window)
    assert departure.size > 0
    window, starts = with_load_departure(window, departure), starts + np.asarray(departure.standard)
    ends = np.array([rough_map(rig, window, start[None]) for start in starts])
    assert len(ends) == 4
    # Each end is within one tolerated step of the optimum; those of other modes would be standard deviations away.
    assert np.ptp(ends, axis=0).max() < 2 * ROUGH_TOLERANCE
