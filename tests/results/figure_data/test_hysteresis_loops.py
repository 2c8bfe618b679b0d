"""The hysteresis loop of a tyre from a posterior of motions, and its figure."""

import numpy as np
from helpers.drawings import said, sticking_out
from helpers.hand_made_posteriors import motion_cases
from matplotlib.colors import to_hex
from support.motion_truth import true_loop

from bayes_tyre.report.figures import motion as motion_figures
from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.results.figure_data.hysteresis_loops import friction_loops


def test_loops_of_a_posterior_are_those_of_its_draws():
    loops = friction_loops(motion_cases())
    for name, x in (("single", 0.45), ("dual", 0.9)):
        mine = loops[loops["configuration"] == name]
        wanted = true_loop(1.8, x, 0.08, 2.0)
        for column in ("median_kN", "lower_kN", "upper_kN"):
            np.testing.assert_allclose(mine[column], wanted["median_kN"], atol=1e-12)


def test_the_figure_of_loops_names_stroke_and_interval_and_keeps_the_colours():
    figure = motion_figures.loops_by_direction(friction_loops(motion_cases()), Setting("simulated"), 2.0)
    texts = said(figure)
    assert any("Half the stroke is 2 mm" in text and "95 % interval" in text.replace("\n", " ") for text in texts)
    assert "data: simulated, not measured" in texts
    assert not sticking_out(figure)
    (ax,) = figure.get_axes()
    paths = {to_hex(line.get_color()): np.asarray(line.get_xydata()) for line in ax.lines}
    drawn = {colour: path[:, 1].max() for colour, path in paths.items() if len(path) > 2}
    both = Setting("measured").looks(("single", "dual"))
    assert drawn[both["dual"].colour.lower()] > drawn[both["single"].colour.lower()] > 0
