"""Estimates of a simulated motion relative to its true parameters, and the loop of a known tyre."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import said, sticking_out
from helpers.hand_made_posteriors import TYRE
from matplotlib.figure import Figure
from support import motion_figures
from support.motion_truth import beside_truth, losses_of_logs, true_loop

from bayes_tyre.laws.fancher import Fancher
from bayes_tyre.laws.loop_energy import dissipated_energy_per_cycle, loop_energy
from bayes_tyre.rig.axle import load_rig

TRUTH = np.array([1.8, 0.45, 0.08, 280.0, 0.0015])


def test_a_known_loop_is_that_of_the_law_stepped_round_and_loses_its_energy():
    loop = true_loop(**TYRE, amplitude_mm=2.0)
    force = TYRE["k"] * loop["displacement_mm"] + loop["median_kN"]
    d = loop["displacement_mm"].to_numpy()
    stepped = np.asarray(Fancher(C=0.0, **TYRE).force(np.concatenate([d, d]), float(force.iloc[0])))
    np.testing.assert_allclose(stepped[len(d) :], force, atol=1e-9)
    wanted = float(dissipated_energy_per_cycle(**TYRE, amplitude=2.0))
    # The trapezoid rule on 121 points a branch.
    assert float(loop_energy(d, force.to_numpy())) == pytest.approx(wanted, rel=1e-3)


def test_quantities_beside_their_truth():
    rng, rig = np.random.default_rng(0), load_rig("single")
    logs = np.log(TRUTH) + 0.01 * rng.standard_normal((4000, 5))
    # Draws of no weight say nothing, wherever they are.
    logs[::2] += 1.0
    weights = np.where(np.arange(4000) % 2, 1.0, 0.0)
    table = beside_truth(rig, logs, weights / weights.sum(), TRUTH, 9.0, 2.0).set_index("quantity")
    lost = losses_of_logs(rig, np.log(TRUTH), 9.0, 2.0)
    np.testing.assert_allclose(table["truth"], [*TRUTH, *map(float, lost)])
    # Of 2000 draws with standard deviation 1 % the median is known to 0.028 %, the ends to 0.06 %: four of these.
    k = table.to_dict("index")["k"]
    assert k["median"] == pytest.approx(1.8, rel=1.2e-3)
    assert np.log(k["upper"] / k["lower"]) == pytest.approx(2 * 1.96 * 0.01, abs=3.4e-3)
    lower, truth, upper = table[["lower", "truth", "upper"]].to_numpy(float).T
    assert np.all((lower < truth) & (truth < upper))
    assert table["unit"].to_dict()["energy a cycle"] == "J"


@pytest.fixture
def off() -> Figure:
    one = pd.DataFrame({"quantity": ["k", "x"], "truth": [2.0, 0.5], "median": [2.2, 0.5]})
    one = one.assign(lower=one["median"] * 0.9, upper=one["median"] * 1.1)
    return motion_figures.off_the_truth(pd.concat([one.assign(record="a"), one.assign(record="b")]))


def test_how_far_off_is_drawn_in_per_cent(off):
    (ax,) = off.get_axes()
    marked = [np.asarray(line.get_xydata()) for line in ax.lines if line.get_marker() not in ("None", None, "")]
    assert [line[:, 0].tolist() for line in marked] == [pytest.approx([10.0, 0.0], abs=1e-9)] * 2
    assert marked[0][0, 1] != marked[1][0, 1]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["k", "x"]
    assert "off the truth (%)" in said(off)
    assert not sticking_out(off)
