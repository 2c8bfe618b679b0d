"""The width of a goal's interval against tests: what is drawn is the plan, from the width now on."""

import numpy as np
import pandas as pd
import pytest
from helpers.drawings import markers, said, sticking_out

from bayes_tyre.report.figures.page.colours import Setting
from bayes_tyre.report.figures.tests_to_run import width_against_tests

PLAN = pd.DataFrame({"kind": ["repeat", "case", "repeat"], "width_expected": [0.04, 0.03, 0.025]})


def test_every_width_is_drawn_at_its_test_in_per_cent():
    ax = width_against_tests(PLAN, 0.05, 0.02, "k dual / single", Setting("simulated")).axes[0]
    np.testing.assert_allclose(markers(ax, "o"), [[0, 5.0], [1, 4.0], [3, 2.5]])
    np.testing.assert_allclose(markers(ax, "s"), [[2, 3.0]])
    assert ax.get_ylim()[0] == 0.0


@pytest.mark.parametrize("plan", [PLAN, PLAN[:0]])
def test_the_figure_says_what_it_shows_and_where_the_data_come_from(plan):
    goal = "k $dual$ / " + "very long " * 20
    figure = width_against_tests(plan, 0.05, 0.02, goal, Setting("reconstructed", "fail"))
    texts = " ".join(said(figure))
    assert "data: reconstructed, not measured" in texts
    assert "not to be trusted" in texts
    assert "further tests" in texts
    assert sticking_out(figure) == []
