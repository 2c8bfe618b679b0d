"""The figure of driven curves: points, laws and backbones are drawn, all stays on the page, the rest is counted."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import said, sticking_out
from matplotlib.figure import Figure

from bayes_tyre.report.figures.loops import driven_loops
from bayes_tyre.report.figures.page.colours import Setting


def figure(curves: int) -> Figure:
    d = np.linspace(0.0, 5.0, 9)
    branches, backbones = [], []
    for loop in (f"curve {i} $x^$" for i in range(curves)):
        for number, path in ((1, d), (2, d[::-1])):
            points = {"displacement_mm": path, "force_kN": 2 * path + 1.5 - number, "loop": loop, "branch": number}
            branches.append(pd.DataFrame({**points, "record": f"{loop} {number}"}))
        backbones.append(pd.DataFrame({"record": loop, "cycle": 1, "displacement_mm": d, "backbone_kN": 2 * d}))
    laws = np.stack([np.stack([part["displacement_mm"], part["force_kN"]], axis=1) for part in branches])
    return driven_loops(pd.concat(branches), laws, pd.concat(backbones), Setting("measured", configurations=("",)))


def test_points_laws_and_backbone_are_drawn_and_named():
    drawn = figure(1)
    points, up, down, backbone = (np.asarray(line.get_xydata()) for line in drawn.axes[0].lines)
    assert len(points) == 18
    np.testing.assert_array_equal(up[:, 1] - down[::-1, 1], np.ones(9))
    np.testing.assert_array_equal(backbone[:, 1], 2 * backbone[:, 0])
    texts = "\n".join(said(drawn))
    for text in ("displacement (mm)", "force (kN)", "Equation 2, each branch", "backbone", "measured"):
        assert text in texts


@pytest.mark.parametrize(("curves", "panels"), [(2, 2), (10, 8)])
def test_curves_beyond_the_eighth_are_counted_and_all_stays_on_the_page(curves, panels):
    drawn = figure(curves)
    assert sum(ax.get_visible() for ax in drawn.axes) == panels
    assert ("The first 8 of 10 curves." in "\n".join(said(drawn))) is (curves == 10)
    assert sticking_out(drawn) == []
